"""`tribodyn curve backbone`: from the stuck to the free mode of a small beam, and what is refused."""

import csv
import json
from pathlib import Path

import numpy as np
import pytest

from tests.helpers.command import leave, refusal
from tribodyn.reduction.linear import linear_modes
from tribodyn.workflows.pictures.maps import slide_and_gap
from tribodyn.workflows.run import modelling
from tribodyn.workflows.run.progress import Progress
from tribodyn.workflows.scene.scene_file import read
from tribodyn.workflows.studies.curves import backbones

SMALL = [
    "harmonics.kept=[0, 1]", "geometry.n_patch=3", "geometry.n_length=4", "geometry.n_height=1", "reduction.modes=4",
]  # fmt: skip
SET = [word for override in SMALL for word in ("--set", override)]


def test_the_backbone_goes_from_the_stuck_to_the_free_mode(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    model = modelling.build(read("beam", SMALL), Progress())
    free = linear_modes(model.reduced, n=1)[0][0]
    code, out, err = leave(
        ["curve", "backbone", "beam", *SET, "--from", "0.01um", "--to", "10mm", "--out", str(tmp_path), "--json"],
        capsys,
    )
    assert code == 0, err
    record = json.loads(out)
    assert record["end"] == "reached the amplitude asked for"
    assert record["frequency_hz"][0] == pytest.approx(record["reference_hz"], rel=1e-4)
    assert record["frequency_hz"][-1] == pytest.approx(free, rel=2e-3)
    assert max(record["damping"]) > 10 * record["damping"][0]  # friction peaks where the contact begins to slide
    assert record["damping"][-1] < 0.1 * max(record["damping"])
    with (tmp_path / "backbone.csv").open(encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    assert np.array([float(row["frequency_hz"]) for row in rows]) == pytest.approx(np.array(record["frequency_hz"]))
    assert (tmp_path / "backbone.png").is_file()
    code, out, _ = leave(
        ["curve", "backbone", "beam", *SET, "--from", "1um", "--to", "4um", "--points", "5", "--out", str(tmp_path)],
        capsys,
    )
    assert code == 0
    assert "at rest" in out


def test_slide_and_gap_of_the_cycles_along_a_backbone_are_those_of_its_motion() -> None:
    computed = backbones.backbone("beam", 1e-7, 2e-4, points=6, overrides=SMALL).mode
    balance, slides = modelling.build(read("beam", SMALL), Progress()).balance, []
    for contact in computed.contact:
        x = balance.shaped(contact)
        slide, gap = slide_and_gap(balance.model.interface.components, x, balance.basis, balance.contact.gap)
        phase = np.linspace(0, 2 * np.pi, 721)
        shifted = x[:, :, 1, None] * np.cos(phase) + x[:, :, 2, None] * np.sin(phase)  # harmonics 0 and 1
        np.testing.assert_allclose(slide, np.hypot(shifted[:, 0], shifted[:, 1]).max(axis=1), rtol=5e-3)
        widest = balance.contact.gap - x[:, 2, 0] - shifted[:, 2].min(axis=1)
        np.testing.assert_allclose(gap, widest, atol=5e-3 * np.abs(shifted).max())
        slides.append(slide.max())
    assert slides[-1] > 100 * slides[0]


@pytest.mark.parametrize(("arguments", "words"), [
    (["--from", "1", "--to", "1mm"], "--from: expected"),
    (["--from", "1mm", "--to", "1mm"], "must be > 0 and differ"),
    (["--from", "1um", "--to", "1mm", "--mode", "-1"], "mode"),
])  # fmt: skip
def test_what_cannot_be_is_refused(arguments, words, capsys, tmp_path):
    assert words in refusal(["curve", "backbone", "beam", *SET, *arguments, "--out", str(tmp_path)], capsys)
