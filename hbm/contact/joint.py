"""Joints: where a structure touches, each with its own contact law and that law's own parameters.

A reduced model has one contact map. Its rows run pair by pair, component by component, and each joint covers some of
the pairs. A joint whose law sees only some of the components of the interface has zero springs and no force in the
others.
"""

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
    pairs : slice or indices of its pairs among those of the contact interface; None for all of them
    """

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
    """How forces of these joints are taken best: "located" where all their laws can, else "sampled"."""
    every = [joints] if isinstance(joints, Joint) else joints
    return "located" if all(contact_law.locates(joint.module) for joint in every) else "sampled"


@dataclass(frozen=True)
class JointSet:
    """All joints of one contact interface; every pair belongs to exactly one of them.

    components : of the interface, in the order t1, t2, n; n_pair : its number of pairs
    joints : with their pairs as indices
    """

    components: tuple[str, ...]
    n_pair: int
    joints: tuple[Joint, ...]

    @classmethod
    def of(cls, model: ReducedModel, joints: Joint | Sequence[Joint]) -> JointSet:
        """The joints of a model.

        Raises  ValueError where they do not share out its pairs, there is no such law, it does not serve the
            components, or one of its numbers is missing, unknown or out of its limits
        """
        given = (joints,) if isinstance(joints, Joint) else tuple(joints)
        if not given:
            raise Refusal("a harmonic balance needs at least one joint")
        components, n_pair = tuple(model.interface.components), model.interface.n_pair
        names = [joint.name for joint in given]
        if len(set(names)) < len(names):
            raise Refusal(f"the joints need different names, got {', '.join(names)}")
        placed, owners = [], np.zeros(n_pair, int)
        for joint in given:
            whole = slice(None) if joint.pairs is None else joint.pairs
            try:
                pairs = np.arange(n_pair)[whole]
            except IndexError:
                raise Refusal(f"joint '{joint.name}' has pairs beyond the {n_pair} of the contact") from None
            if len(pairs) != joint.parameters.n_pair:
                raise Refusal(
                    f"joint '{joint.name}' covers {len(pairs)} pairs and has parameters of {joint.parameters.n_pair}"
                )
            seen = joint.parameters.components
            if [c for c in components if c in seen] != list(seen):
                raise Refusal(f"joint '{joint.name}' has components {seen}, the contact has {components}")
            np.add.at(owners, pairs, 1)
            placed.append(replace(joint, pairs=pairs, parameters=contact_law.checked(joint.law, joint.parameters)))
        if np.any(owners != 1):
            pair = int(np.flatnonzero(owners != 1)[0])
            raise Refusal(f"pair {pair} of the contact belongs to {owners[pair]} joints: each needs exactly one")
        return cls(components, n_pair, tuple(placed))

    @cached_property
    def _alone(self) -> Joint | None:
        """The one joint that covers all pairs in their order with all components, where it is so: nothing is copied."""
        joint = self.joints[0]
        whole = len(self.joints) == 1 and joint.parameters.components == self.components
        return joint if whole and np.array_equal(joint.rows, np.arange(self.n_pair)) else None

    def only(self, needed_by: str) -> Joint:
        """The joint that is the whole contact; raises ValueError where there are several, or it sees a part of it."""
        if self._alone is None:
            raise Refusal(f"{needed_by} serves one joint that covers the whole contact: this one has several laws")
        return self._alone

    def merged(self, needed_by: str) -> Joint:
        """One joint that covers all pairs in their order, where every joint has the same law and all components.

        Raises  ValueError where they differ
        """
        if self._alone is not None:
            return self._alone
        first = self.joints[0]
        alike = all(
            joint.law == first.law
            and joint.parameters.components == self.components
            and joint.parameters.tail is None
            and tuple(joint.parameters.numbers) == tuple(first.parameters.numbers)
            for joint in self.joints
        )
        if not alike:
            return self.only(needed_by)

        def gathered(name: str) -> np.ndarray:
            return self.gathered(lambda joint: joint.parameters.numbers[name])

        numbers = {name: gathered(name) for name in first.parameters.numbers}
        whole = replace(first.parameters, stiffness=self.stiffness, gap=self.gap, numbers=numbers)
        return replace(first, name=needed_by, parameters=whole, pairs=np.arange(self.n_pair))

    def columns(self, joint: Joint) -> np.ndarray:
        """Positions of a joint's components among those of the interface."""
        return np.array([self.components.index(c) for c in joint.parameters.components])

    @cached_property
    def stiffness(self) -> np.ndarray:
        """(n_pair, n_component) contact springs [N/m], zero in components that a joint does not see."""
        if self._alone is not None:
            return self._alone.parameters.stiffness
        k = np.zeros((self.n_pair, len(self.components)))
        for joint in self.joints:
            k[np.ix_(joint.rows, self.columns(joint))] = joint.parameters.stiffness
        return k

    @cached_property
    def gap(self) -> np.ndarray:
        """(n_pair,) opening of the unloaded pairs [m]."""
        alone = self._alone
        return self.gathered(lambda joint: joint.parameters.gap) if alone is None else alone.parameters.gap

    def number(self, role: Role) -> np.ndarray:
        """(n_pair,) the laws' numbers with a role, zero in joints whose law has none."""

        def value(joint: Joint) -> np.ndarray:
            name = joint.name_of(role)
            return np.zeros(len(joint.rows)) if name is None else joint.parameters.numbers[name]

        return self.gathered(value)

    def gathered(self, value: Callable[[Joint], np.ndarray]) -> np.ndarray:
        """(n_pair,) a value of every pair, joint by joint."""
        out = np.zeros(self.n_pair)
        for joint in self.joints:
            out[joint.rows] = value(joint)
        return out

    @property
    def has_friction(self) -> bool:
        """Whether a law limits its tangential force."""
        return any(joint.has_friction for joint in self.joints)

    @cached_property
    def sees(self) -> np.ndarray:
        """(n_pair, n_component) whether the law of a pair sees a component."""
        seen = np.zeros((self.n_pair, len(self.components)), bool)
        for joint in self.joints:
            seen[np.ix_(joint.rows, self.columns(joint))] = True
        return seen

    @property
    def tangential(self) -> list[int]:
        """Positions of the tangential components, the ones in which friction works."""
        return [i for i, c in enumerate(self.components) if c != "n"]

    @cached_property
    def n_state(self) -> int:
        """Number of memory variables of one pair, the most that a joint has; the others leave theirs at zero."""
        return max(joint.n_state for joint in self.joints)

    @property
    def locates(self) -> bool:
        """Whether every law locates its transitions between samples."""
        return joint_transitions(self.joints) == "located"

    def joint(self, name: str) -> Joint:
        """The joint of this name; raises ValueError with the names that there are."""
        for joint in self.joints:
            if joint.name == name:
                return joint
        raise Refusal(f"no joint '{name}': there are {', '.join(joint.name for joint in self.joints)}")

    def by_joint(self, of_pairs: np.ndarray) -> dict[str, np.ndarray]:
        """Values (n_pair, ...) of all pairs, joint by joint; for status, energy, forces, wear."""
        return {joint.name: of_pairs[joint.rows] for joint in self.joints}

    def with_gap(self, gap: np.ndarray) -> JointSet:
        """The same with another gap (n_pair,) [m]."""
        return self._with(lambda joint: replace(joint.parameters, gap=gap[joint.rows]))

    def with_parameters(self, change: Callable[[ContactParameters], ContactParameters]) -> JointSet:
        """The same with the parameters of every joint changed."""
        return self._with(lambda joint: change(joint.parameters))

    def with_friction_scaled(self, factor: float) -> JointSet:
        """The same with the limit of friction of every pair multiplied by a factor."""
        return replace(self, joints=tuple(joint.with_friction_scaled(factor) for joint in self.joints))

    def _with(self, parameters: Callable[[Joint], ContactParameters]) -> JointSet:
        return replace(self, joints=tuple(replace(joint, parameters=parameters(joint)) for joint in self.joints))

    def cycle(self, x: np.ndarray, basis: HarmonicBasis, memory: np.ndarray, jacobian: bool = True) -> ContactCycle:
        """Periodic contact cycle of all pairs, each by the law of its joint.

        x : (n_pair, n_component, n_coeff) [m]; memory : (n_pair, n_state) at the start of the load path
        Raises  ValueError where the basis asks for located transitions and a law does not locate them
        """
        one = self._alone
        if one is not None:
            return aft.cycle(one.module, x, one.parameters, basis, memory, jacobian)
        n_pair, n_comp, n_coeff = x.shape
        width = n_comp * n_coeff
        force, status = np.zeros_like(x), np.zeros(n_pair, np.int64)
        slope = np.zeros((n_pair, width, width)) if jacobian else None
        for joint in self.joints:
            rows, seen = joint.rows, self.columns(joint)
            own = np.ascontiguousarray(x[np.ix_(rows, seen)])
            start = np.ascontiguousarray(memory[rows, : joint.n_state])
            part = aft.cycle(joint.module, own, joint.parameters, basis, start, jacobian)
            force[np.ix_(rows, seen)], status[rows] = part.force, part.status
            if slope is not None:
                at = (seen[:, None] * n_coeff + np.arange(n_coeff)).ravel()
                slope[np.ix_(rows, at, at)] = part.jacobian
        return ContactCycle(force, slope, status)

    def history(self, x: np.ndarray, basis: HarmonicBasis, memory: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Periodic displacement [m] and force [N] over one period, both (n_pair, n_component, n_samples).

        Arguments as for `cycle`; see `hbm.contact.aft.history`
        """
        one = self._alone
        if one is not None:
            return aft.history(one.module, x, one.parameters, basis, memory)
        force = np.zeros((*x.shape[:2], basis.n_samples))
        for joint in self.joints:
            force[np.ix_(joint.rows, self.columns(joint))] = self.history_of(joint, x, basis, memory)[1]
        return basis.to_time(x), force

    def history_of(
        self, joint: Joint, x: np.ndarray, basis: HarmonicBasis, memory: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """The same of the pairs of one joint, over the components that its law sees."""
        own = np.ascontiguousarray(x[np.ix_(joint.rows, self.columns(joint))])
        start = np.ascontiguousarray(memory[joint.rows, : joint.n_state])
        return aft.history(joint.module, own, joint.parameters, basis, start)

    def repeated(self, copies: int) -> tuple[Joint, ...]:
        """The joints of so many copies of the contact, one after the other, as all sectors of a wheel have them."""
        starts = self.n_pair * np.arange(copies)[:, None]
        joints = []
        for joint in self.joints:
            again = np.tile(np.arange(len(joint.rows)), copies)
            parameters = joint.parameters.taken(again)
            joints.append(replace(joint, parameters=parameters, pairs=(starts + joint.rows).ravel()))
        return tuple(joints)

    def taken(self, pairs: np.ndarray) -> JointSet:
        """The contact of some of the pairs, in the order given."""
        order = np.full(self.n_pair, -1)
        order[pairs] = np.arange(len(pairs))
        joints = []
        for joint in self.joints:
            kept = np.flatnonzero(order[joint.rows] >= 0)
            kept = kept[np.argsort(order[joint.rows][kept])]
            if len(kept):
                joints.append(replace(joint, parameters=joint.parameters.taken(kept), pairs=order[joint.rows][kept]))
        return JointSet(self.components, len(pairs), tuple(joints))
