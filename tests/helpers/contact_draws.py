"""Contact laws that the tests run over, and random contact pairs with motions of every kind, in units of order one.

The laws are those of the package and those in tests/hbm/laws. Their numbers are drawn from what they declare."""

import re
from pathlib import Path

import numpy as np

from tribodyn.declarations import Number, Role
from tribodyn.hbm.contact import contact_law
from tribodyn.hbm.contact.contact_law import ContactParameters
from tribodyn.hbm.harmonics import HarmonicBasis

TEST_LAWS = Path(__file__).parent.parent / "hbm" / "laws"
# a law with a table has units of its own, see test_contact_rough
LAWS = [
    (name, components)
    for name in [*contact_law.names(), *(str(file) for file in sorted(TEST_LAWS.glob("*.py")))]
    if not hasattr(contact_law.load(name), "TABLE")
    for components in contact_law.load(name).COMPONENTS
]
EVENT_BASED = [(name, components) for name, components in LAWS if contact_law.is_event_based(contact_law.load(name))]
CLOSED_FORMS = [(name, components) for name, components in LAWS if hasattr(contact_law.load(name), "event_based_cycle")]
HARMONICS = [(0, 1), (0, 1, 2, 3), (1, 3), (0, 1, 5)]


def law_id(value: str | tuple[str, ...]) -> str:
    """Name of a law or its components, for the name of a test."""
    return Path(value).stem if isinstance(value, str) else "".join(value)


def tangential(components: tuple[str, ...]) -> list[int]:
    """Positions of the tangential components."""
    return [i for i, c in enumerate(components) if c != "n"]


def law_numbers(
    law: str, free: np.ndarray | float = 0.0, **by_role: np.ndarray | float
) -> dict[str, np.ndarray | float]:
    """Values of the numbers that a law declares, in its order; free : of those without a role, within their limits."""
    return {
        number.name: by_role[number.role] if number.role in by_role else within_limits(number, free)
        for number in contact_law.declared(law)
    }


def within_limits(number: Number, value: np.ndarray | float) -> np.ndarray | float:
    """The value, or the nearest one that a declared number allows."""
    low = number.low if number.above is None else number.above + 1e-3 * (1 + abs(number.above))
    return value if low is None and number.high is None else np.clip(value, low, number.high)


def slip_limit(law: str, parameters: ContactParameters, normal: np.ndarray) -> np.ndarray:
    """Tangential force [N] at which pairs slip under a normal force (n_pair, n_sample); zero without friction."""
    limit = np.zeros(normal.shape)
    for number in contact_law.declared(law):
        if number.role == Role.FRICTION:
            limit += parameters.numbers[number.name][:, None] * normal
        elif number.role == Role.SLIP_FORCE:
            limit += parameters.numbers[number.name][:, None]
    return limit


def unit_scale(unit: str | None, length: float, force: float) -> float:
    """How many of a unit a number of order one is, in a system with these units of length and force."""
    scale, basic = 1.0, {"": 1.0, "m": length, "N": force, "J": force * length, "Pa": force / length**2}
    for position, factor in enumerate((unit or "").split("/")):
        symbol, power = re.fullmatch(r"([A-Za-z]*)(\d*)", factor).groups()
        scale *= basic[symbol] ** (int(power or 1) * (-1 if position else 1))
    return scale


def draw(
    law: str, components: tuple[str, ...], basis: HarmonicBasis, n_pair: int, seed: int
) -> tuple[np.ndarray, ContactParameters, np.ndarray]:
    """Displacement, parameters and memory of pairs that stick, slip, separate, or do all of it in one cycle."""
    rng = np.random.default_rng(seed)
    parameters = ContactParameters.of(
        components,
        rng.uniform(0.5, 2, (n_pair, len(components))),
        gap=rng.normal(size=n_pair) * 0.3 - (0.0 if basis.has_static else rng.uniform(0, 2, n_pair)),
        **law_numbers(
            law,
            friction=(friction := rng.uniform(0.1, 0.8, n_pair)),
            normal_load=rng.uniform(0, 1, n_pair),
            free=rng.uniform(0, 1, n_pair),
            slip_force=friction,
        ),
    )
    size = 10 ** rng.uniform(-1.5, 0.5, (n_pair, 1, 1))
    x = rng.normal(size=(n_pair, len(components), basis.n_coeff)) * size / (1 + basis.order)
    if "n" in components and basis.has_static:
        x[:, -1, 0] += rng.uniform(-0.5, 3, n_pair)
    n_state = contact_law.load(law).n_state(components)
    memory = rng.normal(size=(n_pair, n_state)) * rng.integers(0, 2, (n_pair, 1))
    return x, parameters, memory
