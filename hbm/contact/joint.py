"""Joints: contacts of a structure, each with its contact law and the parameters of that law.

A reduced model has one contact interface. Its rows run pair by pair, component by component, and each joint covers some
of the pairs. A joint whose law sees only some of the components has zero springs and no force in the others."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from types import ModuleType

import numpy as np

from tribodyn import declarations
from tribodyn.declarations import Role
from tribodyn.hbm.contact import aft, contact_law
from tribodyn.hbm.contact.contact_law import ContactCycle, ContactParameters
from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.reduction.model import ReducedModel
from tribodyn.refusal import Refusal


@dataclass(frozen=True)
class Joint:
    """One joint of a structure.

    name : of the joint, unique in a balance; law : name of its contact law
    parameters : of its pairs, over the components that the law sees
    pairs : slice or indices of its pairs among those of the contact interface; None for all of them"""

    name: str
    law: str
    parameters: ContactParameters
    pairs: np.ndarray | slice | None = None

    @property
    def module(self) -> ModuleType:
        """The contact law."""
        return contact_law.load(self.law)

    def name_of(self, role: Role) -> str | None:
        """The name of the law's number with a role, None where it has none."""
        return declarations.name_of(role, contact_law.declared(self.law))

    def with_friction_scaled(self, factor: float | np.ndarray) -> Joint:
        """The joint whose limit of friction is multiplied by a factor, scalar or (n_pair,)."""
        names = [name for role in declarations.SLIP_LIMITS if (name := self.name_of(role)) is not None]
        numbers = self.parameters.numbers
        numbers = {**numbers, **{name: factor * numbers[name] for name in names}}
        return replace(self, parameters=replace(self.parameters, numbers=numbers))

    @property
    def has_friction(self) -> bool:
        """Whether the law limits its tangential force."""
        return any(self.name_of(role) is not None for role in declarations.SLIP_LIMITS)

    @property
    def rows(self) -> np.ndarray:
        """(n_pair,) indices of its pairs, once the joint is part of a JointSet."""
        assert isinstance(self.pairs, np.ndarray)
        return self.pairs

    @property
    def n_state(self) -> int:
        """Number of memory variables of one pair."""
        return int(self.module.n_state(self.parameters.components))


def joint_transitions(joints: Joint | Sequence[Joint]) -> str:
    """The more accurate transitions for these joints: "located" where all laws are event-based, else "sampled"."""
    sequence = [joints] if isinstance(joints, Joint) else joints
    return "located" if all(contact_law.is_event_based(joint.module) for joint in sequence) else "sampled"


@dataclass(frozen=True)
class JointSet:
    """All joints of one contact interface; every pair belongs to exactly one of them.

    components : of the interface, in the order t1, t2, n; n_pair : its number of pairs
    joints : with their pairs as indices"""

    components: tuple[str, ...]
    n_pair: int
    joints: tuple[Joint, ...]

    @classmethod
    def of(cls, model: ReducedModel, joints: Joint | Sequence[Joint]) -> JointSet:
        """The joints of a model.

        Raises  Refusal where a pair belongs to no joint or to two, there is no such law, it does not serve the
            components, or one of its numbers is missing, unknown or out of its limits"""
        sequence = (joints,) if isinstance(joints, Joint) else tuple(joints)
        if not sequence:
            raise Refusal("a harmonic balance needs at least one joint")
        components, n_pair = tuple(model.interface.components), model.interface.n_pair
        names = [joint.name for joint in sequence]
        if len(set(names)) < len(names):
            raise Refusal(f"the joints need different names, got {', '.join(names)}")
        members, owners = [], np.zeros(n_pair, int)
        for joint in sequence:
            indices = slice(None) if joint.pairs is None else joint.pairs
            try:
                pairs = np.arange(n_pair)[indices]
            except IndexError:
                raise Refusal(f"joint '{joint.name}' has pairs beyond the {n_pair} of the contact") from None
            if len(pairs) != joint.parameters.n_pair:
                raise Refusal(
                    f"joint '{joint.name}' covers {len(pairs)} pairs and has parameters of {joint.parameters.n_pair}"
                )
            modelled = joint.parameters.components
            if [c for c in components if c in modelled] != list(modelled):
                raise Refusal(f"joint '{joint.name}' has components {modelled}, the contact has {components}")
            np.add.at(owners, pairs, 1)
            members.append(replace(joint, pairs=pairs, parameters=contact_law.complete(joint.law, joint.parameters)))
        if np.any(owners != 1):
            pair = int(np.flatnonzero(owners != 1)[0])
            raise Refusal(f"pair {pair} of the contact belongs to {owners[pair]} joints: each needs exactly one")
        return cls(components, n_pair, tuple(members))

    @cached_property
    def _single(self) -> Joint | None:
        """The joint that covers all pairs in their order with all components, if there is one: nothing is copied."""
        joint = self.joints[0]
        is_single = len(self.joints) == 1 and joint.parameters.components == self.components
        return joint if is_single and np.array_equal(joint.rows, np.arange(self.n_pair)) else None

    def single(self, user: str) -> Joint:
        """The joint that is all of the contact; refuses several joints, or one that covers a part of it.

        user : what needs it, for the sentence"""
        if self._single is None:
            raise Refusal(f"{user} serves one joint that covers the whole contact: this one has several laws")
        return self._single

    @property
    def has_one_law(self) -> bool:
        """Whether one joint could cover all pairs, see `merge`."""
        first = self.joints[0]
        return self._single is not None or all(
            joint.law == first.law
            and joint.parameters.components == self.components
            and joint.parameters.tabulation is None
            and tuple(joint.parameters.numbers) == tuple(first.parameters.numbers)
            for joint in self.joints
        )

    def merge(self, user: str) -> Joint:
        """One joint that covers all pairs in their order; refuses joints of several laws, or of some components.

        user : what needs it, for the sentence"""
        if self._single is not None or not self.has_one_law:
            return self.single(user)
        first = self.joints[0]

        def values(name: str) -> np.ndarray:
            return self._gather(lambda joint: joint.parameters.numbers[name])

        numbers = {name: values(name) for name in first.parameters.numbers}
        parameters = ContactParameters(first.parameters.components, self.stiffness, self.gap, numbers)
        return replace(first, name=user, parameters=parameters, pairs=np.arange(self.n_pair))

    def columns(self, joint: Joint) -> np.ndarray:
        """Positions of a joint's components among those of the interface."""
        return np.array([self.components.index(c) for c in joint.parameters.components])

    @cached_property
    def stiffness(self) -> np.ndarray:
        """(n_pair, n_component) contact springs [N/m], zero in components that a joint does not model."""
        if self._single is not None:
            return self._single.parameters.stiffness
        k = np.zeros((self.n_pair, len(self.components)))
        for joint in self.joints:
            k[np.ix_(joint.rows, self.columns(joint))] = joint.parameters.stiffness
        return k

    @cached_property
    def gap(self) -> np.ndarray:
        """(n_pair,) opening of the unloaded pairs [m]."""
        single = self._single
        return self._gather(lambda joint: joint.parameters.gap) if single is None else single.parameters.gap

    def number(self, role: Role) -> np.ndarray:
        """(n_pair,) the laws' numbers with a role, zero in joints whose law has none."""

        def value(joint: Joint) -> np.ndarray:
            name = joint.name_of(role)
            return np.zeros(len(joint.rows)) if name is None else joint.parameters.numbers[name]

        return self._gather(value)

    def _gather(self, value: Callable[[Joint], np.ndarray]) -> np.ndarray:
        """(n_pair,) a value of every pair, joint by joint."""
        out = np.zeros(self.n_pair)
        for joint in self.joints:
            out[joint.rows] = value(joint)
        return out

    @property
    def has_friction(self) -> bool:
        """Whether a law limits its tangential force."""
        return any(joint.has_friction for joint in self.joints)

    @property
    def needs_velocity(self) -> bool:
        """Whether a law takes velocities."""
        return any(contact_law.needs_velocity(joint.module) for joint in self.joints)

    @property
    def tangential(self) -> list[int]:
        """Positions of the tangential components, the ones in which friction works."""
        return [i for i, c in enumerate(self.components) if c != "n"]

    @cached_property
    def n_state(self) -> int:
        """Number of memory variables of one pair, the most that a joint has; the others leave theirs at zero."""
        return max(joint.n_state for joint in self.joints)

    @property
    def is_event_based(self) -> bool:
        """Whether every law locates its transitions between samples."""
        return joint_transitions(self.joints) == "located"

    def joint(self, name: str) -> Joint:
        """The joint of a name; refuses an unknown name with a list of those that there are."""
        for joint in self.joints:
            if joint.name == name:
                return joint
        raise Refusal(f"no joint '{name}': there are {', '.join(joint.name for joint in self.joints)}")

    def by_joint(self, of_pairs: np.ndarray) -> dict[str, np.ndarray]:
        """Values (n_pair, ...) of all pairs, joint by joint."""
        return {joint.name: of_pairs[joint.rows] for joint in self.joints}

    def with_gap(self, gap: np.ndarray) -> JointSet:
        """The joints with another gap (n_pair,) [m]."""
        return self._with(lambda joint: replace(joint.parameters, gap=gap[joint.rows]))

    def worn(self, depth: np.ndarray) -> JointSet:
        """These unworn joints worn by a depth (n_pair,) [m]."""
        return self._with(lambda joint: joint.parameters.worn(depth[joint.rows]))

    def older(self, step: np.ndarray) -> JointSet:
        """The same gaps with the numbers of a depth that is larger by a step (n_pair,) [m]."""
        return self._with(lambda joint: joint.parameters.older(step[joint.rows]))

    def of_pairs(self, name: str) -> np.ndarray:
        """(n_pair,) a property of the parameters of all pairs, such as "bed"."""
        return self._gather(lambda joint: getattr(joint.parameters, name))

    def with_parameters(self, change: Callable[[ContactParameters], ContactParameters]) -> JointSet:
        """The joints with changed parameters."""
        return self._with(lambda joint: change(joint.parameters))

    def with_friction_scaled(self, factor: float) -> JointSet:
        """The joints whose limits of friction are multiplied by a factor."""
        return replace(self, joints=tuple(joint.with_friction_scaled(factor) for joint in self.joints))

    def _with(self, parameters: Callable[[Joint], ContactParameters]) -> JointSet:
        return replace(self, joints=tuple(replace(joint, parameters=parameters(joint)) for joint in self.joints))

    def cycle(
        self, x: np.ndarray, basis: HarmonicBasis, memory: np.ndarray, jacobian: bool = True, omega: float = 0.0
    ) -> ContactCycle:
        """Periodic contact cycle of all pairs, each by the law of its joint.

        x : (n_pair, n_component, n_coeff) [m]; memory : (n_pair, n_state) at the start of the load path
        omega : [rad/s], for laws that need velocities
        Raises  Refusal where the basis has located transitions and a law does not locate them"""
        single = self._single
        if single is not None:
            return aft.cycle(single.module, x, single.parameters, basis, memory, jacobian, omega)
        n_pair, n_comp, n_coeff = x.shape
        width = n_comp * n_coeff
        force, status = np.zeros_like(x), np.zeros(n_pair, np.int64)
        slope = np.zeros((n_pair, width, width)) if jacobian else None
        for joint in self.joints:
            rows, columns = joint.rows, self.columns(joint)
            joint_x = np.ascontiguousarray(x[np.ix_(rows, columns)])
            start = np.ascontiguousarray(memory[rows, : joint.n_state])
            part = aft.cycle(joint.module, joint_x, joint.parameters, basis, start, jacobian, omega)
            force[np.ix_(rows, columns)], status[rows] = part.force, part.status
            if slope is not None:
                at = (columns[:, None] * n_coeff + np.arange(n_coeff)).ravel()
                slope[np.ix_(rows, at, at)] = part.jacobian
        return ContactCycle(force, slope, status)

    def history(
        self, x: np.ndarray, basis: HarmonicBasis, memory: np.ndarray, omega: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """Periodic displacement [m] and force [N] over one period, both (n_pair, n_component, n_samples).

        Arguments as for `cycle`; see `hbm.contact.aft.history`"""
        single = self._single
        if single is not None:
            return aft.history(single.module, x, single.parameters, basis, memory, omega)
        force = np.zeros((*x.shape[:2], basis.n_samples))
        for joint in self.joints:
            force[np.ix_(joint.rows, self.columns(joint))] = self.history_of(joint, x, basis, memory, omega)[1]
        return basis.to_time(x), force

    def history_of(
        self, joint: Joint, x: np.ndarray, basis: HarmonicBasis, memory: np.ndarray, omega: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """Periodic displacement and force of the pairs of one joint, over the components of its law."""
        joint_x = np.ascontiguousarray(x[np.ix_(joint.rows, self.columns(joint))])
        start = np.ascontiguousarray(memory[joint.rows, : joint.n_state])
        return aft.history(joint.module, joint_x, joint.parameters, basis, start, omega)

    def repeat(self, copies: int) -> tuple[Joint, ...]:
        """The joints of several copies of the contact in a row, such as all sectors of a wheel have."""
        starts = self.n_pair * np.arange(copies)[:, None]
        joints = []
        for joint in self.joints:
            parameters = joint.parameters.subset(np.tile(np.arange(len(joint.rows)), copies))
            joints.append(replace(joint, parameters=parameters, pairs=(starts + joint.rows).ravel()))
        return tuple(joints)

    def subset(self, pairs: np.ndarray) -> JointSet:
        """The joints of some of the pairs, in this order."""
        order = np.full(self.n_pair, -1)
        order[pairs] = np.arange(len(pairs))
        joints = []
        for joint in self.joints:
            chosen = np.flatnonzero(order[joint.rows] >= 0)
            chosen = chosen[np.argsort(order[joint.rows][chosen])]
            if len(chosen):
                places = order[joint.rows][chosen]
                joints.append(replace(joint, parameters=joint.parameters.subset(chosen), pairs=places))
        return JointSet(self.components, len(pairs), tuple(joints))
