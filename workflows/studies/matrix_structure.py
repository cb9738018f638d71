"""One's own matrices with the contacts that hold them, reduced or as they are. Units are SI, frequencies in Hz."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import scipy.sparse as sp

from tribodyn.fem.interface import COMPONENTS, ContactInterface, join
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.contact.contact_law import ContactParameters
from tribodyn.hbm.contact.joint import Joint, joint_transitions
from tribodyn.hbm.excitation import Excitation
from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.hbm.newton import NewtonOptions
from tribodyn.hbm.wear.law import JointWear
from tribodyn.reduction import foreign, linear_damping as damping
from tribodyn.reduction.craig_bampton import craig_bampton
from tribodyn.reduction.foreign import ForeignMatrices, Terms
from tribodyn.reduction.linear import linear_modes
from tribodyn.reduction.model import ReducedModel
from tribodyn.refusal import Refusal
from tribodyn.workflows.studies.matrix_balance import HZ, HertzBalance


@dataclass(frozen=True)
class MatrixContact:
    """A joint: where a structure touches, with its contact law.

    name : unique in a structure; interface : what `Matrices.contact` or `Matrices.contact_rows` makes
    law : name of a contact law; numbers : the law's own, such as {"friction": 0.4}, scalar or (n_pair,)
    tangential_stiffness, normal_stiffness : of the whole joint [N/m], shared by area, or (n_pair,) of each pair"""

    name: str
    interface: ContactInterface
    law: str = "jenkins"
    tangential_stiffness: float | np.ndarray = 0.0
    normal_stiffness: float | np.ndarray = 0.0
    numbers: Mapping[str, float | np.ndarray] = field(default_factory=dict)

    @property
    def stiffness(self) -> np.ndarray:
        """(n_pair, n_component) contact springs [N/m]."""
        share = self.interface.area / self.interface.area.sum()
        springs = {"t1": self.tangential_stiffness, "t2": self.tangential_stiffness, "n": self.normal_stiffness}
        columns = [springs[c] * share if np.ndim(springs[c]) == 0 else springs[c] for c in self.interface.components]
        return np.column_stack([np.broadcast_to(np.asarray(column, float), share.shape) for column in columns])

    def joint(self, pairs: np.ndarray) -> Joint:
        """The joint of a balance whose interface has its pairs at these places."""
        i, numbers = self.interface, dict[str, Any](self.numbers)
        parameters = ContactParameters.of(i.components, self.stiffness, gap=i.gap, **numbers)
        return Joint(self.name, self.law, parameters, pairs)


@dataclass(frozen=True)
class Structure:
    """Matrices with the contacts that hold them, reduced or as they are.

    model : reduced model whose interface has the pairs of all contacts, one contact after the other"""

    model: ReducedModel
    contacts: tuple[MatrixContact, ...]

    @property
    def joints(self) -> tuple[Joint, ...]:
        """The contacts as joints of the model."""
        ends = np.cumsum([contact.interface.n_pair for contact in self.contacts])
        starts = ends - [contact.interface.n_pair for contact in self.contacts]
        return tuple(c.joint(np.arange(a, b)) for c, a, b in zip(self.contacts, starts, ends, strict=True))

    def frequencies(self, n: int = 10, *, stuck: bool = False) -> np.ndarray:
        """The lowest natural frequencies (n,) [Hz], contacts absent, or closed and stuck."""
        springs = None
        if stuck:
            components = self.model.interface.components
            springs = np.concatenate([_wide(c.stiffness, c.interface.components, components) for c in self.contacts])
        return linear_modes(self.model, springs, min(n, self.model.system.n_dof))[0]

    def balance(
        self,
        harmonics: Sequence[int] = (0, 1),
        *,
        up_to: float,
        static: Mapping[str, float] | None = None,
        harmonic: Mapping[int, Mapping[str, complex]] | None = None,
        samples: int = 128,
        transitions: str = "auto",
        tolerance: float = 1e-8,
    ) -> HertzBalance:
        """The harmonic balance of the structure under loads.

        up_to : highest excitation frequency that will be asked for [Hz]
        static : load -> N; harmonic : order -> {load -> complex amplitude F of Re F exp(i order w t) [N]}
        samples : time samples of a cycle; transitions : "located" finds stick, slip and lift between them, "sampled"
            does not, "auto" does where every contact law can
        Raises  Refusal for unknown loads, orders that are not kept, laws that do not fit"""
        chosen = joint_transitions(self.joints) if transitions == "auto" else transitions
        basis = HarmonicBasis(tuple(harmonics), samples, chosen)
        loads = Excitation.of(static, harmonic)
        problem = HarmonicBalance.of(self.model, self.joints, basis, loads, HZ * up_to)
        return HertzBalance(problem, NewtonOptions(tolerance=tolerance))


def wear_law(name: str, **numbers: float | np.ndarray) -> JointWear:
    """A wear law with its own numbers, such as wear_law("energy", coefficient=2e-15), in the units that it declares.

    Raises  Refusal where there is no such law, or a number is missing or unknown"""
    return JointWear.of(name, **numbers)


def reduce(
    matrices: ForeignMatrices,
    contacts: MatrixContact | Sequence[MatrixContact],
    *,
    loads: Mapping[str, Terms],
    outputs: Mapping[str, Terms],
    modes: int | None = None,
    cutoff: float | None = None,
    damping_ratio: float | None = None,
) -> Structure:
    """The structure that matrices and contacts make, by Craig-Bampton or as it is.

    loads, outputs : name -> a DOF, {DOF: factor} or a vector (n,); an output is a displacement w^T q
    modes : fixed-interface modes kept, or cutoff : all up to this frequency [Hz]; neither keeps the matrices whole
    damping_ratio : of every mode without contact, where the matrices hold no damping; there may be none at all
    Raises  Refusal for contacts of one name, DOFs that do not exist, two kinds of damping"""
    touching = (contacts,) if isinstance(contacts, MatrixContact) else tuple(contacts)
    if not touching:
        raise Refusal("a structure needs at least one contact")
    system, interface = matrices.system(loads, outputs), joined([contact.interface for contact in touching])
    if modes is None and cutoff is None:
        model = foreign.reduced_model(system, interface)
    else:
        model = craig_bampton(system, interface, modes, cutoff)
    if damping_ratio is not None:
        if model.system.damping is not None:
            raise Refusal("the matrices hold a damping matrix: give no damping_ratio besides")
        model = model.with_damping(lambda system, rows: damping.modal_damping(system, damping_ratio))
    return Structure(model, touching)


def joined(interfaces: Sequence[ContactInterface]) -> ContactInterface:
    """Interfaces of one model as one, their pairs one after the other; rows that one has not are zero."""
    used = {name for interface in interfaces for name in interface.components}
    components = tuple(name for name in COMPONENTS if name in used)
    wide = []
    for interface in interfaces:
        place = [components.index(name) for name in interface.components]
        rows_of_interface = sp.coo_matrix(interface.B)
        pair, component = np.divmod(rows_of_interface.row, len(place))
        to = pair * len(components) + np.array(place)[component]
        rows = sp.csr_matrix(
            (rows_of_interface.data, (to, rows_of_interface.col)),
            (interface.n_pair * len(components), rows_of_interface.shape[1]),
        )
        wide.append(replace(interface, components=components, B=rows))
    return join(wide)


def _wide(stiffness: np.ndarray, used: tuple[str, ...], components: tuple[str, ...]) -> np.ndarray:
    """Springs (n_pair, n_own) in the columns of all components, zero in the others."""
    wide = np.zeros((len(stiffness), len(components)))
    wide[:, [components.index(name) for name in used]] = stiffness
    return wide
