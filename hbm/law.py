"""Contact laws: what a law file offers, the parameters it sees, and how it is found by its name.

A law is a module `hbm/contact/<name>.py` with

- `COMPONENTS` : the component tuples it accepts, such as (("t1", "t2", "n"),)
- `n_state(components)` : number of memory variables of one pair
- `step` : numba function that advances one pair by one time sample (see `hbm.aft.march`)
- optionally `cycle(x, parameters, memory, basis, jacobian)` : the same periodic cycle at the samples, faster
- optionally `located(x, parameters, memory, basis, jacobian)` : the cycle with its transitions located between samples
"""

from __future__ import annotations

import importlib
import pkgutil
from dataclasses import dataclass, fields, replace
from functools import cache
from types import ModuleType

import numpy as np

from tribodyn.hbm import contact as hbm_contact

STICKS, SLIPS, SEPARATES = 1, 2, 4


@dataclass(frozen=True)
class ContactParameters:
    """Parameters of every node pair.

    components : which relative displacements the law sees, in the order t1, t2, n
    stiffness : (n_pair, n_component) contact springs [N/m], >= 0 and finite
    friction : (n_pair,) Coulomb coefficient, >= 0
    gap : (n_pair,) opening of the unloaded pair [m], wear adds to it, interference is negative
    normal_load : (n_pair,) constant normal load of laws without a normal component [N]
    cubic : (n_pair,) cubic coefficient of the smooth reference law [N/m3]
    """

    components: tuple[str, ...]
    stiffness: np.ndarray
    friction: np.ndarray
    gap: np.ndarray
    normal_load: np.ndarray
    cubic: np.ndarray

    @classmethod
    def of(
        cls,
        components: tuple[str, ...],
        stiffness: np.ndarray,
        *,
        friction: np.ndarray | float = 0.0,
        gap: np.ndarray | float = 0.0,
        normal_load: np.ndarray | float = 0.0,
        cubic: np.ndarray | float = 0.0,
    ) -> ContactParameters:
        """Parameters with scalars spread over all pairs; raises ValueError for what no contact can have."""
        k = np.atleast_2d(np.asarray(stiffness, float))
        if k.shape[1] != len(components):
            raise ValueError(f"contact stiffness has {k.shape[1]} columns for the components {components}")

        def spread(value: np.ndarray | float) -> np.ndarray:
            return np.array(np.broadcast_to(np.asarray(value, float), (len(k),)))

        made = cls(tuple(components), k, spread(friction), spread(gap), spread(normal_load), spread(cubic))
        for name, low in (("stiffness", 0.0), ("friction", 0.0), ("gap", -np.inf), ("normal_load", 0.0)):
            value = getattr(made, name)
            if not np.all(np.isfinite(value)) or np.any(value < low):
                raise ValueError(f"contact {name} must be finite{' and >= 0' if low == 0 else ''} at every pair")
        return made

    @property
    def n_pair(self) -> int:
        """Number of node pairs."""
        return len(self.stiffness)

    def taken(self, pairs: np.ndarray) -> ContactParameters:
        """The parameters of some pairs, by their indices."""
        own = {f.name: getattr(self, f.name)[pairs] for f in fields(self) if f.name != "components"}
        return replace(self, **own)

    @property
    def tangential(self) -> list[int]:
        """Positions of the tangential components, the ones in which friction works."""
        return [i for i, c in enumerate(self.components) if c != "n"]

    def packed(self) -> np.ndarray:
        """(n_pair, 7) rows [k of the up to three components, mu, gap, N0, cubic] as the kernels read them."""
        rows = np.zeros((self.n_pair, 7))
        rows[:, : len(self.components)] = self.stiffness
        rows[:, 3] = self.friction
        rows[:, 4] = self.gap
        rows[:, 5] = self.normal_load
        rows[:, 6] = self.cubic
        return rows


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


def names() -> list[str]:
    """Names of the contact laws there are."""
    return sorted(m.name for m in pkgutil.iter_modules(hbm_contact.__path__) if not m.name.startswith("_"))


@cache
def load(name: str) -> ModuleType:
    """The law module of this name; raises ValueError with the known names."""
    if name not in names():
        raise ValueError(f"no contact law '{name}': there are {', '.join(names())}")
    return importlib.import_module(f"tribodyn.hbm.contact.{name}")


def check_components(law: ModuleType, components: tuple[str, ...]) -> None:
    """Raise ValueError where a law cannot serve these components."""
    if components not in law.COMPONENTS:
        known = " or ".join("(" + ", ".join(c) + ")" for c in law.COMPONENTS)
        raise ValueError(f"contact law '{law.__name__.rsplit('.', 1)[-1]}' has components {known}, not {components}")
