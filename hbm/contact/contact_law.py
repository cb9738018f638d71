"""Contact laws: what the file of a law offers, the parameters it sees, and how it is found by its name.

A law is a module `hbm/contact/laws/<name>.py`, or a user's file, with

- `COMPONENTS` : the component tuples it accepts, such as (("t1", "t2", "n"),)
- `Parameters` : its numbers with units, limits and roles, see `tribodyn.declarations`; a law without numbers has none
- `n_state(components)` : number of memory variables of one pair
- `step` : numba function that advances one pair by one time sample (see `hbm.contact.aft.march`); its p is a packed row

and any of these options:

- `TABLE` : meaning of the columns of a table that it needs, with `tabulate(parameters)` : (n_pair, m) values computed
  from the table, with which every packed row ends
- `STIFFNESS_FROM_NUMBERS = True` with `springs(parameters)` : its springs follow from its numbers
- `LINEAR_WHERE_STUCK = True` : a pair that sticks all through a cycle is its springs and a slider at rest, so that a
  small perturbation of the cycle sees the springs alone
- `memory_at_rest(x, parameters)` : memory of a contact without shear at x; without it, sliders stand at x
- `slider_positions(x, parameters, memory, basis)` : positions of its sliders over the cycle and their normal force, for
  wear by slip path; without it a pair has one slider, at x less the force over the stiffness
- `sampled_cycle(x, parameters, memory, basis, jacobian)` : the same periodic cycle as the steps make, faster
- `event_based_cycle(x, parameters, memory, basis, jacobian)` : the cycle with its transitions located between samples,
  faster than `hbm.contact.event_cycle` finds them from the steps
- `VELOCITY = True` : behind the displacements x holds the velocities [m/s], dfx and dsx their columns, p ends with the
  time since the sample before [s]; f has as many places as x, those of velocities stay zero. It is taken at the samples
- `SAMPLES_ONLY = True` : there is no event-based cycle, as the law is smooth or its step integrates along the path
- `SIMPLER_LAW = "jenkins"` : a law with the same components and numbers, whose solution is a first guess for Newton"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache, cached_property
from pathlib import Path
from types import ModuleType

import numpy as np

from tribodyn import declarations
from tribodyn.hbm.contact.aging import Aging
from tribodyn.plugins import PluginKind
from tribodyn.refusal import Refusal

STICKS, SLIPS, SEPARATES = 1, 2, 4


@dataclass(frozen=True)
class ContactParameters:
    """Parameters of every node pair.

    components : which relative displacements the law sees, in the order t1, t2, n
    stiffness : (n_pair, n_component) contact springs [N/m], >= 0 and finite
    gap : (n_pair,) opening of the unloaded pair [m], wear adds to it, interference is negative
    numbers : of the law by name, each (n_pair,), in the units that the law declares
    table : (k, m) of the law, None for none; tabulation : (n_pair, ...) values that the law has computed from it
    aging : how they change with wear, None where the gap alone opens; fresh : before any wear, and the depth (n_pair,)
        that these have by it [m]"""

    components: tuple[str, ...]
    stiffness: np.ndarray
    gap: np.ndarray
    numbers: Mapping[str, np.ndarray]
    table: np.ndarray | None = None
    tabulation: np.ndarray | None = None
    aging: Aging | None = None
    fresh: tuple[ContactParameters, np.ndarray] | None = None

    @classmethod
    def of(
        cls, components: tuple[str, ...], stiffness: np.ndarray, *, gap: np.ndarray | float = 0.0,
        table: np.ndarray | None = None, **numbers: np.ndarray | float,
    ) -> ContactParameters:  # fmt: skip
        """Parameters with scalars spread over all pairs; numbers : of the law, by name.

        Raises  Refusal for values that no contact can have; a `Joint` checks the numbers of the law"""
        k = np.atleast_2d(np.asarray(stiffness, float))
        if k.shape[1] != len(components):
            raise Refusal(f"contact stiffness has {k.shape[1]} columns for the components {components}")

        def spread(value: np.ndarray | float) -> np.ndarray:
            return np.array(np.broadcast_to(np.asarray(value, float), (len(k),)))

        values = {name: spread(value) for name, value in numbers.items()}
        parameters = cls(tuple(components), k, spread(gap), values, table)
        for name, value, low in (("stiffness", k, 0.0), ("gap", parameters.gap, -np.inf)):
            if not np.all(np.isfinite(value)) or np.any(value < low):
                raise Refusal(f"contact {name} must be finite{' and >= 0' if low == 0 else ''} at every pair")
        return parameters

    @property
    def n_pair(self) -> int:
        """Number of node pairs."""
        return len(self.stiffness)

    def subset(self, pairs: np.ndarray) -> ContactParameters:
        """The parameters of some pairs, by their indices."""
        numbers = {name: value[pairs] for name, value in self.numbers.items()}
        tabulation = None if self.tabulation is None else self.tabulation[pairs]
        stiffness, gap = self.stiffness[pairs], self.gap[pairs]
        fresh = None if self.fresh is None else (self.fresh[0].subset(pairs), self.fresh[1][pairs])
        return replace(self, stiffness=stiffness, gap=gap, numbers=numbers, tabulation=tabulation, fresh=fresh)

    def worn(self, depth: np.ndarray) -> ContactParameters:
        """These unworn parameters worn by a depth (n_pair,) [m]."""
        if self.aging is None:
            return replace(self, gap=self.gap + depth)
        return replace(self.older(depth), gap=self.gap + (depth - self.aging.debris.bed(depth)))

    def older(self, step: np.ndarray) -> ContactParameters:
        """The same gap with the numbers of a depth that is larger by a step (n_pair,) [m]."""
        if self.aging is None:
            return self
        base, depth = self.fresh or (self, np.zeros(self.n_pair))
        factors = self.aging.factors(depth + step)
        numbers = {name: value * factors.get(name, 1.0) for name, value in base.numbers.items()}
        by_component = [f"{'normal' if c == 'n' else 'tangential'}_stiffness" for c in self.components]
        scale = np.stack([factors.get(name, np.ones(self.n_pair)) for name in by_component], axis=1)
        return replace(self, stiffness=base.stiffness * scale, numbers=numbers, fresh=(base, depth + step))

    @property
    def bed(self) -> np.ndarray:
        """(n_pair,) thickness of the worn material in the gap [m]."""
        if self.aging is None or self.fresh is None:
            return np.zeros(self.n_pair)
        return self.aging.debris.bed(self.fresh[1])

    @property
    def opening_slope(self) -> np.ndarray:
        """(n_pair,) d gap / d depth."""
        if self.aging is None or self.fresh is None:
            return np.ones(self.n_pair)
        return self.aging.debris.opening_slope(self.fresh[1])

    @property
    def tangential(self) -> list[int]:
        """Positions of the tangential components, the ones in which friction works."""
        return [i for i, c in enumerate(self.components) if c != "n"]

    def packed(self) -> np.ndarray:
        """(n_pair, ...) rows [k of the up to three components, gap, numbers of the law, tabulation] for kernels.

        The numbers stand in the order in which the law declares them, as a `Joint` has put them. Not to be written to.
        """
        return self._packed

    @cached_property
    def _packed(self) -> np.ndarray:
        rows = np.zeros((self.n_pair, 4 + len(self.numbers)))
        rows[:, : len(self.components)] = self.stiffness
        rows[:, 3] = self.gap
        for column, value in enumerate(self.numbers.values(), start=4):
            rows[:, column] = value
        return rows if self.tabulation is None else np.concatenate([rows, self.tabulation], axis=1)


@dataclass(frozen=True)
class ContactCycle:
    """One periodic cycle of all pairs.

    force : (n_pair, n_component, n_coeff) Fourier coefficients of the contact force [N], work-conjugate to x
    jacobian : (n_pair, n_component * n_coeff, n_component * n_coeff) d force / d x [N/m], None if not requested
    status : (n_pair,) bits of what happened in the cycle: STICKS | SLIPS | SEPARATES"""

    force: np.ndarray
    jacobian: np.ndarray | None
    status: np.ndarray

    @property
    def slope(self) -> np.ndarray:
        """The Jacobian, of a cycle that it was requested for."""
        if self.jacobian is None:
            raise RuntimeError("the cycle was evaluated without its Jacobian")
        return self.jacobian


KIND = PluginKind("contact law", "tribodyn.hbm.contact.laws", ("step", "n_state"))
names, file_of, declared = KIND.names, KIND.file_of, KIND.declared


@cache
def load(name: str) -> ModuleType:
    """The module of a law, by its name or the path of a user's file; refuses where there is none."""
    module = KIND.load(name)
    if not isinstance(getattr(module, "COMPONENTS", None), tuple):
        raise Refusal(f'contact law file \'{name}\' has no COMPONENTS, such as (("t1", "n"),)')
    return module


def is_event_based(law: ModuleType) -> bool:
    """Whether the transitions of a law are located between samples, by itself or from its steps."""
    return hasattr(law, "event_based_cycle") or not (getattr(law, "SAMPLES_ONLY", False) or needs_velocity(law))


def needs_velocity(law: ModuleType) -> bool:
    """Whether the step of a law takes velocities, too."""
    return getattr(law, "VELOCITY", False)


def name_of(law: ModuleType) -> str:
    """Name of a law for sentences."""
    return _path(law).stem


def _path(law: ModuleType) -> Path:
    return Path(str(law.__file__))


@cache
def _number_names(law: ModuleType) -> tuple[str, ...]:
    return tuple(number.name for number in declarations.read(_path(law)))


def require_order(law: ModuleType, parameters: ContactParameters) -> None:
    """Refuse parameters that do not hold the numbers of a law in its order, as `complete` gives them."""
    if tuple(parameters.numbers) != _number_names(law):
        values, declared_names = ", ".join(parameters.numbers) or "none", ", ".join(_number_names(law)) or "none"
        raise Refusal(
            f"contact law '{name_of(law)}' has the numbers {declared_names}, in this order, and was given {values}"
        )


def require_components(name: str, components: tuple[str, ...]) -> None:
    """Refuse components that the law of a name does not serve."""
    accepted = load(name).COMPONENTS
    if components not in accepted:
        alternatives = " or ".join("(" + ", ".join(c) + ")" for c in accepted)
        raise Refusal(f"contact law '{Path(name).stem}' has components {alternatives}, not {components}")


def complete(name: str, parameters: ContactParameters) -> ContactParameters:
    """The parameters with all numbers of the law in their order, and what it computes from its table.

    Raises  Refusal where the components, a number or the table are none of this law"""
    require_components(name, parameters.components)
    values = declarations.complete(declared(name), parameters.numbers, f"contact law '{Path(name).stem}'")
    n = parameters.n_pair
    numbers = {key: np.array(np.broadcast_to(np.asarray(v, float), (n,))) for key, v in values.items()}
    result, law = replace(parameters, numbers=numbers), load(name)
    if hasattr(law, "tabulate"):  # from its numbers, once
        limits = [number.name for number in declared(name) if number.role in declarations.SLIP_LIMITS]
        tables = () if parameters.aging is None else parameters.aging.tables
        if fixed := [number for number in tables if number not in limits]:
            raise Refusal(f"contact law '{Path(name).stem}': {fixed[0]} cannot change with wear: give one number")
        return replace(result, tabulation=law.tabulate(result))
    if parameters.table is not None:
        raise Refusal(f"contact law '{Path(name).stem}' takes no table: leave it out")
    return result
