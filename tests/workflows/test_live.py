"""A run in a notebook draws a plot that it updates as it goes."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from IPython.core.displaypub import CapturingDisplayPublisher
from IPython.core.interactiveshell import InteractiveShell

import tribodyn as td
from tribodyn.workflows.pictures.live import drawn

SMALL = {
    "geometry.n_patch": 3, "geometry.n_length": 2, "geometry.n_height": 1, "reduction.modes": 3,
    "harmonics.kept": [0, 1],
    "response.points": 12, "wear.at": "peak", "wear.motion": "balance", "wear.max_steps": 4, "verdict.enabled": False,
}  # fmt: skip


@pytest.fixture
def published() -> Any:
    """What cells of a notebook have shown, in the messages that a notebook gets."""
    shell = InteractiveShell.instance()
    shell.display_pub = CapturingDisplayPublisher()
    yield shell.display_pub.outputs
    InteractiveShell.clear_instance()


def test_a_plot_appears_and_is_updated_during_a_run(published: list[dict[str, Any]]) -> None:
    result = td.run("beam", overrides=SMALL, progress=td.plot.Live(interval=0))
    plots = [message for message in published if (message.get("transient") or {}).get("display_id")]
    by_plot: dict[str, list[bool]] = {}
    for message in plots:
        by_plot.setdefault(message["transient"]["display_id"], []).append(bool(message.get("update")))
    response, wear = by_plot.values()
    for updates in (response, wear):
        assert updates == [False, *[True] * (len(updates) - 1)]
    assert len(response) >= 12
    assert len(wear) == result.wear_steps + 2  # the first drawing, one for each step, the last


def test_the_plot_shows_the_points_of_the_curve() -> None:
    (line,) = (axes := drawn("frequency response", [(2 * np.pi * 100.0, 2e-6)]).axes[0]).lines
    assert (line.get_xdata(), line.get_ydata()) == (pytest.approx([100.0]), pytest.approx([2.0]))
    assert axes.get_ylabel() == "amplitude / µm"


def test_outside_of_a_notebook_nothing_is_drawn(capsys: pytest.CaptureFixture[str]) -> None:
    with td.plot.Live(interval=0).track("frequency response") as advance:
        advance(1.0, "", (2 * np.pi * 100.0, 2e-6))
    assert "Figure" not in capsys.readouterr().out
