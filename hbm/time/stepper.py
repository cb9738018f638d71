"""One problem made ready for time stepping at one frequency, and periods marched with it, see `time_step`.

The structure moves in its modal coordinates without contact, exactly but for the contact forces, which count by their
mean over a step. The law is the `step` kernel of the balance."""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass

import numpy as np
import scipy.linalg as sla

from tribodyn.fem.modes import dense_modes
from tribodyn.fem.system import SecondOrderSystem
from tribodyn.hbm.balance import HarmonicBalance, State
from tribodyn.hbm.contact import compiled_law
from tribodyn.hbm.contact.contact_law import STICKS
from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.hbm.time import compile_ahead, coupled_pairs, law_in_time, rigid_contact, time_step
from tribodyn.hbm.time.hold import Hold
from tribodyn.hbm.time.time_step import Moving, Record
from tribodyn.refusal import Refusal, SolverFailure

RESOLVED = 1.0  # omega h of a mode from which on its inertia is left out
MASSLESS = 1e150  # eigenvalue of modes without mass, whose compliance alone counts


@dataclass(frozen=True)
class Options:
    """How to integrate.

    steps : time steps per period; the error falls with its square
    tolerance : periodic when the state changes by less than this over one period, relative to its vibration
    max_periods : periods after which to give up; patience : periods without a smaller drift after which to give up
    accelerate : mix the states of past periods (Anderson) instead of waiting for the transient to decay; finds
        unstable periodic motions, too, from which a plain march would leave. A slider that never slips in the periodic
        motion then stands where the load path of the balance left it; else, or when rigid, where the transient did
    contact : accuracy of the contact's equations, see `coupled_pairs.Contact`
    rigid : unilateral contact and Coulomb friction without the springs of the contact, see `rigid_contact`"""

    steps: int = 1024
    tolerance: float = 1e-8
    max_periods: int = 2000
    patience: int = 80
    accelerate: bool = True
    contact: float = 1e-12
    rigid: bool = False

    def __post_init__(self) -> None:
        if self.steps < 8:
            raise Refusal(f"steps per period must be at least 8, not {self.steps}")


class IntegrationFailed(SolverFailure):
    """The contact iteration of a time step did not converge."""


class TimeStepper:
    """One problem made ready for time stepping at one frequency.

    n_dynamic : modes of the structure without contact that move dynamically, the lowest ones with omega h < RESOLVED;
        the others follow statically, so that all of them count and the more of them move the finer the steps are
    lam, damping : of the modes that move, (n_dynamic,) and (n_dynamic, n_dynamic), with unit modal mass
    linear : see `time_step`; contact : see `coupled_pairs`
    static : (n_contact, n_contact) compliance W of the modes that follow, less that of the springs in series
    series : (n_pair, n_component) compliance of these, zero but for a rigid contact [m/N]
    modes : of the structure without contact, where another stepper of the same model has them already
    hold : what holds a displacement that is prescribed in harmonic 0; None where there is none
    Raises  ValueError for models whose harmonics see different systems but for such a displacement, or whose mass
        matrix is singular"""

    def __init__(
        self,
        balance: HarmonicBalance,
        omega: float,
        options: Options,
        modes: tuple[np.ndarray, np.ndarray] | None = None,
    ):
        model = balance.model
        model.require_masters("time integration")
        if not model.has_motion_in_time:
            raise Refusal(
                "time integration needs one system for all harmonics: a cyclic part alone has no equation of motion in "
                "time"
            )
        self.h = 2 * np.pi / omega / options.steps
        self.balance = balance = law_in_time.timed(balance, self.h)
        self.is_timed = isinstance(balance.contact.joints[0], law_in_time.TimedJoint)
        self.omega, self.options = omega, options
        system = model.system
        self.modes = modes or _free_modes(system)
        lam, phi = self.modes
        m = max(1, int(np.sum(lam < (RESOLVED / self.h) ** 2)))
        self.n_pair, self.c = balance.contact.stiffness.shape
        self.stops = options.rigid and rigid_contact.stops_masses(m, len(lam), balance.contact)
        B = np.asarray(model.interface.B)
        if options.rigid and not self.stops:
            m = rigid_contact.moving_modes(m, lam, B @ phi, balance.contact, self.h)
        self.n_dynamic = m
        self.lam, moving, static_part = lam[:m], phi[:, :m], phi[:, m:] / np.sqrt(lam[m:])
        U, follows = np.ascontiguousarray(B @ moving), B @ static_part
        self.static = follows @ follows.T
        rate = system.velocity_matrix
        full = np.zeros((m, m)) if rate is None else moving.T @ np.asarray(rate) @ moving
        self.damping = full
        self.flow = np.zeros((m, m)) if system.circulatory is None else moving.T @ system.circulatory @ moving
        flow = None if system.circulatory is None else self.flow
        damping_size = np.abs(np.diag(full))
        off = np.abs(full - np.diag(np.diag(full)))
        limit = 1e-9 * np.sqrt(np.outer(damping_size, damping_size)) + 1e-13 * damping_size.max()
        diagonal = flow is None and bool(np.all(off <= limit))
        names = balance.compliance.output_names
        rows = np.array([system.outputs[name] for name in names]).reshape(len(names), len(phi))
        basis = balance.basis
        force = balance.loaded(self._load(len(phi)))  # (n, n_coeff)
        self._modal_load = moving.T @ force
        samples = self._samples = basis.functions(2 * np.pi * np.arange(1, options.steps + 1) / options.steps)
        base = balance.excitation.base
        self._base = np.zeros((len(B), basis.n_coeff)) if base is None else balance.loaded(base)
        if self.stops:
            E, Q, impulse = rigid_contact.stopping_step(np.diag(self.lam) + self.flow, full, self.h, self._modal_load)
        else:
            E, Q, impulse = _exact_step(self.lam, full, flow, diagonal, self.h, self._modal_load, basis, omega)
        static = int(basis.has_static)
        self.hold = Hold.of(balance, force[:, :static].sum(axis=1), self._base[:, :static].sum(axis=1))
        at = np.zeros((len(phi), 0)) if self.hold is None else self.hold.at
        rows = np.concatenate([rows, at.T])
        self._seen = rows @ moving, -(rows @ static_part) @ follows.T  # outputs of eta and of the contact force
        self.rest = follows @ (static_part.T @ force) - self._base  # (n_contact, n_coeff)
        self._output_rest = samples @ ((rows @ static_part) @ (static_part.T @ force)).T  # (n_step, n_output)
        modal = moving.T @ at
        self._of_hold = modal, Q @ modal, follows @ (static_part.T @ at), (rows @ static_part) @ (static_part.T @ at)
        self.linear = time_step.Linear(
            E, Q, U, np.ascontiguousarray(np.roll(samples, 1, axis=0) @ impulse.T),
            np.ascontiguousarray(samples @ self.rest.T), 1.0 if self.stops else 0.5,
        )  # fmt: skip
        compliance = self.linear.late * U @ (Q[:m] @ U.T) + self.static
        self.series = np.zeros((self.n_pair, self.c))
        if options.rigid:
            self.balance = balance = rigid_contact.without_springs(balance, compliance if self.stops else self.static)
            self.series = 1 / balance.contact.stiffness
            compliance, self.static = (A - np.diag(self.series.ravel()) for A in (compliance, self.static))
        symmetric = system.gyroscopic is None and system.circulatory is None
        A = np.ascontiguousarray(0.5 * (compliance + compliance.T) if symmetric else compliance.T)
        joint = balance.contact.merge("time integration")
        packed, gap, components = joint.parameters.packed(), joint.parameters.gap, joint.parameters.components
        normal = components.index("n") if "n" in components else -1
        self.law = compiled_law.pointer(joint.module.step)
        compile_ahead.wait()
        forgets = normal >= 0 and time_step.forgets(self.law, packed, gap, normal, balance.memory)
        self.contact = coupled_pairs.Contact(packed, gap, normal, A, forgets, options.contact)
        self._space = coupled_pairs.Space.of(self.n_pair, self.c, balance.memory.shape[1])

    def worn(self, balance: HarmonicBalance) -> TimeStepper:
        """The same for a balance that differs in its gaps alone."""
        other = copy(self)
        other.balance = balance = law_in_time.timed(balance, self.h)
        parameters = balance.contact.merge("time integration").parameters
        other.contact = self.contact._replace(p=parameters.packed(), gap=parameters.gap)
        return other

    def _load(self, n: int) -> np.ndarray:
        """(n, n_coeff) coefficients of the loads."""
        basis, loads = self.balance.basis, self.balance.model.system.loads
        return basis.to_real(np.stack([self.balance.excitation.force(h, loads, n) for h in basis.harmonics], axis=1))

    def start_from(self, state: State, at_rest: bool = False, added: float = 0.0) -> Moving:
        """What moves at t = 0 in a balance state, every coordinate in equilibrium with its contact forces.

        at_rest : leave out all but harmonic 0; added : damping ratio of the term - 2 zeta w M q' that sustains a
            nonlinear mode"""
        basis, m = self.balance.basis, self.n_dynamic
        contact_force = state.cycle.force.reshape(len(self.static), -1)
        hold = np.zeros(0) if self.hold is None else self.hold.in_balance(state)
        force = basis.to_complex(self._modal_load - self.linear.U.T @ contact_force)
        eta, v = np.zeros(m), np.zeros(m)
        for i, h in enumerate(basis.harmonics):
            if h == 0:
                eta += self._at_rest(state, hold)
            elif not at_rest:
                s = 1j * h * self.omega
                amplitude = np.linalg.solve(
                    np.diag(self.lam + s * s - 2 * added * self.omega * s) + s * self.damping + self.flow, force[:, i]
                )
                eta += amplitude.real
                v += (s * amplitude).real
        angles = 2 * np.pi * np.arange(1, self.options.steps + 1) / self.options.steps
        x = (state.x @ basis.functions(angles).T).transpose(2, 0, 1)
        memory = self.memory_of(np.ascontiguousarray(x))
        return self.moving(np.concatenate([eta, self.h * v]), memory, x[-1], state.cycle.force[..., 0], hold)

    def _at_rest(self, state: State, hold: np.ndarray) -> np.ndarray:
        """Modal coordinates of harmonic 0, by the stuck system: without contact a part may be loose."""
        k, U = self.balance.compliance.k, self.linear.U
        modal, _, static_part, _ = self._of_hold
        pull = (
            k * (state.flat[:, 0] - self.rest[:, 0] - static_part @ hold) - state.cycle.force.reshape(len(k), -1)[:, 0]
        )
        pull += k * (self.static @ state.cycle.force.reshape(len(k), -1)[:, 0])
        solution: np.ndarray = np.linalg.solve(
            np.diag(self.lam) + self.flow + U.T @ (k[:, None] * U), self._modal_load[:, 0] + modal @ hold + U.T @ pull
        )
        return solution

    def memory_of(self, x: np.ndarray) -> np.ndarray:
        """Memory of the periodic cycle of x (n_step, n_pair, c) that begins where the balance's load path does."""
        memory: np.ndarray = time_step.memory_after(self.law, x, self.contact, self.balance.memory)[0]
        return memory

    def moving(self, z: np.ndarray, memory: np.ndarray, x: np.ndarray, f: np.ndarray, hold: np.ndarray) -> Moving:
        """What moves at t = 0 from z = (eta, h v), memory and hold, with guesses for x and f (n_pair, c)."""
        x, f, s = np.array(x), np.array(f), np.array(memory)
        x_free = self.linear.U @ z[: self.n_dynamic] + self.rest @ self.balance.basis.functions(np.zeros(()))
        x_free += self._of_hold[2] @ hold
        contact = self.contact._replace(A=self.static)
        closed = np.zeros(self.n_pair, bool)
        if self.stops:  # the force of a mass that is stopped is one of a step, not of an instant
            return Moving(z.copy(), x_free.reshape(x.shape) + self.series * f, f, s, np.full(len(x), STICKS), hold)
        if self.is_timed:  # another step of the law would be one in time
            x = (x_free - self.static @ f.ravel()).reshape(x.shape)
            return Moving(z.copy(), x, f, s, np.full(len(x), STICKS), np.array(hold))
        scale, space = float(np.abs(x).max()), coupled_pairs.Space.of(self.n_pair, self.c, s.shape[1])
        coupled_pairs.displace(contact.A, f, space.y)
        rounds, _ = coupled_pairs.solve_contact(self.law, contact, x_free, x.copy(), closed, s, x, f, scale, space)
        if rounds < 0:
            raise IntegrationFailed("the contact has no equilibrium to start from")
        s, bits = time_step.memory_after(self.law, x[None], self.contact, s)
        return Moving(z.copy(), x, f, s, bits, np.array(hold))

    def period(self, start: Moving, with_slopes: bool = False) -> tuple[Moving, Record, int, float]:
        """March one period from t = 0.

        Returns what moves after it, its record, the rounds of the contact solver and the largest modal speed
        Raises  IntegrationFailed"""
        n, n_pair, c, n_state = self.options.steps, self.n_pair, self.c, start.memory.shape[1]
        end = Moving(*(np.array(part) for part in start))
        record = Record(
            np.empty((n, n_pair, c)), np.empty((n, n_pair, c)), np.empty((n, len(start.z))), np.empty((0, 0)),
            np.zeros(n_pair, np.int64), np.zeros((n if with_slopes else 0, n_pair, c + n_state, 2 * c + n_state)),
        )  # fmt: skip
        linear, y = self.linear, self._output_rest
        if self.hold is not None:
            _, impulse, static, output_rest = self._of_hold
            impulse, static = linear.impulse + impulse @ start.hold, linear.rest + static @ start.hold
            linear = linear._replace(impulse=impulse, rest=static)
            y = y + output_rest @ start.hold
        failed, spent, speed = time_step.march(self.law, self.contact, linear, end, record, self._space)
        if failed >= 0:
            raise IntegrationFailed(
                f"the contact iteration did not converge in step {failed} of {n}: take more steps per period"
            )
        of_eta, of_force = self._seen
        y = y + record.z[:, : self.n_dynamic] @ of_eta.T + record.f.reshape(n, -1) @ of_force.T
        return end, record._replace(y=y), spent, speed / self.h

    def work(self, record: Record) -> tuple[float, float]:
        """Work of the loads and of the damping over a recorded period that repeats itself [J]."""
        m, basis = self.n_dynamic, self.balance.basis
        eta, velocity, load = record.z[:, :m], record.z[:, m:] / self.h, self._samples @ self._modal_load.T
        travel = eta - np.roll(eta, 1, axis=0)
        loads = 0.5 * np.sum((load + np.roll(load, 1, axis=0)) * travel)
        # on what follows statically, by parts: contact force times rate of the displacement under the loads
        rate = self.omega * self._samples @ basis.rate.T @ self.rest.T
        loads += self.h * np.sum(rate * record.f.reshape(len(rate), -1))
        return float(loads), float(self.h * np.sum(velocity * (velocity @ self.damping.T + eta @ self.flow.T)))


def _free_modes(system: SecondOrderSystem) -> tuple[np.ndarray, np.ndarray]:
    """Eigenvalues (n,) and modes (n, n) of the structure without contact, of unit modal mass; massless ones are last.

    What has no mass has modes at MASSLESS, whose compliance is that of the stiffness there"""
    K, M = (np.asarray(matrix) for matrix in (system.stiffness, system.mass))
    if all(np.count_nonzero(matrix) == np.count_nonzero(np.diag(matrix)) for matrix in (K, M)):
        k, m = np.diag(K), np.diag(M)
        if (m > 0).all():
            order = np.argsort(k / m, kind="stable")
            return (k / m)[order], np.diag(1 / np.sqrt(m))[:, order]
    lam, phi, static = dense_modes(K, M)
    return np.append(lam, np.full(static.shape[1], MASSLESS)), np.hstack([phi, np.sqrt(MASSLESS) * static])


def _exact_step(
    lam: np.ndarray, damping: np.ndarray, flow: np.ndarray | None, diagonal: bool, h: float, load: np.ndarray,
    basis: HarmonicBasis, omega: float,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:  # fmt: skip
    """E, Q and the impulse per coefficient of the loads (2 m, n_coeff) at the start of the step; see `time_step`.

    load : (m, n_coeff) modal load. All are exponentials of the step's motion together with what drives it"""
    m = len(lam)
    groups = [[i] for i in range(m)] if diagonal else [list(range(m))]
    E, Q, impulse = np.zeros((2 * m, 2 * m)), np.zeros((2 * m, m)), np.zeros((2 * m, basis.n_coeff))
    turn = basis.rate * (omega * h)  # of the basis functions within a step
    for g in groups:
        n, rows = len(g), [*g, *(m + i for i in g)]
        size = 2 * n + n + basis.n_coeff
        rate = np.zeros((size, size))
        rate[:n, n : 2 * n] = np.eye(n)
        rate[n : 2 * n, :n] = -(h**2) * np.diag(lam[g])
        rate[n : 2 * n, n : 2 * n] = -h * damping[np.ix_(g, g)]
        if flow is not None:
            rate[n : 2 * n, :n] -= h**2 * flow[np.ix_(g, g)]
        rate[n : 2 * n, 2 * n : 3 * n] = np.eye(n)
        scale = float(np.abs(load[g]).max()) or 1.0
        rate[n : 2 * n, 3 * n :] = load[g] / scale
        rate[3 * n :, 3 * n :] = turn
        matrix = sla.expm(rate)
        E[np.ix_(rows, rows)] = matrix[: 2 * n, : 2 * n]
        Q[np.ix_(rows, g)] = h**2 * matrix[: 2 * n, 2 * n : 3 * n]
        impulse[rows] = h**2 * scale * matrix[: 2 * n, 3 * n :]
    return E, Q, impulse
