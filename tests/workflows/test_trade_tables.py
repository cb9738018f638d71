"""Tables of trades: those that come with the program are of their scenes, and a stale one is told what has changed."""

from __future__ import annotations

import os
from pathlib import Path
from types import SimpleNamespace

import pytest

from tribodyn.workflows.accuracy import accuracy, trade_table
from tribodyn.workflows.accuracy.measure import measure
from tribodyn.workflows.result import store
from tribodyn.workflows.run import checkpoint, description
from tribodyn.workflows.scene import scene_file


def test_tables_that_come_with_the_program_can_be_read() -> None:
    for path in scene_file.CASES.glob("*/*.trade.json"):
        trade = trade_table.load(path)
        assert trade.scene == path.name.removesuffix(".trade.json")
        assert trade.rows


@pytest.mark.parametrize("name", ["beam", "blade", "leaf_seal", "rig"])
def test_tables_that_come_with_the_program_are_of_their_scenes(name: str) -> None:
    file = scene_file.read(name)
    assert accuracy.table_of(file, accuracy.beside(file)).scene == name


CHEAP = {"leaf_seal": ("newton",), "beam": ("nodes",), "blade": ("krylov",), "rig": ("modes",)}


@pytest.mark.parametrize("name", CHEAP)
def test_rows_of_the_tables_that_come_with_the_program_are_found_anew(name: str) -> None:
    """The cheapest rows of some knobs: where they move, the table has to be measured again."""
    table = accuracy.table_of(scene_file.read(name), accuracy.beside(scene_file.read(name)))
    for knob in CHEAP[name]:
        row = min(table.of(knob), key=lambda one: one.seconds)
        found = measure(scene_file.read(name, (*table.base, *row.overrides)), wears=False)
        for quantity in ("peak_hz", "peak_m", "energy_J", "preload_N"):
            if row.values[quantity] is None:
                continue
            assert found.values[quantity] == pytest.approx(row.values[quantity], rel=1e-5), f"{knob}: {quantity}"


def test_a_table_is_told_what_has_changed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The content of a file under the same name, a key of the scene, the program."""
    text, heights = (scene_file.CASES / "beam" / "beam_thesis.toml").read_text(), tmp_path / "heights.csv"
    (tmp_path / "own.toml").write_text(text + '\n[surfaces]\nfirst = "heights.csv"\ncutoff = "1 mm"\n')
    heights.write_text("0.0, 0.0, 1e-6\n")
    path, word = tmp_path / "own.trade.json", str(tmp_path / "own.toml")
    trade_table.save(trade_table.Trade.begun(scene_file.read(word), (), 1.0), path)
    assert list(accuracy.table_of(scene_file.read(word), path).files) == ["heights.csv"]
    with pytest.raises(ValueError, match=r"another scene than this own, contact\.friction differs: measure it again"):
        accuracy.table_of(scene_file.read(word, ["contact.friction=0.7"]), path)
    with monkeypatch.context() as patch:
        patch.setattr(trade_table, "code", lambda: "other")
        with pytest.raises(ValueError, match="by another version of the program"):
            accuracy.table_of(scene_file.read(word), path)
    resumed = SimpleNamespace(provenance=description.provenance(scene_file.read(word)))
    monkeypatch.setattr(store, "load", lambda path: resumed)
    assert checkpoint.earlier(path, scene_file.read(word)) is resumed
    heights.write_text("0.0, 0.0, 2e-6\n")
    os.utime(heights, (0, 0))  # both may be written within one tick of the clock
    with pytest.raises(ValueError, match=r"was computed with another content of heights\.csv: run the scene without"):
        checkpoint.earlier(path, scene_file.read(word))
    with pytest.raises(ValueError, match=r"with another content of heights\.csv"):
        accuracy.table_of(scene_file.read(word), path)


def test_the_key_of_a_table_is_made_of_what_the_scene_says_other_than_by_default() -> None:
    """A default written out, a knob or a picture is the same scene; a number that moves the answers is another one."""
    key = trade_table.key_of(scene_file.read("beam"))
    assert key.startswith(f"{trade_table.KEY_VERSION}-")
    for same in ("response.bounds=false", "harmonics.samples=256", "wear.max_steps=3", "pictures.plots=false"):
        assert trade_table.key_of(scene_file.read("beam", (same,))) == key
    for other in ("response.bounds=true", "loads.harmonic.shake.value='1 N'"):
        assert trade_table.key_of(scene_file.read("beam", (other,))) != key
    assert trade_table.key_of(scene_file.read("beam", ("wear=",))) != key
