"""Friction and stiffness of a contact by its temperature."""

import pytest

from tribodyn.workflows.scene.scene_file import SceneError, SceneFile, read

ROOT = "contacts.root_right"
OVER = 'over="temperature", at=["0 K", "400 K", "800 K"], values='
TABLES = (
    f"{ROOT}.friction={{{OVER}[0.5, 0.4, 0.2]}}",
    f'{ROOT}.tangential_stiffness={{{OVER}["1000 N/um", "900 N/um", "600 N/um"]}}',
    f'{ROOT}.normal_stiffness={{{OVER}["1200 N/um", "1200 N/um", "800 N/um"]}}',
)


def turbine(*changes: str) -> SceneFile:
    return read("turbine", (*TABLES, *changes))


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
    ((f"{ROOT}.temperature=900 K",), r"at 900 K, but its table goes from 0 to 800 K: extend it"),
    ((f"{ROOT}.friction.values=[0.5, 0.4]",), "one of `values` for each"),
    ((f'{ROOT}.friction.at=["0 K", "9 K", "5 K"]',), "ascending order"),
    ((f"{ROOT}.friction.values=[0.5, 0.4, -0.2]",), r"friction.values: expected a value at least 0"),
    ((f'{ROOT}.friction.over="heat"',), r"friction.over: Input should be 'depth', 'energy_density' or 'temperature'"),
    ((f"{ROOT}.by_state={{}}",), "by_state"),
    ((f"{ROOT}.friction={{over='depth', at=[0, 1e-6], values=[0.5, 0]}}",), "values above 0"),
    (('wear.coefficient={over="temperature", at=["0 K"], values=[1e-15]}',), 'expected "depth" or "energy_density"'),
    (('loads.static.map={field="t.csv"}',), "give the contact's own temperature"),
    (("contacts.root_left.temperature=400 K",), "is for numbers over"),
])  # fmt: skip
def test_what_cannot_be_is_one_sentence(changes: tuple[str, ...], said: str) -> None:
    with pytest.raises(SceneError, match=said):
        turbine(*changes)
