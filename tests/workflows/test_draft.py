"""`tribodyn new`: the scene that it begins is read and planned as it stands, and names what touches."""

import json
import re
import shutil
from pathlib import Path
from typing import Any

import gmsh
import numpy as np
import pytest
from PIL import Image

import tribodyn as td
from tests.helpers.command import printed_text, refusal
from tests.helpers.pages import ROOT
from tribodyn.fem.assembly import group_name
from tribodyn.geometry.gmsh_session import session
from tribodyn.workflows.pictures import offscreen
from tribodyn.workflows.pictures.theme import BLUE, RED
from tribodyn.workflows.run import modelling, sanity_checks
from tribodyn.workflows.run.progress import Progress
from tribodyn.workflows.scene import scene_file
from tribodyn.workflows.studies.draft import draft

SMALLEST = """
material = { young = "210 GPa", density = "7860 kg/m3" }

[geometry]
part = "beam"
fixed = ["clamp"]

[contact]
group = "contact"
tangential_stiffness = "470 N/um"
normal_stiffness = "583 N/um"
friction = 0.5

[loads.harmonic]
shake = { group = "shaker", direction = "y", value = "10 kN" }

[response]
frequency = ["380 Hz", "1200 Hz"]
"""


def step(path: Path) -> Path:
    """Two boxes in mm, one on the other but for 0.02 mm."""
    with session() as model:
        model.model.occ.addBox(0, 0, 0, 20, 10, 10)
        model.model.occ.addBox(5, 0, 10.02, 20, 10, 10)
        model.model.occ.synchronize()
        gmsh.write(str(path))
    return path


def deck(path: Path) -> Path:
    page = (ROOT / "docs/howto/deck.md").read_text(encoding="utf-8")
    match = re.search(r"```text lap.inp\n(.*?)```", page, re.S)
    path.write_text(match.group(1))
    return path


@pytest.mark.parametrize(("make", "name", "pair", "apart"), [
    (step, "boxes.step", ("solid 1.face 6", "solid 2.face 11"), 0.02e-3),
    (deck, "lap.inp", ("Lower.Top", "Upper.Sole"), 0.0),
])  # fmt: skip
def test_a_scene_is_begun_from_a_file_and_is_one(make, name, pair, apart, tmp_path, capsys):
    file = make(tmp_path / name)
    message = printed_text(["new", str(file)], capsys)
    assert "unit      mm: guessed" in message
    written = file.with_suffix(".toml")
    scene = scene_file.read(str(written)).scene
    (joint,) = scene.joints.values()
    assert (joint.group, joint.opposite) == pair
    assert f"{1e3 * apart:.3g} mm apart" in message
    raised = ("decks.lap.elements=quadratic",) if make is deck else ()
    assert len(td.build(written, overrides=("harmonics.kept=[0, 1]", *raised)).part.interface.area) > 4
    assert json.loads((tmp_path / "scene.schema.json").read_text())["$defs"]
    before, mark, wear = written.read_text().partition("# [wear]")
    marks_off = re.sub("^# ", "", mark + wear, flags=re.MULTILINE)
    expected = scene_file.parse(before + marks_off, "worn.toml", (), tmp_path).scene.wear
    assert expected.step.depth == 1e-6  # a share of delta_max needs a body that is held without its contact
    assert "is there already" in refusal(["new", str(file)], capsys)
    shutil.copy(file, tmp_path / f"far{file.suffix}")
    assert draft(tmp_path / f"far{file.suffix}", unit="m").unit == "m"


def test_contact_pairs_of_a_deck_come_first_under_the_names_that_it_has(tmp_path: Path, capsys: Any) -> None:
    file, faces = deck(tmp_path / "lap.inp"), "*Surface, type=ELEMENT, name=Over\n 1, S2\n 2, S2\n"
    faces += "*Surface, type=ELEMENT, name=Under\n 1, S1\n 2, S1\n*End Part"
    pair = "*Contact Pair, interaction=dry\nUpper.Under, Lower.Over\n"
    for card in (
        "Surface Interaction, name=Dry",
        "Surface Interaction, name=oiled",
        "Change Friction, interaction=Dry",
    ):
        pair += f"*{card}\n*Friction\n {0.23 if card.endswith('name=Dry') else 0.4},\n"
    pair += "*Boundary"
    file.write_text(file.read_text().replace("*End Part", faces).replace("*Boundary", pair))
    message = printed_text(["new", str(file), "--out", str(tmp_path / "begun")], capsys)
    assert "Lower.Over and Upper.Under: 0 mm apart" in message
    (joint,) = scene_file.read(str(tmp_path / "begun/lap.toml")).scene.joints.values()
    assert (joint.group, joint.opposite, joint.friction) == ("Lower.Over", "Upper.Under", 0.23)
    assert "friction = 0.23  # of the deck" in (tmp_path / "begun/lap.toml").read_text()
    built = td.build(str(tmp_path / "begun/lap.toml"), overrides=("decks.lap.elements=quadratic",))
    assert len(built.part.interface.area) > 4  # the deck is found from there


@pytest.mark.parametrize("cards", ["Upper.Crown, Lower.Base", "Sole, Top\nUpper.Under, Lower.Over"])
def test_every_contact_pair_of_a_deck_is_taken_as_it_stands(tmp_path: Path, cards: str) -> None:
    """Faces far apart, and two pairs that share facets: `inspect` lists them, and so does `new`, before any guess."""
    file, sides = deck(tmp_path / "lap.inp"), {"Over": "S2", "Under": "S1", "Crown": "S2", "Base": "S1"}
    faces = "".join(f"*Surface, type=ELEMENT, name={name}\n 1, {side}\n" for name, side in sides.items()) + "*End Part"
    pairs = "*Contact Pair\n" + cards.replace("\n", "\n*Contact Pair\n") + "\n*Boundary"
    file.write_text(file.read_text().replace("*End Part", faces).replace("*Boundary", pairs))
    declared = sorted(sorted((one.first, one.second)) for one in draft(file).candidates if one.declared)
    names = cards.replace("Sole", "Upper.Sole").replace("Top", "Lower.Top").splitlines()
    assert declared == sorted(sorted(line.split(", ")) for line in names)


def test_a_group_that_bears_the_name_of_its_body_keeps_it_unless_another_has_it() -> None:
    assert group_name("A", "A.Top", ["A.Top"]) == "A.Top"
    assert group_name("A", "A.Top", ["A.Top", "Top"]) == "A.A.Top"
    assert group_name("A", "Top", ["A.Top", "Top"]) == "A.Top"
    assert group_name("", "Top", ["Top"]) == "Top"


def test_what_is_no_file_of_a_mesh_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    assert "no mesh, deck or CAD file" in refusal(["new", "beam"], capsys)


def test_the_smallest_scene_has_at_most_fifteen_lines() -> None:
    assert len([line for line in SMALLEST.splitlines() if line]) <= 15
    scene = scene_file.parse(SMALLEST, "small.toml", (), Path()).mesh_scene
    assert (scene.response.group, scene.response.direction) == ("shaker", (0.0, 1.0, 0.0))
    full = f'{SMALLEST}group = "response"\ndirection = "x"\n'
    assert scene_file.parse(full, "small.toml", (), Path()).mesh_scene.response.group == "response"


@pytest.mark.parametrize(("direction", "loose"), [("[0, 0, 1]", True), ("[0, 0, -1]", False)])
def test_a_contact_that_nothing_presses_is_said(direction: str, loose: bool) -> None:
    press = f'static = {{ press = {{ group = "contact", direction = {direction}, value = "1 kN" }} }}\n'
    sizes = ("geometry.n_patch=3", "geometry.n_length=4", "geometry.n_height=1")
    coarse = (*sizes, "reduction.modes=2", "harmonics.kept=[0, 1]")
    for text, message in (
        (SMALLEST, True),
        (SMALLEST.replace("[loads.harmonic]", f"[loads]\n{press}[loads.harmonic]"), loose),
    ):
        file = scene_file.parse(text, "small.toml", coarse, Path())
        items = list(sanity_checks.remarks(file, modelling.build(file, Progress())))
        assert any("nothing presses" in line for line in items) == message


def test_a_plan_draws_the_scene_with_its_contact_supports_and_loads(tmp_path, capsys):
    try:
        offscreen.check()
    except offscreen.RenderingUnavailable:
        pytest.skip("nothing can be rendered here")
    coarse = [word for key in ("n_patch=3", "n_length=3", "n_height=1") for word in ("--set", f"geometry.{key}")]
    message = printed_text(["plan", "beam", *coarse, "--picture", str(tmp_path / "beam.png")], capsys)
    assert "beam.png" in message
    with Image.open(tmp_path / "beam.png") as image:
        colours = np.asarray(image.convert("RGB"), int).reshape(-1, 3)
    for colour in (BLUE, RED):  # the contact and the harmonic load
        expected = [int(colour[i : i + 2], 16) for i in (1, 3, 5)]
        assert (np.abs(colours / 255 - np.array(expected) / 255).max(axis=1) < 0.25).sum() > 100
