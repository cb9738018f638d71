"""Harmonic balance in compliance form: unknown is the relative displacement at the contacts, nothing else.

    R(x) = x - x_lin(w) - G(w) g(x),    g(x) = k x - f_c(x)

g is the departure of the contact from its stuck, closed state; where all is stuck it vanishes and x = x_lin.
Source  design of tribodyn; x_lin and G in hbm.linear.compliance; f_c from a contact law by alternating frequency/time.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from tribodyn.hbm.contact.contact_law import STICKS, ContactCycle
from tribodyn.hbm.contact.joint import Joint, JointSet
from tribodyn.hbm.excitation import Excitation
from tribodyn.hbm.fatigue import StressField, StressPlace
from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.hbm.linear.compliance import ContactCompliance
from tribodyn.hbm.linear.compliance_point import CompliancePoint
from tribodyn.hbm.linear.linear_side import compliance_of
from tribodyn.hbm.linearisation import Linearisation, Remainder
from tribodyn.hbm.reference_springs import reference_springs
from tribodyn.reduction.model import ReducedModel
from tribodyn.reduction.residual_flexibility import FlexibleModel
from tribodyn.refusal import Refusal

ROUNDING = 1e-13  # of the work that a pair's force and motion could do at most


@dataclass(frozen=True)
class State:
    """The balance evaluated at one x.

    x : (n_pair, n_component, n_coeff) relative displacement [m]
    cycle : contact forces, their derivative and status
    g : (n_contact, n_coeff) departure from stuck and closed [N]
    residual : (n_contact, n_coeff) R(x) [m]"""

    omega: float
    x: np.ndarray
    cycle: ContactCycle
    g: np.ndarray
    residual: np.ndarray

    @property
    def flat(self) -> np.ndarray:
        """(n_contact, n_coeff) relative displacement [m]."""
        return self.x.reshape(-1, self.x.shape[2])


@dataclass(frozen=True, eq=False)
class HarmonicBalance:
    """The nonlinear problem of one scene: reduced model, joints, harmonics, excitation. Made by `of`.

    model : reduced model whose contact map orders its rows pair by pair, component by component
    contact : its joints, each with its contact law and parameters; omega_max : largest frequency to come [rad/s]
    memory : (n_pair, n_state) slider positions at the start of the load path [m]
    compliance : the linear side, which problems that differ in contact or load share
    load_factor : on the harmonics >= 1 of the excitation
    at_rest : (n_pair, n_component) displacement under the static loads, where it is known [m]
    remainder : approximation of the residual flexibility; None where its factor serves, or there is none
    recalled : products with the residual flexibility that the followed curve has computed; None for a single solution
    at_speed : the problem of the same contact at other speeds of rotation [Hz], where a mission asks for them
    places : of the part, whose stress is among the outputs; stress : of the whole part; none where it is not asked for
    """

    model: ReducedModel
    contact: JointSet
    basis: HarmonicBasis
    excitation: Excitation
    omega_max: float
    memory: np.ndarray
    compliance: ContactCompliance
    load_factor: float = 1.0
    at_rest: np.ndarray | None = None
    remainder: Remainder = None
    recalled: list[np.ndarray] | None = None
    at_speed: Mapping[float, HarmonicBalance] = field(default_factory=dict)
    places: tuple[StressPlace, ...] = ()
    stress: StressField | None = None

    @classmethod
    def of(
        cls, model: ReducedModel, joints: Joint | Sequence[Joint], basis: HarmonicBasis, excitation: Excitation,
        omega_max: float, memory: np.ndarray | None = None, previous: HarmonicBalance | None = None,
    ) -> HarmonicBalance:  # fmt: skip
        """The balance of a model with one or several joints; their springs become the stuck reference springs.

        Springs of few contacts that are far stiffer than the body get a softer reference: the body would be lost.
        memory : zeros by default: the contact is closed without shear, and a pair that never slips keeps the shear that
            the loads put on it
        previous : a balance whose cached linear side is reused if it matches but for the amplitudes of the loads
        Raises  Refusal where joints, loads or frequency do not fit the model"""
        if not 0 < omega_max < np.inf:
            raise Refusal(f"the highest frequency is {omega_max} rad/s: give a finite one above zero")
        contact = JointSet.of(model, joints)
        if memory is None:
            memory = np.zeros((contact.n_pair, contact.n_state))
        if isinstance(model, FlexibleModel):
            springs = model.residual.stiffness
        else:
            springs = reference_springs(contact.stiffness, model, basis, omega_max)
        if previous is not None and previous._serves(model, springs, basis, excitation, omega_max):
            compliance = previous.compliance.under(excitation)
        else:
            compliance = compliance_of(model, springs, basis, excitation, omega_max)
        return cls(model, contact, basis, excitation, omega_max, memory, compliance)

    def _serves(
        self, model: ReducedModel, springs: np.ndarray, basis: HarmonicBasis, excitation: Excitation, omega_max: float
    ) -> bool:
        """Whether this has the linear side of another problem but for the amplitudes of its loads."""
        side, loads = self.compliance, {name for _, name in excitation.loads}
        if (side.basis, {*side.load_names}, self.omega_max) != (basis, loads, omega_max):
            return False
        return np.array_equal(side.k, springs.ravel()) and self.model.matches(model, basis.harmonics)

    @property
    def n_unknown(self) -> int:
        """Number of unknowns: pairs x components x harmonic coefficients."""
        return self.contact.stiffness.size * self.basis.n_coeff

    @property
    def reference_stiffness(self) -> np.ndarray:
        """(n_contact,) stuck springs that the departure g is measured from [N/m]."""
        return self.compliance.k

    def with_gap(self, gap: np.ndarray) -> HarmonicBalance:
        """The same problem with another gap (n_pair,) [m], as wear makes it; everything linear is shared."""
        return replace(self, contact=self.contact.with_gap(np.asarray(gap, float)))

    def worn(self, depth: np.ndarray) -> HarmonicBalance:
        """The same unworn problem worn by a depth (n_pair,) [m]."""
        return replace(self, contact=self.contact.worn(depth))

    def with_contact(self, contact: JointSet) -> HarmonicBalance:
        """The same problem with other contact parameters; the stuck reference springs stay those of the first."""
        return replace(self, contact=contact)

    def simpler(self) -> HarmonicBalance | None:
        """The same problem with the laws that its own name for a first guess, `SIMPLER_LAW`; None where none does."""
        laws = [getattr(joint.module, "SIMPLER_LAW", joint.law) for joint in self.contact.joints]
        if laws == [joint.law for joint in self.contact.joints]:
            return None
        joints = tuple(replace(j, law=law) for j, law in zip(self.contact.joints, laws, strict=True))
        simpler = self.with_contact(replace(self.contact, joints=joints))
        return simpler.with_samples(self.basis.n_samples, simpler.contact.is_event_based)

    def with_memory(self, memory: np.ndarray) -> HarmonicBalance:
        """The same problem from another start of the load path."""
        return replace(self, memory=memory)

    def with_load(self, factor: float) -> HarmonicBalance:
        """The same problem with the harmonics >= 1 of the excitation times a factor."""
        return replace(self, load_factor=factor)

    def with_samples(self, n_samples: int, located: bool) -> HarmonicBalance:
        """The same problem with other time samples, transitions located or not; everything linear is shared."""
        transitions = "located" if located else "sampled"
        return replace(self, basis=replace(self.basis, n_samples=n_samples, transitions=transitions))

    def with_harmonics(self, harmonics: tuple[int, ...]) -> HarmonicBalance:
        """The same problem with fewer of its harmonics; raises Refusal for unknown ones and ones a load needs."""
        lacking = [h for h in harmonics if h not in self.basis.harmonics]
        if lacking:
            raise Refusal(f"harmonics {lacking} are not among those of the balance, {self.basis.harmonics}")
        basis = replace(self.basis, harmonics=tuple(harmonics))
        self.excitation.check(basis, {name: None for _, name in self.excitation.loads})
        return replace(self, basis=basis, compliance=self.compliance.restricted(basis))

    def standing(self, omega: float) -> HarmonicBalance:
        """The same problem at the speed that belongs to a frequency [rad/s], whatever frequency is asked for then."""
        model = self.model.at_frequency(omega)
        return self if model is self.model else replace(self, model=model, compliance=self.compliance.at_model(model))

    def at(self, omega: float) -> CompliancePoint:
        """The linear side at one frequency."""
        return self.compliance.at(omega)

    def loaded(self, coefficients: np.ndarray) -> np.ndarray:
        """Coefficients (..., n_coeff) that are linear in the loads, their vibrating part times the load factor."""
        if self.load_factor == 1.0:
            return coefficients
        return coefficients * np.where(self.basis.order, self.load_factor, 1.0)

    def x_lin(self, omega: float) -> np.ndarray:
        """(n_contact, n_coeff) response with every contact stuck and closed, the gap ignored [m]."""
        return self.loaded(self.at(omega).x_lin)

    def shaped(self, flat: np.ndarray) -> np.ndarray:
        """Rows of the contact (n_contact, n_coeff) as x (n_pair, n_component, n_coeff)."""
        return flat.reshape(self.contact.n_pair, len(self.contact.components), flat.shape[-1])

    def stuck(self, omega: float) -> np.ndarray:
        """The same as a first guess x (n_pair, n_component, n_coeff) [m], about the state at rest where it is known."""
        x = self.x_lin(omega)
        guess = self.shaped(x)
        if self.at_rest is not None and self.basis.has_static:
            guess = np.concatenate([self.at_rest[..., None], guess[..., 1:]], axis=-1)
        return guess

    def evaluate(self, omega: float, x: np.ndarray, jacobian: bool = True) -> State:
        """The balance at x (n_pair, n_component, n_coeff)."""
        cycle = self.contact.cycle(x, self.basis, self.memory, jacobian, omega)
        flat = x.reshape(-1, x.shape[2])
        g = self.reference_stiffness[:, None] * flat - cycle.force.reshape(flat.shape)
        point = self.at(omega)
        displacement = point.apply(g) if self.remainder is None else point.nearly(g) + self.remainder(g)
        return State(omega, x, cycle, g, flat - self.x_lin(omega) - displacement)

    def linearise(self, state: State) -> Linearisation:
        """d R / d x at a state whose contact derivative was asked for."""
        return Linearisation(self.at(state.omega), self.reference_stiffness, state.x, state.cycle, self.remainder)

    def frequency_slope(self, state: State) -> tuple[np.ndarray, np.ndarray]:
        """d / d omega at fixed x of R (n_contact, n_coeff) and of the outputs (n_output, n_coeff)."""
        point = self.at(state.omega)
        displacement, outputs = point.slope(state.g, self.load_factor)
        if self.contact.needs_velocity:
            step = 1e-6 * state.omega
            above, below = (
                self.contact.cycle(state.x, self.basis, self.memory, jacobian=False, omega=omega).force
                for omega in (state.omega + step, state.omega - step)
            )
            departure = ((below - above) / (2 * step)).reshape(state.g.shape)
            displacement, outputs = displacement + point.apply(departure), outputs + point.outputs(departure)
        return -displacement, outputs

    def gap_response(self, state: State, opening: np.ndarray) -> np.ndarray:
        """First-order change of x (n_pair, n_component, n_coeff) when each gap opens by (n_pair,) [m].

        A gap acts as a static shift of the normal displacement: f_c(x; gap + d) = f_c(x - d e_n; gap)."""
        if not self.basis.has_static:
            return np.zeros_like(state.x)
        n_coeff = self.basis.n_coeff
        column = self.contact.components.index("n") * n_coeff
        g_slope = (state.cycle.slope[:, :, column] * opening[:, None]).reshape(-1, n_coeff)
        change, _, _ = self.linearise(state).solve(self.at(state.omega).apply(g_slope), 1e-6)
        return change.reshape(state.x.shape)

    def outputs(self, state: State) -> np.ndarray:
        """(n_output, n_coeff) response of the observed outputs [m]."""
        point = self.at(state.omega)
        return self.loaded(point.outputs_lin) + point.outputs(state.g)

    def energy(self, state: State) -> np.ndarray:
        """(n_pair,) friction work per cycle, both tangential components [J].

        The normal spring is elastic: what work its sampled force does when a pair lifts is an error of sampling. A pair
        that sticks throughout, or lifts without slip, is elastic too: what is left of its work is rounding and would be
        taken for slow wear."""
        t = self.contact.tangential
        force, x = state.cycle.force[:, t], state.x[:, t]
        work = self.basis.work_per_cycle(force, x).sum(axis=1)
        sizes = [np.linalg.norm(c[..., int(self.basis.has_static) :], axis=(1, 2)) for c in (force, x)]
        largest = np.pi * self.basis.harmonics[-1] * sizes[0] * sizes[1]
        return np.where((state.cycle.status == STICKS) | (np.abs(work) <= ROUNDING * largest), 0.0, work)

    def normal_force(self, state: State) -> np.ndarray:
        """(n_pair,) static normal force [N]; zero where the law has no normal component."""
        if "n" not in self.contact.components or not self.basis.has_static:
            return np.zeros(self.contact.n_pair)
        return np.asarray(state.cycle.force[:, self.contact.components.index("n"), 0])

    def preload(self, state: State) -> float:
        """Static normal force of the whole contact [N]."""
        return float(self.normal_force(state).sum())

    def preload_by_joint(self, state: State) -> dict[str, float]:
        """Static normal force of every joint [N]."""
        return {name: float(force.sum()) for name, force in self.contact.by_joint(self.normal_force(state)).items()}

    def history(self, state: State) -> tuple[np.ndarray, np.ndarray]:
        """Displacement [m] and contact force [N] over one period, both (n_pair, n_component, n_samples)."""
        return self.contact.history(state.x, self.basis, self.memory, state.omega)
