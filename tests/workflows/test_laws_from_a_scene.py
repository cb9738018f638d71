"""Every law of the package, run from a scene: each number that it declares changes the result."""

from functools import cache
from typing import Any

import numpy as np
import pytest

import tribodyn as td
from tribodyn import declarations
from tribodyn.hbm.contact import contact_law
from tribodyn.hbm.wear import law as wear_law

SMALL: dict[str, Any] = {
    "harmonics.kept": [0, 1], "wear.tolerance": 0.02, "wear.at": "peak", "wear.motion": "machine",
    "geometry.n_patch": 3, "geometry.n_length": 4, "geometry.n_height": 1, "reduction.modes": 4,
    "harmonics.transitions": "sampled", "response.frequency": ["500 Hz", "700 Hz"], "response.points": 2,
    "verdict.enabled": False,
}  # fmt: skip
# a value in SI units at which a number matters in the beam; a law with a new number needs a line here
# laws without a table of their own; one with a table is in test_rough_scene
PLAIN = [law for law in contact_law.names() if not hasattr(contact_law.load(law), "TABLE")]
VALUES = {"friction": 0.5, "normal_load": 2e3, "cubic": 1e15, "weak": 0.4, "exponent": 0.5, "coefficient": 2e-15}


def numbers(table: str, law: str, declared: tuple[declarations.Number, ...], changed: str = "") -> dict[str, Any]:
    """The overrides for a law and its numbers, one of them doubled."""
    values = {n.name: VALUES[n.name] * (2.0 if n.name == changed else 1.0) for n in declared}
    return {f"{table}.law": law} | {f"{table}.{name}": value for name, value in values.items()}


def contact_overrides(law: str) -> dict[str, Any]:
    """The beam with a contact of a law's first components."""
    components = contact_law.load(law).COMPONENTS[0]
    overrides: dict[str, Any] = {"contact.components": list(components), "contact.friction": None, "wear.max_steps": 0}
    if "n" not in components:
        overrides["contact.normal_stiffness"] = None
    if "t1" not in components:
        overrides["contact.tangential_stiffness"] = None
        overrides |= {"response.direction": "z", "loads.harmonic.shake.direction": "z"}
    return SMALL | overrides


@cache
def response(law: str, changed: str = "") -> np.ndarray:
    """(2, n_coeff) response of the beam with a contact law at both ends of the range."""
    declared = declarations.read(contact_law.file_of(law))
    curve = td.run("beam", overrides=contact_overrides(law) | numbers("contact", law, declared, changed)).response
    assert curve.converged.all()
    return np.asarray(curve.response[[0, -1], 0])


@pytest.mark.parametrize("law", PLAIN)
def test_every_number_of_a_contact_law_changes_the_response(law: str) -> None:
    first = response(law)
    for number in declarations.read(contact_law.file_of(law)):
        repeated = response(law, number.name)
        assert np.abs(repeated - first).max() > 1e-3 * np.abs(first).max(), number.name


def test_the_contact_laws_with_friction_give_different_responses() -> None:
    rows = [response(law)[:, -2:] for law in PLAIN if "t1" in contact_law.load(law).COMPONENTS[0]]
    for i, item in enumerate(rows):
        for other in rows[i + 1 :]:
            assert np.abs(item - other).max() > 1e-3 * np.abs(item).max()


@pytest.mark.parametrize("law", wear_law.names())
def test_every_number_of_a_wear_law_changes_the_wear_per_cycle(law: str) -> None:
    declared = declarations.read(wear_law.file_of(law))
    assert declared
    # a small preload, so that pairs slip, open and close at this frequency
    overrides = SMALL | {"wear.rule": "thesis", "wear.max_steps": 1, "wear.at": "600 Hz"}
    overrides |= {"loads.static.press.value": "4 kN"}

    def rate(changed: str = "") -> np.ndarray:
        wear = td.run("beam", overrides=overrides | numbers("wear", law, declared, changed)).wear
        return np.asarray(wear.worn[0] / wear.cycles_in_step[0])

    first = rate()
    assert first.max() > 0
    for number in declared:
        repeated = rate(number.name)
        assert np.abs(repeated - first).max() > 1e-3 * first.max(), number.name
        if number.name == "coefficient":
            assert np.allclose(repeated, 2 * first, rtol=1e-12)
