"""`tribodyn inspect`: facts of files and scenes for people and machines, and a remark on what is off by a thousand."""

import json
from pathlib import Path

import numpy as np
import pytest

from tests.helpers import foreign_files
from tests.helpers.command import leave
from tribodyn.workflows.studies import inspection

LAP = Path(__file__).parents[1] / "geometry" / "decks" / "lap.inp"


def said(capsys, *words):
    return leave(["inspect", *map(str, words)], capsys)


def test_a_deck_for_machines(capsys):
    code, out, _ = said(capsys, LAP, "--unit", "mm", "--modes", "14", "--free", "--elements", "quadratic", "--json")
    assert not code
    record = json.loads(out)
    assert record["mass_kg"] == pytest.approx(2 * 2e-6 * 7850)
    assert record["volume_m3"] == pytest.approx(4e-6)
    np.testing.assert_allclose(record["size_m"], [0.03, 0.02, 0.02])
    np.testing.assert_allclose(record["centre_m"], [0.0025, 0.0075, 0.01], atol=1e-9)
    assert set(record["bodies"]) == {"Block-1", "Block-2"}
    assert record["groups"]["Upper"] == {"area_m2": pytest.approx(2e-4), "nodes": 15}
    assert record["worst_element"]["scaled_jacobian"] == pytest.approx(1.0)
    assert any("*PLASTIC" in clause for clause in record["unused"])
    assert record["gaps"] == {}
    assert record["frequencies_hz"][:12] == [0.0] * 12
    assert record["frequencies_hz"][12] == pytest.approx(record["frequencies_hz"][13], rel=1e-6)  # equal blocks
    assert record["remarks"] == []


def test_units_that_slipped_are_remarked(capsys, tmp_path):
    _, out, _ = said(capsys, LAP)
    assert "30 m long, as a mesh in millimetres read in metres" in out
    bar = foreign_files.write(foreign_files.bricks(tmp_path), tmp_path / "bar.inp", "")
    remarks = " ".join(inspection.inspect(bar, young=210.0, density=7.86).remarks)
    assert "density of body 'BAR' = 7.86 kg/m3 is unusual" in remarks
    assert "young of body 'BAR' = 210 Pa is unusual (1e+09 to 1.3e+12 Pa): check it and its unit" in remarks
    assert inspection.inspect(bar, young=210e6, density=7860.0).remarks != ()
    assert inspection.inspect(bar, young=210e9, density=7860.0).remarks == ()


def test_a_scene_with_the_deflection_that_deserves_a_remark(capsys):
    coarse = ("harmonics.kept=[0, 1]", "geometry.n_patch=5", "geometry.n_length=4", "geometry.n_height=1")
    words = [word for text in coarse for word in ("--set", text)]
    code, out, _ = said(capsys, "beam", *words, "--modes", "2", "--json")
    assert not code
    record = json.loads(out)
    assert record["mass_kg"] == pytest.approx(0.6288)
    assert record["gaps"] == {"contact": {"least_m": 0.0, "largest_m": 0.0}}
    assert record["frequencies_hz"] == pytest.approx([416.5, 416.5], rel=2e-2)
    assert "more than a linear model describes" in record["remarks"][0]


@pytest.mark.parametrize(("words", "sentence"), [
    (("nowhere.inp",), "does not exist"),
    ((LAP, "--unit", "parsec"), "is no length that is known"),
    ((LAP, "--unit", "mm", "--young", "210GPa"), "go together"),
    ((LAP, "--unit", "mm", "--modes", "-1"), "give a number of modes"),
    (("beam", "--unit", "mm"), "are for files"),
    (("nothing",), "there is no scene"),
])  # fmt: skip
def test_what_cannot_be_inspected_is_one_sentence(capsys, words, sentence):
    code, out, err = said(capsys, *words)
    assert code == 2
    assert sentence in err
    assert err.count("\n") == 1
    assert out == ""


@pytest.mark.parametrize(("off", "remarked"), [(0.0, False), (0.2, True), (1.0, True), (-0.3, True)])
def test_how_the_faces_of_a_tie_meet_is_told(tmp_path, off, remarked):
    place = "          0.,           0.,          10.\n          0.,"
    path = tmp_path / "lap.inp"
    path.write_text(
        LAP.read_text().replace(place, f"0., -10., {10.0 + off}\n 0.,").replace("tolerance=0.5", "tolerance=2")
    )
    inspected = inspection.inspect(path, unit="mm")
    (pair,) = inspected.pairs.values()
    assert pair["area_m2"] == pytest.approx(2e-4)
    assert pair["shared_m2"] == pytest.approx(1e-4, rel=1e-6)
    assert pair["least_m"] == pytest.approx(1e-3 * off, abs=1e-9)
    assert pair["largest_m"] == pytest.approx(1e-3 * off, abs=1e-9)
    assert pair["angle_deg"] == pytest.approx(0.0, abs=1e-5)
    assert any("the faces of tie" in remark for remark in inspected.remarks) is remarked
    assert not inspected.refused


def test_a_tie_that_shares_nothing_is_refused(tmp_path):
    path = tmp_path / "lap.inp"
    path.write_text(
        LAP.read_text().replace("*Instance, name=Block-2, part=Block\n", "*Instance, name=Block-2, part=Block\n5., ")
    )
    inspected = inspection.inspect(path, unit="mm")
    assert not inspected.pairs
    assert any("glue" in sentence for sentence in inspected.refused)
