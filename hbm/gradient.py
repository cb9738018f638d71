"""The gradient of a solved balance by any parameter: one adjoint solve for each quantity, however many parameters.

At a solution x = B u, D_s(w) u = F + B^H g, g = k x - f(x), f the contact forces. A quantity q(x, f, y) of these and
of the outputs y = C u, at a fixed frequency, changes with a parameter p by

    dq/dp = (q_f - B w) . f_p + w . (F_p - D_p u),    w = D_s^-H (C^H q_y + B^H l),
    (I - G dg/dx)^T l = q_x + (df/dx)^T q_f + (dg/dx)^T B D_s^-H C^H q_y

f_p is the change of the contact forces at the same x, F_p - D_p u that of the loads and the dynamic stiffness at the
same u: both are explicit, so that the balance is solved again for no parameter. They are central differences of what
a parameter makes, by a step so small that what they miss is rounding; where a parameter changes the coordinates of the
model, such as the shapes of a reduction, x and y are compared at the same g, which needs no common coordinates.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.linalg as sla

from tribodyn.fem.system import SecondOrderSystem
from tribodyn.hbm.balance import HarmonicBalance, State
from tribodyn.hbm.contact.joint import JointSet
from tribodyn.hbm.continuation.branch import amplitude
from tribodyn.hbm.excitation import Excitation
from tribodyn.hbm.krylov import gmres
from tribodyn.reduction.linear import stuck_dynamic_stiffness
from tribodyn.reduction.model import ReducedModel
from tribodyn.reduction.residual_flexibility import FlexibleModel
from tribodyn.refusal import SolverFailure


@dataclass(frozen=True)
class Rules:
    """How exactly is solved."""

    adjoint: float = 1e-12  # relative residual of an adjoint, and of one that is no solution
    failed: float = 1e-7
    most_products: int = 400
    of_gap: float = 1e-6  # step of a gap over the largest displacement


RULES = Rules()


class NoDerivative(SolverFailure):
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
    alike : whether its coordinates are those of the solved problem even where its contact map is another one
    """

    model: ReducedModel
    contact: JointSet
    excitation: Excitation
    memory: np.ndarray
    balance: HarmonicBalance | None = None
    alike: bool = False

    @classmethod
    def of(cls, balance: HarmonicBalance) -> Posed:
        """That of a balance."""
        return cls(balance.model, balance.contact, balance.excitation, balance.memory)


@dataclass(frozen=True)
class Change:
    """A parameter p of some name: the problem a step above and a step below it.

    twice : where p acts on the structure: the same by two steps, for a difference of order four, which a system near
        its own resonance needs; none of these where the model moves linearly, without corners
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
    factor: tuple[np.ndarray, np.ndarray]

    def solve(self, force: np.ndarray) -> np.ndarray:
        """D_s^-1 force."""
        return np.asarray(sla.lu_solve(self.factor, force))

    def adjoint(self, force: np.ndarray) -> np.ndarray:
        """D_s^-H force."""
        return np.asarray(sla.lu_solve(self.factor, force, trans=2))


def _sides(posed: Posed, balance: HarmonicBalance, omega: float) -> list[_Side]:
    """The linear side of a problem at a frequency [rad/s], harmonic by harmonic."""
    found = []
    for h in balance.basis.harmonics:
        system, B, C = _maps(posed, balance, h)
        stiffness = stuck_dynamic_stiffness(system, B, balance.reference_stiffness, 1j * h * omega)
        factor = sla.lu_factor(stiffness if h or np.iscomplexobj(B) else stiffness.real, overwrite_a=True)
        found.append(_Side(system, B, C, factor))
    return found


def _maps(posed: Posed, balance: HarmonicBalance, h: int) -> tuple[SecondOrderSystem, np.ndarray, np.ndarray]:
    """System, contact map and outputs that a harmonic of a problem sees."""
    system, B = posed.model.at_harmonic(h)
    return system, np.asarray(B), np.stack([system.outputs[name] for name in balance.compliance.output_names])


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
    """The derivatives of some quantities at one solution; at a fold what the balance itself changes by, projected."""

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
        shape, none, point = state.flat.shape, np.zeros_like(state.flat), self.balance.at(state.omega)

        def transposed(blocks: np.ndarray, v: np.ndarray) -> np.ndarray:
            """df/dx^T v."""
            return np.matmul(blocks.transpose(0, 2, 1), v.reshape(len(blocks), -1, 1)).reshape(v.shape)

        k = self.balance.reference_stiffness[:, None]

        def departed(v: np.ndarray) -> np.ndarray:
            """dg/dx^T v."""
            return k * v - transposed(jac, v)

        # at a fold one row and column make the transpose regular, and its solution that of no right-hand side
        border = np.random.default_rng(0).normal(size=shape) if self.at_fold else none
        border /= max(float(np.linalg.norm(border)), 1.0)

        def product(v: np.ndarray) -> np.ndarray:
            return v - departed(point.transposed(v)) + np.vdot(border, v) * border

        seen = basis.to_complex(np.stack([q.of_output for q in self.quantities]))
        own = [side.adjoint(side.C.conj().T @ seen[:, :, i].T) for i, side in enumerate(self._sides)]
        at_contact = np.stack([side.B @ v for side, v in zip(self._sides, own, strict=True)], axis=-1)
        found, weights = [], []
        for q, through in zip(self.quantities, basis.to_real(at_contact.transpose(1, 0, 2)), strict=True):
            right = q.of_x + transposed(jac, q.of_force) + departed(through)
            found.append(self._transposed_solve(product, right + border))
            weights.append(q.of_force - through - point.transposed(found[-1]))
        l = basis.to_complex(np.array(found))
        w = [v + s.adjoint(s.B.conj().T @ l[:, :, i].T) for i, (s, v) in enumerate(zip(self._sides, own, strict=True))]
        return np.reshape(found, (-1, *shape)), w, np.reshape(weights, (-1, *shape))

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
        slope = np.mean(self.of_gap(), axis=0)
        return np.einsum("qpch,pch->qp", self._adjoints[2].reshape(-1, *slope.shape), slope)

    def of_gap(self) -> tuple[np.ndarray, np.ndarray]:
        """(n_pair, n_component, n_coeff) d force / d gap of each pair at the same x, above and below it [N/m]."""
        balance = self.balance
        if "n" not in balance.contact.components or not balance.basis.has_static:
            return np.zeros_like(self.state.x), np.zeros_like(self.state.x)
        step, gap = RULES.of_gap * float(np.abs(self.state.x).max()), balance.contact.gap
        above, below = (
            self._force(balance.contact.with_gap(gap + side), balance.memory) / side for side in (step, -step)
        )
        return above, below

    @cached_property
    def own(self) -> Posed:
        """The problem that is solved."""
        return Posed.of(self.balance)

    def _moved(self, posed: Posed, sides: list[_Side]) -> list[np.ndarray]:
        """Coordinates under the loads of a problem and this g."""
        sized = zip(self.balance.basis.harmonics, sides, self._pulls(posed), strict=True)
        return [s.solve(s.B.conj().T @ g + self._loads(posed, s.system, h)) for h, s, g in sized]

    def _pull(self, posed: Posed) -> np.ndarray:
        """g (n_contact, n_coeff) that a problem has with this state."""
        k, base = self.balance.reference_stiffness[:, None], posed.excitation.base
        moved = self.state.flat if base is None else self.state.flat + self.balance.loaded(base)
        return k * moved - self.state.cycle.force.reshape(moved.shape)

    def _pulls(self, posed: Posed) -> np.ndarray:
        """The same of each harmonic (n_harmonic, n_contact)."""
        return np.asarray(self.balance.basis.to_complex(self._pull(posed)).T)

    def _besides(self, posed: Posed) -> np.ndarray | float:
        """What there is in x besides the motion of the coordinates."""
        base, model = posed.excitation.base, posed.model
        x = model.residual.apply(self._pull(posed)) if isinstance(model, FlexibleModel) else 0.0
        return x if base is None else x - self.balance.loaded(base)

    def _force(self, contact: JointSet, memory: np.ndarray) -> np.ndarray:
        """(n_pair, n_component, n_coeff) what another contact adds to the forces at the same x [N]."""
        if contact is self.balance.contact and memory is self.balance.memory:
            return np.zeros_like(self.state.x)
        cycle = contact.cycle(self.state.x, self.balance.basis, memory, jacobian=False)
        return np.asarray(cycle.force - self.state.cycle.force)

    def _structure(self, posed: Posed) -> tuple[np.ndarray, np.ndarray]:
        """What model and loads of a problem add to x and outputs at the same u and contact forces."""
        balance, own = self.balance, self.own
        if posed.model is own.model and posed.excitation is own.excitation:
            return np.zeros_like(self.state.flat), np.zeros((len(self._sides[0].C), balance.basis.n_coeff))
        if not posed.alike and posed.model.interface.B is not own.model.interface.B:
            there, here = self._seen(posed, _sides(posed, balance, self.state.omega)), self._seen(own, self._sides)
            return there[0] - here[0], there[1] - here[1]
        seen, pulls = [], zip(self._pulls(posed), self._pulls(own), strict=True)
        for h, side, u, (g, here) in zip(balance.basis.harmonics, self._sides, self.u, pulls, strict=True):
            system, B, C = _maps(posed, balance, h)  # in the same coordinates
            more = B.conj().T @ g - side.B.conj().T @ here
            more = more + self._loads(posed, system, h) - self._loads(own, side.system, h)
            if system is not side.system:
                more = more - _difference(system, side.system, 1j * h * self.state.omega, u)
            moved = side.solve(more) if more.any() else more
            seen.append((side.B @ moved + (B - side.B) @ u, side.C @ moved + (C - side.C) @ u))
        x, y = self._real(seen)
        return x + self._besides(posed) - self._besides(own), y

    def _loads(self, posed: Posed, system: SecondOrderSystem, h: int) -> np.ndarray:
        """(n,) loads of a harmonic."""
        factor = self.balance.load_factor if h else 1.0
        return factor * posed.excitation.force(h, system.loads, system.n_dof)

    def _seen(self, posed: Posed, sides: list[_Side]) -> tuple[np.ndarray, np.ndarray]:
        """x and outputs of a problem under this g."""
        x, y = self._real([(s.B @ u, s.C @ u) for s, u in zip(sides, self._moved(posed, sides), strict=True)])
        return x + self._besides(posed), y

    def _real(self, seen: Sequence[tuple[np.ndarray, np.ndarray]]) -> tuple[np.ndarray, np.ndarray]:
        """Coefficients of x and of the outputs from those of each harmonic."""
        x, y = (self.balance.basis.to_real(np.stack(of, axis=-1)) for of in zip(*seen, strict=True))
        return x, y

    def effects(self, change: Change) -> tuple[np.ndarray, np.ndarray]:
        """One-sided slopes above and below a parameter of contact forces at
        the same x, and of x and outputs at the same forces, in one vector."""
        up, down = self._added(change.above, change.below)
        if change.twice:
            far = self._added(*change.twice)
            mean, jump = (8 * (up - down) - (far[0] - far[1])) / 12, 2 * (up + down) - (far[0] + far[1]) / 2
            up, down = mean + jump / 2, jump / 2 - mean
        elif change.twice is not None:
            up, down = (up - down) / 2, (down - up) / 2
        above, below = up / change.step, -down / change.step
        if change.touching is None:
            return above, below
        besides = self.effects(change.touching)
        return above + besides[0], below + besides[1]

    def _added(self, above: Posed, below: Posed) -> list[np.ndarray]:
        """Vectors of `effects` of two problems to both sides of this one."""
        sides = ((self._force(one.contact, one.memory), *self._structure(one)) for one in (above, below))
        return [np.concatenate([part.ravel() for part in side]) for side in sides]

    @cached_property
    def _rows(self) -> np.ndarray:
        """(n_quantity, n) of a vector of `effects`."""
        l, _, weights = self._adjoints
        n, seen = len(self.quantities), np.stack([q.of_output for q in self.quantities])
        return np.concatenate([weights.reshape(n, -1), l.reshape(n, -1), seen.reshape(n, -1)], axis=1)

    def by(self, change: Change) -> tuple[np.ndarray, np.ndarray]:
        """One-sided derivatives of the quantities above and below a parameter, both (n_quantity,)."""
        above, below = self.effects(change)
        return self._rows @ above, self._rows @ below
