"""Every function of the reference of Python has an example; all of them run."""

import inspect
import re
import sys
from pathlib import Path
from typing import Any

import pytest

import tribodyn as td

FILE = Path(__file__).parents[2] / "docs" / "reference" / "examples.py"
GRIDS = {
    "td.studies.trade",
    "td.studies.converge",
    "td.studies.replay",
}  # take minutes: shown in the table of reference/python.md
WHEELS = {"td.wheel.flutter"}  # takes minutes: shown in flutter.md


def functions() -> set[str]:
    """Every function of the front door and its modules, as `td.plot.response`."""
    result = set()
    for place in (td, td.plot, td.studies, td.wheel, td.matrices):
        short = place.__name__.replace("tribodyn", "td")
        ours = {name: getattr(place, name) for name in dir(place) if not name.startswith("_")}
        result |= {f"{short}.{name}" for name, item in ours.items() if inspect.isfunction(item)}
    return result


def test_every_function_has_an_example() -> None:
    shown = set(re.findall(r"^# (td\.[\w.]+)$", FILE.read_text(encoding="utf-8"), re.MULTILINE))
    assert functions() - shown <= GRIDS | WHEELS
    assert shown <= functions()


@pytest.mark.slow
def test_the_examples_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    space: dict[str, Any] = {"__name__": "examples"}
    exec(compile(FILE.read_text(encoding="utf-8"), str(FILE), "exec"), space)
    assert space["balance"].solve(300.0).amplitude("tip") > 0
    assert "tribodyn" in sys.modules
