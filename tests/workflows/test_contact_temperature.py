"""Friction and stiffness of a contact by its temperature."""

import pytest

from tribodyn.workflows.scene.scene_file import SceneError, SceneFile, read

ROOT = "contacts.root_right"
BARE = ("friction", "tangential_stiffness", "normal_stiffness")
TABLE = (
    f'{ROOT}.by_temperature={{temperature=["0 K", "400 K", "800 K"], friction=[0.5, 0.4, 0.2], '
    'tangential_stiffness=["1000 N/um", "900 N/um", "600 N/um"], '
    'normal_stiffness=["1200 N/um", "1200 N/um", "800 N/um"]}'
)


def turbine(*changes: str) -> SceneFile:
    return read("turbine", (*(f"{ROOT}.{name}=" for name in BARE), TABLE, *changes))


def numbers(file: SceneFile, joint: str = "root_right") -> tuple[float, float | None, float | None]:
    contact = file.scene.joints[joint]
    return contact.numbers["friction"], contact.tangential_stiffness, contact.normal_stiffness


def test_numbers_are_those_of_the_given_temperature() -> None:
    """At a row they are the row, between rows linear, and a cold scene has the cold ones."""
    assert numbers(turbine(f"{ROOT}.temperature=400 K")) == pytest.approx((0.4, 900e6, 1200e6))
    assert numbers(turbine(f"{ROOT}.temperature=700 K")) == pytest.approx((0.25, 675e6, 900e6))
    assert numbers(turbine()) == pytest.approx((0.5, 1000e6, 1200e6))
    assert numbers(turbine()) == numbers(read("turbine"))


def test_the_temperature_is_that_of_both_bodies() -> None:
    """Blade and disk at 500 K and 300 K: the contact is at 400 K; heat of the damper does not count."""
    heat = (
        'loads.static.hot={temperature="500 K", bodies=["blade"]}',
        'loads.static.warm={temperature="300 K", bodies=["disk"]}',
        'loads.static.other={temperature="900 K", bodies=["damper"]}',
    )
    assert numbers(turbine(*heat)) == pytest.approx((0.4, 900e6, 1200e6))
    assert numbers(turbine('loads.static.all={temperature="800 K"}')) == pytest.approx((0.2, 600e6, 800e6))
    assert numbers(turbine(*heat), "root_left") == pytest.approx((0.5, 1000e6, 1200e6))


def test_a_scene_that_was_written_out_reads_again() -> None:
    scene = turbine(f"{ROOT}.temperature=700 K").mesh_scene
    assert type(scene).model_validate_json(scene.model_dump_json()) == scene


@pytest.mark.parametrize(("changes", "said"), [
    ((f"{ROOT}.temperature=900 K",), r"at 900 K, but by_temperature goes from 0 to 800 K: extend it"),
    ((f"{ROOT}.friction=0.4",), r"contacts\.root_right\.friction: by_temperature gives it too"),
    ((f"{ROOT}.by_temperature.friction=[0.5, 0.4]",), "friction: give 3 values, one for each temperature"),
    ((f'{ROOT}.by_temperature.temperature=["0 K", "9 K", "5 K"]',), "ascending order"),
    ((f"{ROOT}.by_temperature.friction=[0.5, 0.4, -0.2]",), "friction: expected a value at least 0"),
    ((f"{ROOT}.by_temperature.fricton=[0.5, 0.4, 0.2]",), "did you mean friction"),
    (('loads.static.map={field="t.csv"}',), "give the contact's own temperature"),
    (("contacts.root_left.temperature=400 K",), "is for by_temperature, which is not there"),
])  # fmt: skip
def test_what_cannot_be_is_one_sentence(changes: tuple[str, ...], said: str) -> None:
    with pytest.raises(SceneError, match=said):
        turbine(*changes)
