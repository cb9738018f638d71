"""Tests that laboratories make beside constant force: the force is an unknown, and something else is held.

Constant response: at every frequency the force is found that keeps the fundamental amplitude of an output; see
`linear.held_output`. The curve does not fold where that of constant force does.
Phase resonance: while the amplitude goes from small to large, the frequency is found at which the output lags its force
by a quarter of a cycle, as a phase-locked loop does; see `PhaseResonance`.
Every point is returned as the constant force of its size has it: the phases are those of the loads as they stand.
Source  phase resonance of nonlinear structures: Peter and Leine, MSSP 90 (2017) 139; constant response: Karaagacli and
Ozguven, MSSP 146 (2021) 107023"""

from dataclasses import replace

import numpy as np

from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.continuation import nonlinear_modes
from tribodyn.hbm.continuation.branch import Branch
from tribodyn.hbm.continuation.free_vibration import FreeVibration
from tribodyn.hbm.continuation.nonlinear_modes import BackboneOptions
from tribodyn.hbm.linear.held_output import HeldOutput, HeldPoint
from tribodyn.hbm.threads import single
from tribodyn.refusal import Refusal


def constant_response(balance: HarmonicBalance, output: str, amplitude: float) -> HarmonicBalance:
    """The balance of a test that keeps the fundamental amplitude [m] of an output; every continuation follows it.

    Its load factor multiplies the amplitude. What it finds is read by `driven`
    Raises  ValueError where the loads are not of harmonic 1 alone"""
    _require_one_force(balance)
    if not amplitude > 0:
        raise Refusal(f"the amplitude that is held must be above 0, not {amplitude:g} m")
    return replace(balance, compliance=HeldOutput.of(balance.compliance, output, amplitude), load_factor=1.0)


def driven(controlled: HarmonicBalance, branch: Branch) -> Branch:
    """A curve of `constant_response` with the load factor of each point, in the phase of the loads as they stand."""
    force = np.empty(len(branch.omega), complex)
    for i, omega in enumerate(branch.omega):
        state = controlled.evaluate(omega, controlled.shaped(branch.contact[i]), jacobian=False)
        point = controlled.at(omega)
        assert isinstance(point, HeldPoint)
        force[i] = point.force(state.g, controlled.load_factor)
    return _in_phase(controlled, branch, force)


class PhaseResonance(FreeVibration):
    """Vibration driven by the loads of a balance that a mode answers a quarter of a cycle later.

    M q'' + C q' + K q + B^T f_c(x) = F_0 + Re i F exp(i w t),    y_1 = a y_phi

    zeta is the damping ratio by which the mode at rest takes the power of the force, F = 2 zeta w^2 a / (phi^H p).
    low, high : range [rad/s] of the mode at rest; of several the one that the loads move the output most in
    Raises  ValueError where there is none, or loads act in other harmonics"""

    def __init__(self, balance: HarmonicBalance, low: float, high: float, output: str):
        _require_one_force(balance)
        self._range, self._name = (low, high), output
        super().__init__(balance, 0, output)
        self.column = self._load()
        output_row = self._output_row()
        self.row = output_row / (output_row @ self.reference)
        self.sustained, self.push = 0.0, complex(self.reference.conj() @ self.column)

    def driving(self, omega: float, zeta: float, a: float) -> complex:
        """Factor on the loads, its phase a quarter of a cycle ahead of the output."""
        return 2j * zeta * omega**2 * a / self.push

    def _load(self) -> np.ndarray:
        """(n,) modal force of the vibrating loads."""
        system, _ = self.balance.model.at_harmonic(1)
        force = self.balance.excitation.force(1, system.loads, system.n_dof)
        modal_force: np.ndarray = self.modes[self.first].shapes.conj().T @ force
        return modal_force

    def _output_row(self) -> np.ndarray:
        row: np.ndarray = self.modes[self.first].O[self.balance.compliance.output_names.index(self._name)]
        return row

    def _reference(self, mode: int | None, open_rows: np.ndarray) -> tuple[np.ndarray, float, float]:
        squares, shapes = self._at_rest(open_rows)
        omega = np.sqrt(np.maximum(squares, 0.0))
        low, high = self._range
        inside = np.flatnonzero((omega >= low) & (omega <= high) & (omega > 0))
        reached = np.abs((self._output_row() @ shapes) * (shapes.conj().T @ self._load()))[inside]
        if not len(inside) or not reached.max() > 0:
            span = f"{low / (2 * np.pi):.6g} and {high / (2 * np.pi):.6g} Hz"
            raise Refusal(f"no mode that the loads move the output in lies between {span}: give another range")
        return super()._reference(int(inside[np.argmax(reached / squares[inside])]), open_rows)


@single
def phase_resonance(
    balance: HarmonicBalance, output: str, low: float, high: float, start: float, stop: float,
    options: BackboneOptions | None = None,
) -> Branch:  # fmt: skip
    """The curve of resonances at which an output lags its force by a quarter of a cycle.

    low, high : range [rad/s] of the mode at rest; start, stop : fundamental amplitudes of the output [m], either order
    Returns a Branch in the amplitude, whose load factors are the force levels"""
    if not (start > 0 and stop > 0 and start != stop):
        raise Refusal(f"the amplitudes of a phase resonance must be > 0 and differ, not {start:g} and {stop:g}")
    problem = PhaseResonance(balance, low, high, output)
    a, goal = np.log(np.array([start, stop]) / problem.per_amplitude)
    solved, end = nonlinear_modes.walk(problem, float(a), float(goal), options or BackboneOptions())
    mode = nonlinear_modes.result(problem, None, solved, end)
    branch = Branch(
        omega=mode.omega,
        output_names=mode.output_names,
        response=mode.response,
        contact=mode.contact,
        energy=mode.energy,
        outcome=mode.outcome,
        newton_steps=mode.newton_steps,
        end=end,
        harmonics=balance.basis.harmonics,
        parameter_name="amplitude m",
        parameter=mode.reference_amplitude,
    )
    force = [problem.driving(p.omega, p.zeta, p.a) for p, _, _ in solved]
    return _in_phase(balance, branch, np.array(force))


def _require_one_force(balance: HarmonicBalance) -> None:
    """Raise ValueError where what drives the structure is not of harmonic 1 alone."""
    loads, base = balance.excitation.loads, balance.excitation.base
    acting = {h for (h, _), value in loads.items() if h and value != 0}
    moving = base is not None and base[:, balance.basis.order > 0].any()
    if acting != {1} or moving:
        raise Refusal("control finds one force: expected vibrating loads in harmonic 1, and in no other")


def _in_phase(balance: HarmonicBalance, branch: Branch, force: np.ndarray) -> Branch:
    """The points with their complex factors on the loads (n_point,), moved in time until these are real and > 0."""
    angles = -np.angle(force)
    shifted = [
        np.stack([balance.basis.shift(row, angle) for row, angle in zip(rows, angles, strict=True)])
        for rows in (branch.response, branch.contact)
    ]
    return replace(branch, response=shifted[0], contact=shifted[1], load_factor=np.abs(force))
