"""Random contact pairs for the tests of the contact laws: motions of every kind, in units of order one."""

from __future__ import annotations

from types import ModuleType

import numpy as np

from tribodyn.hbm.contact import contact_law
from tribodyn.hbm.contact.contact_law import ContactParameters
from tribodyn.hbm.harmonics import HarmonicBasis

# a law with a table is drawn in units of its own, see test_contact_rough
LAWS = [
    (name, components)
    for name in contact_law.names()
    if not hasattr(contact_law.load(name), "TABLE")
    for components in contact_law.load(name).COMPONENTS
]
LOCATED = [(name, components) for name, components in LAWS if hasattr(contact_law.load(name), "located")]
HARMONICS = [(0, 1), (0, 1, 2, 3), (1, 3), (0, 1, 5)]


def tangential(components: tuple[str, ...]) -> list[int]:
    """Positions of the tangential components."""
    return [i for i, c in enumerate(components) if c != "n"]


def own(name: str, **numbers: np.ndarray | float) -> dict[str, np.ndarray | float]:
    """Those of the numbers that the law of this name declares, in its order."""
    return {number.name: numbers[number.name] for number in contact_law.declared(name)}


def draw(
    law: ModuleType, components: tuple[str, ...], basis: HarmonicBasis, n_pair: int, seed: int
) -> tuple[np.ndarray, ContactParameters, np.ndarray]:
    """Displacement, parameters and memory of pairs that stick, slip, separate, or do all of it in one cycle."""
    rng = np.random.default_rng(seed)
    parameters = ContactParameters.of(
        components,
        rng.uniform(0.5, 2, (n_pair, len(components))),
        gap=rng.normal(size=n_pair) * 0.3 - (0.0 if basis.has_static else rng.uniform(0, 2, n_pair)),
        **own(
            contact_law.called(law),
            friction=rng.uniform(0.1, 0.8, n_pair),
            normal_load=rng.uniform(0, 1, n_pair),
            cubic=rng.uniform(0, 1, n_pair),
        ),
    )
    size = 10 ** rng.uniform(-1.5, 0.5, (n_pair, 1, 1))
    x = rng.normal(size=(n_pair, len(components), basis.n_coeff)) * size / (1 + basis.order)
    if "n" in components and basis.has_static:
        x[:, -1, 0] += rng.uniform(-0.5, 3, n_pair)
    memory = rng.normal(size=(n_pair, law.n_state(components))) * rng.integers(0, 2, (n_pair, 1))
    return x, parameters, memory
