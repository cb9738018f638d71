"""Exact derivatives of a solved balance by any parameter: one adjoint solve for each quantity, however many parameters.

At a solution x = B u, D_s(w) u = F + B^H g, g = k x - f(x), f the contact forces. A quantity q(x, f, y) of these and
of the outputs y = C u, at a fixed frequency, changes with a parameter p by

    dq/dp = (q_f - B w) . f_p + w . (F_p - D_p u),    w = D_s^-H (C^H q_y + B^H l),
    (I - G dg/dx)^T l = q_x + (df/dx)^T q_f + (dg/dx)^T B D_s^-H C^H q_y

f_p is the change of the contact forces at the same x, F_p - D_p u that of the loads and the dynamic stiffness at the
same u: both are explicit, so that the balance is solved again for no parameter. They are central differences of what
a parameter makes, by a step so small that what they miss is rounding; where a parameter changes the coordinates of the
model, such as the shapes of a reduction, x and y are compared at the same g, which needs no common coordinates.

At a peak of A(w, p), where the slope a_w of a = A^2 / 2 vanishes, dw/dp = - a_wp / a_ww, and dq/dp has q_w dw/dp
besides. a_wp and a_ww are differences along the curve of the exact gradient, of all parameters together. A peak that is
a corner of the curve, where a contact transition begins, stays where both sides meet: dw/dp = - [A_p] / [A_w], with
the jumps of both.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property

import numpy as np
import scipy.linalg as sla

from tribodyn.fem.system import SecondOrderSystem
from tribodyn.hbm import newton
from tribodyn.hbm.balance import HarmonicBalance, State
from tribodyn.hbm.contact.joint import Contact
from tribodyn.hbm.continuation import bordered, parameter
from tribodyn.hbm.continuation.bordered import Direction, Metric
from tribodyn.hbm.continuation.branch import amplitude
from tribodyn.hbm.continuation.folds import FoldOptions
from tribodyn.hbm.continuation.free_vibration import FreeVibration, Point
from tribodyn.hbm.continuation.nonlinear_modes import newton_on
from tribodyn.hbm.continuation.operating_point import Slope
from tribodyn.hbm.excitation import Excitation
from tribodyn.hbm.krylov import gmres
from tribodyn.hbm.linear.recovery import stuck_dynamic_stiffness
from tribodyn.hbm.newton import NewtonOptions, Solution
from tribodyn.hbm.outcome import CONVERGED
from tribodyn.hbm.threads import single
from tribodyn.reduction.model import ReducedModel


@dataclass(frozen=True)
class Rules:
    """How exactly is solved, and what counts as a corner."""

    newton: float = 1e-12  # relative residual of the states that derivatives are taken at
    adjoint: float = 1e-12  # relative residual of an adjoint, and of one that is no solution
    failed: float = 1e-7
    of_mode: float = 1e-10
    most_products: int = 400
    along: float = 2e-4  # half widths of the resonance from a peak to the two points of the gradient along the curve
    at_fold: float = 1e-5  # arc length to the fold; tangents are known to a tenth of it
    most_steps: int = 12  # to a peak, and the first of them over the frequency
    first_step: float = 1e-5
    at_peak: float = 1e-7  # half widths between a peak and where it is foreseen
    at_corner: float = 1e-8  # half widths between both sides of a corner, and the first of four points beside it
    sides: tuple[float, float] = (-3e-4, 3e-4)
    # difference of one-sided derivatives over their size from which on they are two, and size over the largest of all
    # parameters by one step that counts
    corner: float = 1e-2
    of_gap: float = 1e-6  # step of a gap over the largest displacement
    seen: float = 1e-3


RULES = Rules()


class NoDerivative(RuntimeError):
    """There is no derivative here; the message says why."""


@dataclass(frozen=True)
class Quantity:
    """A number q of a solution: its value, and its slopes (n_contact, n_coeff) by x and by the contact forces at fixed
    others, and (n_output, n_coeff) by the outputs.
    """

    name: str
    value: float
    of_x: np.ndarray
    of_force: np.ndarray
    of_output: np.ndarray


def quantities(
    balance: HarmonicBalance, state: State, output: str, worn: Mapping[str, float] | None = None
) -> list[Quantity]:
    """Amplitude [m] and phase [rad] of an output, friction work per cycle [J] and preload [N], of every joint too.

    worn : joint -> wear coefficient [m3/J]: the volume that wears in a cycle [m3] is a quantity too
    What does not occur, such as the work where all pairs stick, is left out
    """
    y, basis, contact = balance.outputs(state), balance.basis, balance.contact
    row, none, no_output = balance.compliance.output_names.index(output), np.zeros_like(state.x), np.zeros_like(y)
    flat = state.flat.shape
    found = []

    def add(name: str, value: float, of_x: np.ndarray, of_force: np.ndarray, of_output: np.ndarray) -> None:
        if value != 0.0:
            found.append(Quantity(name, float(value), of_x.reshape(flat), of_force.reshape(flat), of_output))

    size, slope = float(amplitude(y[row])), no_output.copy()
    if size > 0:
        slope[row] = np.where(basis.order > 0, y[row], 0.0) / size
    add("amplitude", size, none, none, slope)
    driven = [h for h, _ in balance.excitation.loads if h in basis.dynamic] or [basis.dynamic[0]]
    cosine, sine = np.flatnonzero(basis.order == min(driven))
    a, b, slope = y[row, cosine], y[row, sine], no_output.copy()
    if a or b:
        slope[row, cosine], slope[row, sine] = b / (a**2 + b**2), -a / (a**2 + b**2)
        add("phase", float(np.arctan2(-b, a)), none, none, slope)
    energy, s = balance.energy(state), int(basis.has_static)
    of_x, of_force, harmonic = none.copy(), none.copy(), np.pi * np.asarray(basis.dynamic)
    for c in contact.tangential:
        works = (energy != 0)[:, None] * harmonic
        of_force[:, c, s::2], of_force[:, c, s + 1 :: 2] = (
            works * state.x[:, c, s + 1 :: 2],
            -works * state.x[:, c, s::2],
        )
        force = state.cycle.force[:, c]
        of_x[:, c, s::2], of_x[:, c, s + 1 :: 2] = -works * force[:, s + 1 :: 2], works * force[:, s::2]
    normal = none.copy()
    if "n" in contact.components and basis.has_static:
        normal[:, contact.components.index("n"), 0] = 1.0
    parts = {"": np.arange(contact.n_pair)}
    if len(contact.joints) > 1:
        parts |= {f" of {joint.name}": joint.rows for joint in contact.joints}
    for name, pairs in parts.items():
        only = np.isin(np.arange(contact.n_pair), pairs)[:, None, None]
        add(f"energy{name}", energy[pairs].sum(), only * of_x, only * of_force, no_output)
        add(f"preload{name}", float(np.sum(normal * only * state.cycle.force)), none, only * normal, no_output)
    if worn:
        rate = np.zeros(contact.n_pair)
        for joint in contact.joints:
            rate[joint.rows] = worn.get(joint.name, 0.0)
        weight = rate[:, None, None]
        add("wear rate", float(rate @ energy), weight * of_x, weight * of_force, no_output)
    return found


@dataclass(frozen=True)
class Posed:
    """What a parameter changes of a balance: its model, contact, loads and the start of the load path.

    balance : all of it, where it was made already
    """

    model: ReducedModel
    contact: Contact
    excitation: Excitation
    memory: np.ndarray
    balance: HarmonicBalance | None = None

    @classmethod
    def of(cls, balance: HarmonicBalance) -> Posed:
        """That of a balance."""
        return cls(balance.model, balance.contact, balance.excitation, balance.memory)


@dataclass(frozen=True)
class Change:
    """A parameter p of some name: the problem a step above and a step below it.

    twice : where p acts on the structure, whose changes have no corners: the same by two steps, for a difference of
        order four, which a system near its own resonance needs; none of these where the model moves linearly
    touching : what p changes of the contact besides, whose forces have corners, by a smaller step
    """

    name: str
    step: float
    above: Posed
    below: Posed
    twice: tuple[Posed, ...] | None = None
    touching: Change | None = None


@dataclass(frozen=True)
class _Side:
    """The linear side of one harmonic: its system, contact map B, outputs C (n_output, n), and factors of D_s."""

    system: SecondOrderSystem
    B: np.ndarray
    C: np.ndarray
    factor: tuple[np.ndarray, np.ndarray] | None

    def solve(self, force: np.ndarray) -> np.ndarray:
        """D_s^-1 force."""
        return np.asarray(sla.lu_solve(self.factor, force))

    def adjoint(self, force: np.ndarray) -> np.ndarray:
        """D_s^-H force."""
        return np.asarray(sla.lu_solve(self.factor, force, trans=2))


def _sides(posed: Posed, balance: HarmonicBalance, omega: float | None) -> list[_Side]:
    """The linear side of a problem, harmonic by harmonic; not factorised where no frequency [rad/s] is given."""
    found = []
    for h in balance.basis.harmonics:
        system, B = posed.model.at_harmonic(h)
        C = np.stack([system.outputs[name] for name in balance.compliance.output_names])
        factor = None
        if omega is not None:
            stiffness = stuck_dynamic_stiffness(system, B, balance.reference_stiffness, 1j * h * omega)
            factor = sla.lu_factor(stiffness if h or np.iscomplexobj(B) else stiffness.real, overwrite_a=True)
        found.append(_Side(system, np.asarray(B), C, factor))
    return found


def _difference(new: SecondOrderSystem, old: SecondOrderSystem, s: complex, u: np.ndarray) -> np.ndarray | float:
    """What the dynamic stiffness of another system adds at u."""
    total: np.ndarray | float = 0.0
    for factor, name in ((1.0, "stiffness"), (s, "velocity_matrix"), (s**2, "mass")):
        after, before = getattr(new, name), getattr(old, name)
        if after is not before and after is not None and before is not None:
            total = total + factor * ((after - before) @ u)
    return total


@dataclass(frozen=True, eq=False)
class Gradient:
    """The derivatives of some quantities at one solution; at a fold what the balance itself changes by, projected.

    quantities : at the solution; fields : harmonic -> coordinates u (n,) complex; weights : (n_quantity, n_contact,
    n_coeff), dq / df of the contact forces at fixed x
    """

    balance: HarmonicBalance
    state: State
    quantities: tuple[Quantity, ...]
    at_fold: bool = False

    @cached_property
    def _sides(self) -> list[_Side]:
        return _sides(self.own, self.balance, self.state.omega)

    @cached_property
    def u(self) -> list[np.ndarray]:
        """Coordinates (n,) of each harmonic."""
        return self._moved(self.own, self._sides)

    @cached_property
    def _adjoints(self) -> tuple[np.ndarray, list[np.ndarray], np.ndarray]:
        """l (n_quantity, n_contact, n_coeff), w of each harmonic (n, n_quantity), and q_f - B w."""
        basis, state = self.balance.basis, self.state
        jac = state.cycle.jacobian
        assert jac is not None
        shape, none = state.flat.shape, np.zeros_like(state.flat)

        def transposed(blocks: np.ndarray, v: np.ndarray) -> np.ndarray:
            """df/dx^T v."""
            return np.matmul(blocks.transpose(0, 2, 1), v.reshape(len(blocks), -1, 1)).reshape(v.shape)

        k = self.balance.reference_stiffness[:, None]

        def departed(v: np.ndarray) -> np.ndarray:
            """dg/dx^T v."""
            return k * v - transposed(jac, v)

        residual = self.balance.model.residual

        def compliant(v: np.ndarray) -> np.ndarray:
            """G^T v."""
            amplitudes = basis.to_complex(v)
            moved = [side.B @ side.adjoint(side.B.conj().T @ amplitudes[:, i]) for i, side in enumerate(self._sides)]
            found = basis.to_real(np.stack(moved, axis=-1))
            return found if residual is None else found + residual.apply(v)

        # at a fold one row and column make the transpose regular, and its solution that of no right-hand side
        border = np.random.default_rng(0).normal(size=shape) if self.at_fold else none
        border /= max(float(np.linalg.norm(border)), 1.0)

        def product(v: np.ndarray) -> np.ndarray:
            return v - departed(compliant(v)) + np.vdot(border, v) * border

        found, fields = [], []
        for q in self.quantities:
            seen = basis.to_complex(q.of_output)
            own = [side.adjoint(side.C.conj().T @ seen[:, i]) for i, side in enumerate(self._sides)]
            through = basis.to_real(np.stack([side.B @ v for side, v in zip(self._sides, own, strict=True)], axis=-1))
            right = q.of_x + transposed(jac, q.of_force) + departed(through)
            solved = self._transposed_solve(product, right + border)
            amplitudes = basis.to_complex(solved)
            fields.append(
                [
                    v + side.adjoint(side.B.conj().T @ amplitudes[:, i])
                    for i, (side, v) in enumerate(zip(self._sides, own, strict=True))
                ]
            )
            found.append(solved)
        w = [np.stack([each[i] for each in fields], axis=1) for i in range(len(self._sides))]
        at_contact = np.stack([side.B @ v for side, v in zip(self._sides, w, strict=True)], axis=-1)
        weights = np.stack([q.of_force for q in self.quantities]) - basis.to_real(at_contact.transpose(1, 0, 2))
        if residual is not None:
            weights -= np.stack([residual.apply(v) for v in found])
        return np.reshape(found, (-1, *shape)), w, weights

    def _transposed_solve(self, product: Callable[[np.ndarray], np.ndarray], right: np.ndarray) -> np.ndarray:
        """l with product(l) = right: by GMRES, refined once."""
        solution, left = np.zeros_like(right), right
        size = float(np.linalg.norm(right))
        reached = 1.0 if size > 0 else 0.0
        for _ in range(3):
            if reached <= RULES.adjoint:
                break
            more, _, _ = gmres(
                lambda v: product(v.reshape(right.shape)).ravel(),
                left.ravel(),
                RULES.adjoint / reached,
                RULES.most_products,
            )
            solution = solution + more.reshape(right.shape)
            left = right - product(solution)
            reached = float(np.linalg.norm(left)) / size
        if not reached <= RULES.failed:
            raise NoDerivative(f"the adjoint is not solved: {reached:.0e} of it is left, as at a fold of the response")
        return solution

    @property
    def force_weights(self) -> np.ndarray:
        """(n_quantity, n_pair, n_component, n_coeff) dq / df of the contact forces."""
        return self._adjoints[2].reshape(-1, *self.state.x.shape)

    def by_frequency(self) -> np.ndarray:
        """(n_quantity,) dq / d omega at fixed parameters."""
        total = np.zeros(len(self.quantities))
        for h, side, u, w in zip(self.balance.basis.harmonics, self._sides, self.u, self._adjoints[1], strict=True):
            system = side.system
            slope = -2 * h**2 * self.state.omega * (system.mass @ u)
            if system.velocity_matrix is not None:
                slope = slope + 1j * h * (system.velocity_matrix @ u)
            total -= np.real(w.conj().T @ slope)
        return total

    def by_gap(self) -> np.ndarray:
        """(n_quantity, n_pair) dq / d gap of each pair [1/m]."""
        balance = self.balance
        if "n" not in balance.contact.components or not balance.basis.has_static:
            return np.zeros((len(self.quantities), balance.contact.n_pair))
        step, gap = RULES.of_gap * float(np.abs(self.state.x).max()), balance.contact.gap
        above, below = (replace(self.own, contact=balance.contact.with_gap(gap + side)) for side in (step, -step))
        return (self.moves_to(above) - self.moves_to(below)) / (2 * step)

    @cached_property
    def own(self) -> Posed:
        """The problem that is solved."""
        return Posed.of(self.balance)

    def _moved(self, posed: Posed, sides: list[_Side]) -> list[np.ndarray]:
        """Coordinates under the loads of a problem and this g."""
        return [side.solve(force) for side, force in zip(sides, self._forces(posed, sides), strict=True)]

    def _forces(self, posed: Posed, sides: Sequence[_Side]) -> list[np.ndarray]:
        balance, basis = self.balance, self.balance.basis
        k, base = balance.reference_stiffness[:, None], posed.excitation.base
        moved = self.state.flat if base is None else self.state.flat + balance.loaded(base)
        g = basis.to_complex(k * moved - self.state.cycle.force.reshape(moved.shape))
        found = []
        for i, (h, side) in enumerate(zip(basis.harmonics, sides, strict=True)):
            total = side.B.conj().T @ g[:, i]
            for (order, name), value in posed.excitation.loads.items():
                if order == h:
                    total = total + (balance.load_factor if h else 1.0) * value * side.system.loads[name]
            found.append(total)
        return found

    def moves_to(self, posed: Posed) -> np.ndarray:
        """(n_quantity, n_pair) what each pair's force of another problem adds to the quantities, to first order."""
        if posed.contact is self.balance.contact and posed.memory is self.balance.memory:
            return np.zeros((len(self.quantities), self.balance.contact.n_pair))
        force = posed.contact.cycle(self.state.x, self.balance.basis, posed.memory, jacobian=False).force
        return np.einsum("qpch,pch->qp", self.force_weights, force - self.state.cycle.force)

    def structure_to(self, posed: Posed) -> np.ndarray:
        """(n_quantity,) what its model and loads add, to first order."""
        balance, omega, own = self.balance, self.state.omega, self.balance.model
        if posed.model is own and posed.excitation is balance.excitation:
            return np.zeros(len(self.quantities))
        l, w, _ = self._adjoints
        base, before = posed.excitation.base, balance.excitation.base
        stretched = 0.0
        if base is not None and before is not None and base is not before:
            stretched = -np.einsum("qnc,nc->q", l, balance.loaded(base - before))
        if posed.model.interface.B is own.interface.B:  # the same coordinates
            sides = _sides(posed, balance, None)
            total = np.zeros(len(self.quantities)) + stretched
            forces = zip(self._forces(posed, sides), self._forces(self.own, self._sides), strict=True)
            for i, (h, (new, old)) in enumerate(zip(balance.basis.harmonics, forces, strict=True)):
                changed = new - old
                if sides[i].system is not self._sides[i].system:
                    changed = changed - _difference(sides[i].system, self._sides[i].system, 1j * h * omega, self.u[i])
                total += np.real(w[i].conj().T @ changed)
            return total
        x, y = self._seen(posed, _sides(posed, balance, omega))
        x_own, y_own = self._seen(self.own, self._sides)
        seen = np.stack([q.of_output for q in self.quantities])
        return np.einsum("qnc,nc->q", l, x - x_own) + np.einsum("qnc,nc->q", seen, y - y_own)

    def _seen(self, posed: Posed, sides: list[_Side]) -> tuple[np.ndarray, np.ndarray]:
        """x and outputs of a problem under this g."""
        balance, basis = self.balance, self.balance.basis
        u = self._moved(posed, sides)
        x, y = (
            basis.to_real(np.stack([rows(side) @ v for side, v in zip(sides, u, strict=True)], axis=-1))
            for rows in (lambda side: side.B, lambda side: side.C)
        )
        base, residual = posed.excitation.base, posed.model.residual
        if residual is not None:
            moved = self.state.flat if base is None else self.state.flat + balance.loaded(base)
            k = balance.reference_stiffness[:, None]
            x = x + residual.apply(k * moved - self.state.cycle.force.reshape(moved.shape))
        return x if base is None else x - balance.loaded(base), y

    def by(self, change: Change) -> tuple[np.ndarray, np.ndarray]:
        """One-sided derivatives of the quantities above and below a parameter, both (n_quantity,)."""
        sides = (change.above, change.below, *(change.twice or ()))
        up, down, *far = (self.moves_to(side).sum(axis=1) + self.structure_to(side) for side in sides)
        if change.twice is not None:
            up = (8 * (up - down) - (far[0] - far[1])) / 12 if far else (up - down) / 2
            down = -up
        by_touching = self.by(change.touching) if change.touching is not None else (0.0, 0.0)
        return up / change.step + by_touching[0], -down / change.step + by_touching[1]


@dataclass(frozen=True)
class Derivatives:
    """Derivatives of some quantities by some parameters.

    names, values : (n_quantity,) what they are; parameters : (n_parameter,) names
    slopes : (n_quantity, n_parameter) dq / dp; corner : (n_parameter,) whether p is at a corner of the contact forces,
        such as grazing or first slip: one-sided derivatives differ, and `slopes` is their mean
    above, below : (n_quantity, n_parameter) one-sided derivatives at a fixed frequency
    by_frequency : (n_quantity,) dq / d omega at fixed parameters [1/(rad/s)], zero along a peak
    by_gap : (n_quantity, n_pair) dq / d gap of each pair [1/m]
    state : solved, along a peak beside it; solves : of the balance that were spent
    follows_corner : whether the peak is a corner of the curve, at which a contact transition begins
    """

    names: tuple[str, ...]
    values: np.ndarray
    parameters: tuple[str, ...]
    slopes: np.ndarray
    corner: np.ndarray
    above: np.ndarray
    below: np.ndarray
    by_frequency: np.ndarray
    by_gap: np.ndarray
    state: State
    solves: int
    follows_corner: bool = False


@dataclass(frozen=True)
class _Fixed:
    """At one solution: values and dq / d omega (n_quantity,) of its quantities, and derivatives at a fixed frequency.

    above, below : (n_quantity, n_change) one-sided, by the changes; by_gap : (n_quantity, n_pair)
    """

    values: np.ndarray
    by_frequency: np.ndarray
    above: np.ndarray
    below: np.ndarray
    by_gap: np.ndarray

    @property
    def columns(self) -> np.ndarray:
        """(n_quantity, n_change + n_pair) by the changes and by the gap of every pair."""
        return np.concatenate([(self.above + self.below) / 2, self.by_gap], axis=1)

    @classmethod
    def limit(cls, points: Sequence[_Fixed]) -> _Fixed:
        """What points at 1, 4, 9 and 16 times a distance tend to, by a cubic over its root: slip begins by a root."""
        return cls(*(np.tensordot((4, -6, 4, -1), [getattr(p, f.name) for p in points], 1) for f in fields(cls)))


def _fixed(gradients: Sequence[Gradient], changes: Iterable[Change]) -> tuple[list[str], np.ndarray, list[_Fixed]]:
    """Names and steps of the changes, and what each gradient has; one change is there at a time."""
    names, steps = list[str](), list[float]()
    sides: list[list[tuple[np.ndarray, np.ndarray]]] = [[] for _ in gradients]
    for change in changes:
        names.append(change.name)
        steps.append(change.step)
        for found, gradient in zip(sides, gradients, strict=True):
            found.append(gradient.by(change))
    points = []
    for found, gradient in zip(sides, gradients, strict=True):
        values = np.array([q.value for q in gradient.quantities])
        both = np.reshape(found, (len(found), 2, len(values)))
        points.append(_Fixed(values, gradient.by_frequency(), both[:, 0].T, both[:, 1].T, gradient.by_gap()))
    return names, np.array(steps), points


def _gathered(
    gradient: Gradient,
    names: list[str],
    steps: np.ndarray,
    own: _Fixed,
    solves: int,
    omega: float = 0.0,
    moves: np.ndarray | None = None,
) -> Derivatives:
    """At a fixed frequency, or along a frequency [rad/s] that has a derivative `moves` by every column."""
    values, columns, above, below = own.values, own.columns, own.above, own.below
    quantities, by_frequency = [q.name for q in gradient.quantities], own.by_frequency
    if moves is not None:
        columns = np.concatenate([moves[None] / (2 * np.pi), columns + by_frequency[:, None] * moves])
        values = np.concatenate([[omega / (2 * np.pi)], values])
        quantities, by_frequency = ["frequency", *quantities], np.zeros(len(values))
        above, below = (np.concatenate([np.zeros((1, len(names))), side]) for side in (above, below))
    n = len(names)
    moved = np.abs(above + below) * steps
    seen = np.maximum(moved, RULES.seen * moved.max(axis=1, initial=0.0, keepdims=True))
    corner = (2 * np.abs(above - below) * steps > RULES.corner * seen).any(axis=0)
    return Derivatives(
        tuple(quantities), values, tuple(names), columns[:, :n], corner, above, below,
        by_frequency, columns[:, n:], gradient.state, solves,
    )  # fmt: skip


def _solved(balance: HarmonicBalance, omega: float, x: np.ndarray, options: NewtonOptions | None) -> State:
    solution = newton.solve(balance, omega, x, replace(options or NewtonOptions(), tolerance=RULES.newton))
    if not solution.converged and not solution.history[-1] <= 1e2 * RULES.newton:
        raise NoDerivative(f"the balance at {omega / (2 * np.pi):.6g} Hz is not solved: {solution.outcome}")
    return solution.state


@single
def at_frequency(
    balance: HarmonicBalance,
    state: State,
    output: str,
    changes: Iterable[Change],
    worn: Mapping[str, float] | None = None,
    options: NewtonOptions | None = None,
) -> Derivatives:
    """Derivatives at the fixed frequency of a state, from which it is solved more exactly.

    output : whose amplitude and phase are quantities; changes : the parameters; worn : see `quantities`
    Raises  NoDerivative at a fold, or where the state is not solved
    """
    state = _solved(balance, state.omega, state.x, options)
    gradient = Gradient(balance, state, tuple(quantities(balance, state, output, worn)))
    names, steps, (own,) = _fixed([gradient], changes)
    return _gathered(gradient, names, steps, own, 1)


@single
def at_peak(
    balance: HarmonicBalance,
    state: State,
    output: str,
    changes: Iterable[Change],
    worn: Mapping[str, float] | None = None,
    options: NewtonOptions | None = None,
) -> Derivatives:
    """Derivatives along the resonance peak beside a state, its frequency [Hz] the first quantity; see `at_frequency`.

    Values are those of the peak itself: one Newton step on its condition from the state, which is `RULES.at_peak` away.
    A peak that is a corner of the curve stays where the curve has its corner
    Raises  NoDerivative where no peak lies beside the state, as at a fold
    """
    ends, width, solves = _peak(balance, state, output, options)

    def beside(end: Slope, widths: float) -> Gradient:
        omega = end.omega + widths * width
        near = _solved(balance, omega, end.predict(omega), options)
        return Gradient(balance, near, tuple(quantities(balance, near, output, worn)))

    if len(ends) == 2:
        low, high = (
            [beside(end, side * n**2) for n in (1, 2, 3, 4)] for end, side in zip(ends, RULES.sides, strict=True)
        )
        return _at_corner(low, high, changes, solves + 8)
    gradient, *near = (beside(ends[0], side) for side in (0.0, -RULES.along, RULES.along))
    near = [replace(one, quantities=one.quantities[:1]) for one in near]
    names, steps, (own, *points) = _fixed([gradient, *near], changes)
    slopes = [p.values[0] * np.concatenate([p.by_frequency[:1], p.columns[0]]) for p in points]
    curvature, *mixed = (slopes[1] - slopes[0]) / (2 * RULES.along * width)
    if not curvature < 0:
        raise NoDerivative("the response has no maximum beside this point")
    left = -own.values[0] * own.by_frequency[0] / curvature
    own = replace(own, values=own.values + left * own.by_frequency)
    return _gathered(
        gradient, names, steps, own, solves + 2, gradient.state.omega + left, -np.asarray(mixed) / curvature
    )


def _at_corner(
    low: Sequence[Gradient], high: Sequence[Gradient], changes: Iterable[Change], solves: int
) -> Derivatives:
    """Along a corner of the curve, from what tends to it below and above it: both are one curve there."""
    both = set.intersection(*({q.name for q in one.quantities} for one in (*low, *high)))
    gradients = [replace(g, quantities=tuple(q for q in g.quantities if q.name in both)) for g in (*low, *high)]
    names, steps, points = _fixed(gradients, changes)
    below, above = _Fixed.limit(points[:4]), _Fixed.limit(points[4:])
    moves = (above.columns[0] - below.columns[0]) / (below.by_frequency[0] - above.by_frequency[0])
    along = [side.columns + side.by_frequency[:, None] * moves for side in (below, above)]
    size = np.abs(along).max(axis=(0, 2), keepdims=True)[0]
    if (np.abs(along[1] - along[0]) > RULES.corner * size).any():
        raise NoDerivative("the peak is a corner of the curve where more than one contact transition begins")
    omega = (low[0].state.omega + high[0].state.omega) / 2
    return replace(_gathered(gradients[0], names, steps, below, solves, omega, moves), follows_corner=True)


@single
def at_fold(
    balance: HarmonicBalance, state: State, changes: Iterable[Change], options: NewtonOptions | None = None
) -> Derivatives:
    """Derivatives of the frequency [Hz] of the fold beside a state; see `at_frequency`.

    The transpose of the balance R(x, w, p) = 0 has a solution l without a right-hand side there, so that along the fold
    l . (R_w dw + R_p dp) = 0
    Raises  NoDerivative where no fold lies beside the state
    """
    state, solves = _fold(balance, state, options)
    none = np.zeros_like(state.flat)
    hertz = Quantity("frequency", state.omega / (2 * np.pi), none, none, np.zeros_like(balance.outputs(state)))
    gradient = Gradient(balance, state, (hertz,), at_fold=True)
    names, steps, (own,) = _fixed([gradient], changes)
    to_hertz = -1 / (2 * np.pi * own.by_frequency[0])
    sides = (to_hertz * side for side in (own.above, own.below, own.by_gap))
    return _gathered(gradient, names, steps, _Fixed(own.values, np.zeros(1), *sides), solves)


def _fold(balance: HarmonicBalance, state: State, options: NewtonOptions | None) -> tuple[State, int]:
    """The fold beside a state, by secants of the share of the frequency in the tangent; solves spent."""
    how, path = replace(options or NewtonOptions(), tolerance=RULES.newton), parameter.of(balance)
    vibration = np.where(balance.basis.order > 0, state.flat, 0.0)
    metric = Metric(float(np.linalg.norm(vibration)), FoldOptions.frequency_scale * state.omega)

    def at(guess: Direction, along: Direction) -> tuple[State, Direction]:
        found = bordered.correct(path, guess, along, metric, how)[0].state
        return found, bordered.tangent(path, found.omega, found, along, metric, how, RULES.adjoint)

    try:
        here, along = at(Direction(state.flat, state.omega), metric.unit(Direction(vibration, 0.0)))
        step = RULES.along
        there, tangent = at(Direction(here.flat, here.omega) + along * step, along)
        bend = (tangent.p - along.p) / step
        solves = 2
        while solves < RULES.most_steps:
            here, along, step = there, tangent, -tangent.p / bend if bend else np.inf
            if not abs(step) <= 1.0 or abs(step) <= RULES.at_fold:
                break
            there, tangent = at(Direction(here.flat, here.omega) + along * step, along)
            solves += 1
        if abs(step) <= RULES.at_fold:
            return here, solves
    except bordered.BorderFailed:
        pass
    raise NoDerivative(f"no fold lies beside {state.omega / (2 * np.pi):.6g} Hz")


@single
def at_mode(
    problem: FreeVibration,
    point: Point,
    changes: Iterable[Change],
    options: NewtonOptions | None = None,
    modal: bool = True,
) -> Derivatives:
    """Derivatives of frequency [Hz] and damping ratio of a nonlinear mode at an amplitude that stays.

    modal : the amplitude is that of the mass-normalised mode, else the motion of the output in it
    One solution of the linearised problem for each parameter, whose residual is differenced at the same motion.
    Raises  NoDerivative where the mode is not solved
    """
    balance, how = problem.balance, replace(options or NewtonOptions(), tolerance=RULES.of_mode)
    normal = np.zeros(len(point.coordinates))
    normal[-1] = 1.0
    point, outcome, _ = newton_on(problem, point, normal, how)
    if outcome != CONVERGED:
        raise NoDerivative(f"the mode is not solved: {outcome}")

    def residual(posed: Posed) -> np.ndarray:
        made = posed.balance or HarmonicBalance.of(
            posed.model, posed.contact.joints, balance.basis, posed.excitation, balance.omega_max, posed.memory
        )
        there = FreeVibration(made, problem.mode, problem.output)
        a = point.a if modal else point.a * problem.per_amplitude / there.per_amplitude
        return there.at(point.x, point.omega, point.zeta, a).residual

    def by(change: Change) -> np.ndarray:
        up, down, *far = (residual(one) for one in (change.above, change.below, *(change.twice or ())))
        moved = ((8 * (up - down) - (far[0] - far[1])) / 12 if far else (up - down) / 2) / change.step
        return moved if change.touching is None else moved + by(change.touching)

    names, columns = list[str](), []
    for change in changes:
        moved = problem.correction(replace(point, residual=by(change)), normal, RULES.adjoint, how.max_products)
        names.append(change.name)
        columns.append(np.array([point.omega / (2 * np.pi) * moved[-3], moved[-2]]))
    slopes = np.reshape(columns, (-1, 2)).T
    values, none = np.array([point.omega / (2 * np.pi), point.zeta]), np.zeros(2)
    state = balance.evaluate(point.omega, point.x)
    return Derivatives(
        ("frequency", "damping"), values, tuple(names), slopes, np.zeros(len(names), bool), slopes, slopes, none,
        np.zeros((2, balance.contact.n_pair)), state, 1,
    )  # fmt: skip


def _slope(balance: HarmonicBalance, state: State, output: str) -> Slope:
    return Slope.of(balance, Solution(state, CONVERGED, 0, 0, ()), output)


def _peak(
    balance: HarmonicBalance, state: State, output: str, options: NewtonOptions | None
) -> tuple[tuple[Slope, ...], float, int]:
    """The peak beside a state, by secants of the slope; half width of the resonance, solves spent.

    Two points where the slope does not vanish but jumps: those on both sides of the corner
    """

    def at(omega: float, beside: Slope) -> Slope:
        return _slope(balance, _solved(balance, omega, beside.predict(omega), options), output)

    row = balance.compliance.output_names.index(output)
    first = before = _slope(balance, _solved(balance, state.omega, state.x, options), output)
    longest = RULES.first_step * before.omega
    step = float(np.clip(before.distance, -longest, longest))
    for solves in range(2, RULES.most_steps):
        here = at(before.omega + step, before)
        curvature = (here.slope - before.slope) / step if step else 0.0
        if not curvature < 0:
            break
        width = float(np.sqrt(-2 / curvature) * amplitude(balance.outputs(here.solution.state))[row])
        before, step = here, float(np.clip(-here.slope / curvature, -width / 2, width / 2))
        if abs(step) <= RULES.at_peak * width:
            return (here,), width, solves
    low = high = first
    for _ in range(RULES.most_steps):
        if low.slope > 0 > high.slope:
            break
        solves, longest = solves + 1, 2 * longest
        low, high = (high, at(high.omega + longest, high)) if high.slope > 0 else (at(low.omega - longest, low), low)
    hertz = f"{state.omega / (2 * np.pi):.6g} Hz"
    if not low.slope > 0 > high.slope:
        raise NoDerivative(f"no peak of {output} lies beside {hertz}")
    width = min(low.width, high.width)
    while high.omega - low.omega > RULES.at_corner * width:
        solves, middle = solves + 1, at((low.omega + high.omega) / 2, low)
        low, high = (middle, high) if middle.slope > 0 else (low, middle)
    if max(low.miss, high.miss) <= RULES.at_peak:
        return (low,), width, solves
    if balance.basis.transitions != "located":
        raise NoDerivative(
            f"the peak of {output} at {hertz} is a corner of the curve, as forces at samples have many: "
            'harmonics.transitions = "located" has none but where a contact transition begins'
        )
    return (low, high), width, solves
