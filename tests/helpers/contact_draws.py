"""Contact laws that the tests run over: those of the package and those in tests/hbm/laws."""

import re
from pathlib import Path

import numpy as np

from tribodyn.declarations import Role
from tribodyn.hbm.contact import contact_law
from tribodyn.hbm.contact.contact_law import ContactParameters

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
ONE_SLIDER = [(name, c) for name, c in CLOSED_FORMS if contact_law.load(name).n_state(c) <= len(c)]
HARMONICS = [(0, 1), (0, 1, 2, 3), (1, 3), (0, 1, 5)]


def law_id(value: str | tuple[str, ...]) -> str:
    """Name of a law or its components, for the name of a test."""
    return Path(value).stem if isinstance(value, str) else "".join(value)


def tangential(components: tuple[str, ...]) -> list[int]:
    """Positions of the tangential components."""
    return [i for i, c in enumerate(components) if c != "n"]


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
