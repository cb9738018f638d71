"""The report in a headless browser: no errors, curves answer, the part turns, the slider moves, two widths."""

import base64
import re
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import tribodyn as td
from tests.helpers.browser import DESK, PHONE, chromium, clicked_zoomed_and_turned, of_width, opened, until
from tests.helpers.synthetic_result import result
from tribodyn.workflows.pictures import plots, wear_plots
from tribodyn.workflows.report import page
from tribodyn.workflows.report.charts import solid
from tribodyn.workflows.result import faces

selenium = pytest.importorskip("selenium.webdriver")
__all__ = ["chromium"]


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A report of two results, without their figures, which other tests look at."""
    folder = tmp_path_factory.mktemp("report")
    patch = pytest.MonkeyPatch()
    patch.setattr(page, "_renders", lambda outcome: {})
    patch.setattr(plots, "figures", lambda outcome: {"preload": wear_plots.preload_against_cycles})
    first = result()
    second = replace(first, wear=replace(first.wear, preload=2 * first.wear.preload))
    path = page.write([("first", first, None), ("second", second, None)], folder / "report.html")
    patch.undo()
    return path


@pytest.fixture
def browser(chromium: Any, written: Path) -> Any:
    """The browser with the report of two results."""
    if chromium.current_url != written.as_uri():
        opened(chromium, written)
    return chromium


def test_the_page_needs_nothing_else(written: Path) -> None:
    text = written.read_text()
    assert written.stat().st_size < page.LARGEST
    base = text[: text.index("<script>")]
    assert not re.search(r'(src|href)="(?!data:|#)', base)
    for words in (
        "Side by side",
        "+100.00%",
        "measured changes",
        "SHA-256 of the scene",
        "tribodyn run beam",
        "contact lost",
    ):
        assert words.lower() in base.lower()


def test_no_error_in_the_console(browser: Any) -> None:
    bad = [entry for entry in browser.get_log("browser") if entry["level"] == "SEVERE"]
    assert not bad


def test_a_curve_tells_its_values_and_zooms(browser: Any) -> None:
    chart = browser.find_element("css selector", '[data-chart="Preload"]')
    browser.execute_script("arguments[0].scrollIntoView({block: 'center'})", chart)
    inputs = result().wear
    drawn = browser.execute_script("return arguments[0].data.map(t => [t.name, t.x, t.y])", chart)
    assert [trace[0] for trace in drawn] == ["first", "second"]
    np.testing.assert_allclose(drawn[0][2], inputs.preload, rtol=1e-6)
    np.testing.assert_allclose(drawn[1][2], 2 * inputs.preload, rtol=1e-6)
    browser.execute_script(
        "window.told = null; arguments[0].on('plotly_hover', e => { window.told = e.points[0].y; })", chart
    )
    plot = chart.find_element("css selector", ".nsewdrag")
    actions = selenium.ActionChains(browser)
    actions.move_to_element_with_offset(plot, -20, -10).move_by_offset(4, 4).perform()
    places = browser.execute_script(
        "const g = arguments[0], f = g._fullLayout; return [f.xaxis.c2p(g.data[0].x[4]), f.yaxis.c2p(g.data[0].y[4]),"
        " f.xaxis._length, f.yaxis._length]", chart,
    )  # fmt: skip
    x, y, width, height = places
    selenium.ActionChains(browser).move_to_element_with_offset(
        plot, int(x - width / 2), int(y - height / 2)
    ).move_by_offset(1, 0).perform()
    until(browser, "return window.told !== null", 20)
    assert browser.execute_script("return window.told") == pytest.approx(inputs.preload[4], rel=1e-6)
    before = browser.execute_script("return arguments[0]._fullLayout.xaxis.range", chart)
    selenium.ActionChains(browser).move_to_element(plot).click_and_hold().move_by_offset(90, 40).release().perform()
    until(browser, "return true", 1)
    after = browser.execute_script("return arguments[0]._fullLayout.xaxis.range", chart)
    assert after[1] - after[0] < 0.7 * (before[1] - before[0])


def test_the_part_turns_under_the_mouse(browser: Any) -> None:
    plot = browser.find_element("css selector", "#part-0 .solid")
    browser.execute_script("arguments[0].scrollIntoView({block: 'center'})", plot)
    eye = "return Object.values(arguments[0]._fullLayout.scene._scene.getCamera().eye)"
    before = browser.execute_script(eye, plot)
    selenium.ActionChains(browser).move_to_element(plot).click_and_hold().move_by_offset(120, 30).release().perform()
    time.sleep(0.5)
    assert np.linalg.norm(np.subtract(browser.execute_script(eye, plot), before)) > 0.1


def test_the_slider_shows_the_depth_of_every_state(browser: Any) -> None:
    section = browser.find_element("css selector", "#part-0")
    inputs = result()
    depths = []
    for row in (0, 4, 8):
        browser.execute_script(
            "const s = arguments[0].querySelector('.state'); s.value = arguments[1];"
            "s.dispatchEvent(new Event('input'))", section, row,
        )  # fmt: skip
        face = "return arguments[0].querySelector('.solid').data.find(t => t.name === 'face 1').intensity"
        depths.append(browser.execute_script(face, section))
    np.testing.assert_allclose(depths, 1e6 * inputs.wear.depth[[0, 4, 8]], rtol=1e-4)
    browser.execute_script(
        "const s = arguments[0].querySelector('.field'); s.value = 'status'; s.dispatchEvent(new Event('change'))",
        section,
    )
    assert "slip-separation" in section.find_element("css selector", ".legend").text


@pytest.mark.parametrize("width", [PHONE, DESK])
def test_nothing_is_wider_than_the_window(width: int, browser: Any, tmp_path: Path) -> None:
    """At the width of a phone and of a desk."""
    of_width(browser, width)
    time.sleep(0.5)
    assert browser.execute_script("return document.documentElement.scrollWidth") <= width
    smallest = browser.execute_script(
        "return Math.min(...[...document.querySelectorAll('td, p, label')]"
        ".map(e => parseFloat(getComputedStyle(e).fontSize)))"
    )
    assert smallest >= 12
    browser.save_screenshot(str(tmp_path / "page.png"))
    assert (tmp_path / "page.png").stat().st_size > 10_000
    browser.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})


SMALL = {
    "beam": ("harmonics.kept=[0, 1]", "wear.tolerance=2 %", "wear.at=peak", "wear.motion=machine", "geometry.n_patch=3",
        "geometry.n_length=2", "geometry.n_height=1", "reduction.modes=3", "response.points=6", "wear.tolerance=20 %",
        "wear.max_steps=4"),
    "leaf_seal": ("harmonics.kept=[0, 1]", "geometry.n_column=7", "geometry.pin_column=2", "response.points=6"),
    "blade": ("geometry.n_along=2", "geometry.n_up=2", "response.points=8", "wear.step=20 %", "wear.max_steps=3"),
    "rig": ("geometry.n_contact_length=3", "geometry.n_contact_width=3", "reduction.modes=4", "harmonics.kept=[0, 1]",
        "wear.max_steps=2"),
}  # fmt: skip


# one part that wears, as the blade
LIKE_OTHERS = ("beam", "leaf_seal", "rig")


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=pytest.mark.slow) if name in LIKE_OTHERS else name for name in SMALL]
)
def test_the_report_of_each_case_is_clicked_zoomed_and_turned(name, chromium, tmp_path, monkeypatch):
    """A small run of each scene that comes along; those of the other cases are in their own tests."""
    result = td.run(name, overrides=(*SMALL[name], "verdict.enabled=false"))
    clicked_zoomed_and_turned(chromium, name, result, tmp_path, monkeypatch)


def test_it_prints(browser: Any) -> None:
    printed = browser.execute_cdp_cmd("Page.printToPDF", {"printBackground": True})
    assert base64.b64decode(printed["data"]).startswith(b"%PDF")


def test_worn_vertices_of_the_page_are_those_of_the_part() -> None:
    inputs = result()
    data = solid(inputs)
    state = data["states"][-1]
    shifted = np.zeros((3, len(data["body"]["xyz"][0])))
    shifted[:] = data["body"]["xyz"]
    for n, place in zip(*state["moved"], strict=True):
        shifted[:, n] = place
    refined = inputs.part.points + data["factor"] * faces.worn_off(
        faces.meetings_of(inputs), inputs.wear.depth[-1], len(inputs.part.points)
    )
    distance = np.linalg.norm(1e3 * refined[:, None] - shifted.T[None], axis=2).min(axis=0)
    assert distance.max() < 1e-3
