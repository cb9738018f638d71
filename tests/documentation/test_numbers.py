"""Numbers and names that stand in pages and come from data or code are the same in both."""

from __future__ import annotations

import pkgutil
import re

import pytest

from tests.helpers.pages import ROOT
from tribodyn import hbm
from tribodyn.workflows.accuracy import accuracy, trade_table
from tribodyn.workflows.scene import scene_file

PAGE = (ROOT / "docs/accuracy/measured.md").read_text(encoding="utf-8")


def test_the_map_of_the_solver_names_every_module() -> None:
    named = re.findall(r"\w+", (hbm.__doc__ or "").partition("\n")[2])
    for module in pkgutil.iter_modules(hbm.__path__):
        assert named.count(module.name) >= 1, module.name


def test_the_readme_says_what_the_trade_of_the_beam_says() -> None:
    """Errors of the scene's own settings; all others together would be a sum, each is below one per cent."""
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    table = trade_table.load(accuracy.beside(scene_file.read("beam")))

    def errors(knob: str, row: int) -> list[float]:
        return [100 * accuracy.error_of(table.of(knob), row, quantity) for quantity in QUANTITIES]

    rows = (
        ("harmonics 0..1", "harmonics", 0),
        ("harmonics 0..3", "harmonics", 1),
        ("contact grid of 5", "contact_grid", 0),
        ("friction in each", "friction", 0),
    )
    for label, knob, row in rows:
        (line,) = [line for line in readme.splitlines() if line.startswith(f"| {label}")]
        said = [float(number) for number in re.findall(r"([\d.]+) %", line)]
        assert said == pytest.approx(errors(knob, row), rel=0.06), label
    own = {"fe_mesh": 1, "modes": 2, "samples": 3, "newton": 2, "points": 6}
    for knob, row in own.items():
        known = [q for q in QUANTITIES if table.of(knob)[row].errors[q] is not None]
        assert all(100 * accuracy.error_of(table.of(knob), row, quantity) < 1 for quantity in known), knob
    assert "FE mesh, modes, samples, Newton tolerance, points, each | below 1 %" in readme


QUANTITIES = ("peak_m", "energy_J", "life_cycles")
LABELS = {
    "FE mesh": "fe_mesh", "contact grid": "contact_grid", "vertex nodes only": "nodes", "modes": "modes",
    "interface rank": "interface_rank", "harmonics 0..1": "harmonics", "32 ... 256 samples": "samples",
    "uncoupled friction": "friction", "Newton": "newton", "points": "points", "wear tolerance": "wear",
    "thesis's wear step": "wear_thesis",
}  # fmt: skip
COLUMNS = (
    *((scene, quantity) for scene in ("beam", "blade") for quantity in ("peak_m", "energy_J", "life_cycles")),
    ("leaf_seal", "peak_m"), *(("rig", quantity) for quantity in ("peak_hz", "energy_J", "life_cycles")),
)  # fmt: skip


def test_the_table_of_errors_says_what_the_trades_say() -> None:
    """The coarsest and the finest setting that leaves an error, to the digits that are printed."""
    tables = {name: trade_table.load(accuracy.beside(scene_file.read(name))) for name, _ in COLUMNS}
    _, _, below = PAGE.partition("| | beam: amplitude | beam: energy |")
    lines = below.split("\n\n")[0].splitlines()[2:]
    assert len(lines) == len(LABELS)
    for line in lines:
        label, *cells = (cell.strip() for cell in line.strip("|").split("|"))
        (knob,) = {LABELS[start] for start in LABELS if label.startswith(start)}
        for (scene, quantity), cell in zip(COLUMNS, cells, strict=True):
            rows = tables[scene].of(knob)
            known = [i for i, row in enumerate(rows) if row.errors[quantity] is not None]
            errors = [error for i in known if (error := accuracy.error_of(rows, i, quantity)) > 0]
            said = [float(number) for number in re.findall(r"[\d.]+(?:e-\d+)?(?=$|[ ,])", cell) if number != "..."]
            where = f"{label}: {scene}, {quantity}: {cell}"
            if not errors:
                assert not said, where
                continue
            for number, error in zip((said[0], said[-1]), (errors[0], errors[-1]), strict=True):
                assert number == pytest.approx(100 * error, rel=0.06), where
