"""Contact laws: what a law file offers, the parameters it sees, and how it is found by its name.

A law is a module `hbm/contact/laws/<name>.py`, or a file of one's own, with

- `COMPONENTS` : the component tuples it accepts, such as (("t1", "t2", "n"),)
- `Parameters` : its own numbers with their units, see `tribodyn.declarations`; none where the class is missing
- `n_state(components)` : number of memory variables of one pair
- optionally `TABLE` : meaning of the columns of a table that it needs, and `tabulated(parameters)` : (n_pair, m) what
  it makes of it, with which every packed row ends
- optionally `OWN_STIFFNESS` and `springs(parameters)` : its springs follow from its own numbers
- optionally `LINEAR_WHERE_STUCK = True` : a pair that sticks all through a cycle is its springs and a slider that
  stands still, so that a small perturbation of the cycle sees the springs alone
- optionally `rested(x, parameters)` : memory of a contact without shear at x; positions of sliders without it
- optionally `sliders(x, parameters, memory, basis)` : where its sliders are over the cycle and what loads them, for
  wear by slip path; without it a pair has one slider, at x less the force over the stiffness
- `step` : numba function that advances one pair by one time sample (see `hbm.contact.aft.march`); its p is a packed row
- optionally `cycle(x, parameters, memory, basis, jacobian)` : the same periodic cycle at the samples, faster
- optionally `located(x, parameters, memory, basis, jacobian)` : the cycle with its transitions located between samples,
  faster than `hbm.contact.events` finds them from `step`
- optionally `SIMPLER = "jenkins"` : a law with the same components and numbers, from whose solution Newton may begin
- optionally `BY_SAMPLES = True` : its cycle is that at the samples, as it has no transitions (a smooth law) or its step
  integrates along the path (planar friction); where there is no `located`, none is looked for
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache, cached_property
from pathlib import Path
from types import ModuleType

import numpy as np

from tribodyn import declarations
from tribodyn.plugins import PluginKind
from tribodyn.refusal import Refusal

STICKS, SLIPS, SEPARATES = 1, 2, 4


@dataclass(frozen=True)
class ContactParameters:
    """Parameters of every node pair.

    components : which relative displacements the law sees, in the order t1, t2, n
    stiffness : (n_pair, n_component) contact springs [N/m], >= 0 and finite
    gap : (n_pair,) opening of the unloaded pair [m], wear adds to it, interference is negative
    numbers : the law's own by name, each (n_pair,), in the units that the law declares
    table : (k, m) the law's own table, None for none; tail : (n_pair, ...) what the law has made of it
    """

    components: tuple[str, ...]
    stiffness: np.ndarray
    gap: np.ndarray
    numbers: Mapping[str, np.ndarray]
    table: np.ndarray | None = None
    tail: np.ndarray | None = None

    @classmethod
    def of(
        cls,
        components: tuple[str, ...],
        stiffness: np.ndarray,
        *,
        gap: np.ndarray | float = 0.0,
        table: np.ndarray | None = None,
        **numbers: np.ndarray | float,
    ) -> ContactParameters:
        """Parameters with scalars spread over all pairs; numbers : the law's own, such as friction=0.4.

        Raises  ValueError for what no contact can have; a `Joint` checks the law's own numbers
        """
        k = np.atleast_2d(np.asarray(stiffness, float))
        if k.shape[1] != len(components):
            raise Refusal(f"contact stiffness has {k.shape[1]} columns for the components {components}")

        def spread(value: np.ndarray | float) -> np.ndarray:
            return np.array(np.broadcast_to(np.asarray(value, float), (len(k),)))

        made = cls(tuple(components), k, spread(gap), {name: spread(value) for name, value in numbers.items()}, table)
        for name, value, low in (("stiffness", made.stiffness, 0.0), ("gap", made.gap, -np.inf)):
            if not np.all(np.isfinite(value)) or np.any(value < low):
                raise Refusal(f"contact {name} must be finite{' and >= 0' if low == 0 else ''} at every pair")
        return made

    @property
    def n_pair(self) -> int:
        """Number of node pairs."""
        return len(self.stiffness)

    def taken(self, pairs: np.ndarray) -> ContactParameters:
        """The parameters of some pairs, by their indices."""
        numbers = {name: value[pairs] for name, value in self.numbers.items()}
        tail = None if self.tail is None else self.tail[pairs]
        return replace(self, stiffness=self.stiffness[pairs], gap=self.gap[pairs], numbers=numbers, tail=tail)

    @property
    def tangential(self) -> list[int]:
        """Positions of the tangential components, the ones in which friction works."""
        return [i for i, c in enumerate(self.components) if c != "n"]

    def packed(self) -> np.ndarray:
        """(n_pair, ...) rows [k of the up to three components, gap, the law's own numbers, tail] for kernels.

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
        return rows if self.tail is None else np.concatenate([rows, self.tail], axis=1)


@dataclass(frozen=True)
class ContactCycle:
    """One periodic cycle of all pairs.

    force : (n_pair, n_component, n_coeff) Fourier coefficients of the contact force [N], work-conjugate to x
    jacobian : (n_pair, n_component * n_coeff, n_component * n_coeff) d force / d x [N/m], or None if not asked for
    status : (n_pair,) bits of what happened in the cycle: STICKS | SLIPS | SEPARATES
    """

    force: np.ndarray
    jacobian: np.ndarray | None
    status: np.ndarray


KIND = PluginKind("contact law", "tribodyn.hbm.contact.laws", ("step", "n_state"))
names, file_of, declared = KIND.names, KIND.file_of, KIND.declared


@cache
def load(name: str) -> ModuleType:
    """The law module of this name, or of a file of one's own; raises ValueError where there is none."""
    module = KIND.load(name)
    if not isinstance(getattr(module, "COMPONENTS", None), tuple):
        raise Refusal(f'contact law file \'{name}\' has no COMPONENTS, such as (("t1", "n"),)')
    return module


def locates(law: ModuleType) -> bool:
    """Whether the transitions of a law are located between samples, by itself or from its steps."""
    return hasattr(law, "located") or not getattr(law, "BY_SAMPLES", False)


def called(law: ModuleType) -> str:
    """Name of a law for sentences."""
    assert law.__file__ is not None
    return Path(law.__file__).stem


@cache
def _order(law: ModuleType) -> tuple[str, ...]:
    assert law.__file__ is not None
    return tuple(n.name for n in declarations.read(Path(law.__file__)))


def require_order(law: ModuleType, parameters: ContactParameters) -> None:
    """Raise ValueError where parameters do not hold a law's own numbers in its order, as `checked` gives them."""
    if tuple(parameters.numbers) != _order(law):
        has, own = ", ".join(parameters.numbers) or "none", ", ".join(_order(law)) or "none"
        raise Refusal(f"contact law '{called(law)}' has the numbers {own}, in this order, and was given {has}")


def check_components(name: str, components: tuple[str, ...]) -> None:
    """Raise ValueError where the law of this name does not serve these components."""
    accepted = load(name).COMPONENTS
    if components not in accepted:
        known = " or ".join("(" + ", ".join(c) + ")" for c in accepted)
        raise Refusal(f"contact law '{Path(name).stem}' has components {known}, not {components}")


def checked(name: str, parameters: ContactParameters) -> ContactParameters:
    """The parameters with the law's own numbers complete and in their order; raises ValueError where that fails."""
    check_components(name, parameters.components)
    values = declarations.complete(declared(name), parameters.numbers, f"contact law '{Path(name).stem}'")
    n = parameters.n_pair
    numbers = {key: np.array(np.broadcast_to(np.asarray(v, float), (n,))) for key, v in values.items()}
    complete, law = replace(parameters, numbers=numbers), load(name)
    if hasattr(law, "tabulated"):
        return replace(complete, tail=law.tabulated(complete))
    if parameters.table is not None:
        raise Refusal(f"contact law '{Path(name).stem}' takes no table: leave it out")
    return complete
