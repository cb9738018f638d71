"""A headless Chromium, and what a reader does in a report: the tests of several cases share it."""

import os
import shutil
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tribodyn.workflows.pictures import plots, response_plots
from tribodyn.workflows.report import page
from tribodyn.workflows.result.result import Result

PHONE, DESK = 390, 1280  # pixels of width
CHROMIUM = next(
    (path for name in ("chromium", "chromium-browser", "google-chrome") if (path := shutil.which(name))), None
)


@pytest.fixture(scope="module")
def chromium() -> Iterator[Any]:
    """A headless Chromium, cut off from any network."""
    selenium = pytest.importorskip("selenium.webdriver")
    if CHROMIUM is None:
        if os.environ.get("TRIBODYN_BROWSER") == "required":
            pytest.fail("no Chromium on this machine: apt-get install chromium chromium-driver")
        pytest.skip("no Chromium on this machine")
    options = selenium.ChromeOptions()
    options.binary_location = CHROMIUM
    for word in (
        "--headless=new", "--no-sandbox", "--disable-dev-shm-usage",
        "--enable-unsafe-swiftshader", "--use-angle=swiftshader",
        "--window-size=1280,1000", "--host-resolver-rules=MAP * ~NOTFOUND", "--force-device-scale-factor=1",
    ):  # fmt: skip
        options.add_argument(word)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    driver = selenium.Chrome(options=options, service=selenium.ChromeService(shutil.which("chromedriver")))
    driver.set_script_timeout(120)
    yield driver
    driver.quit()


def opened(driver: Any, path: Path) -> None:
    """Open a report and wait until it is drawn."""
    driver.get(path.as_uri())
    until(driver, "return window.reportReady === true")


def until(driver: Any, script: str, seconds: float = 90.0) -> None:
    """Wait until a script returns true."""
    end = time.monotonic() + seconds
    while not driver.execute_script(script):
        assert time.monotonic() < end, script
        time.sleep(0.2)


def drag(driver: Any, element: Any, right: int, down: int) -> None:
    """Move the mouse over an element with its button held."""
    from selenium.webdriver import ActionChains

    mouse = ActionChains(driver, duration=60)  # ms of a move
    mouse.move_to_element(element).click_and_hold().move_by_offset(right, down).release().perform()


def becomes(driver: Any, script: str, element: Any, wanted: Callable[[Any], bool]) -> bool:
    """Whether what a script tells of an element is as wanted within some seconds."""
    end = time.monotonic() + 10.0
    while not (good := wanted(driver.execute_script(script, element))) and time.monotonic() < end:
        time.sleep(0.05)
    return good


def of_width(driver: Any, width: int) -> None:
    """Give the page a width; by the protocol, because windows have a least width."""
    size = {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": width < 600}
    driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)


def clicked_zoomed_and_turned(
    driver: Any, name: str, result: Result, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Do with the report of a result what a reader does; without its figures but one, which are looked at elsewhere."""
    from selenium.webdriver.common.keys import Keys
    from selenium.webdriver.support.select import Select

    monkeypatch.setattr(page, "_renders", lambda outcome: {})
    monkeypatch.setattr(plots, "figures", lambda outcome: {"frf": response_plots.response})
    path = page.write([(name, result, None)], folder / f"{name}.html")
    assert path.stat().st_size < page.LARGEST
    opened(driver, path)
    charts = driver.find_elements("css selector", ".chart")
    assert len(charts) >= (1 if result.wear is None else 6)
    for chart in charts:
        driver.execute_script("arguments[0].scrollIntoView({block: 'center'})", chart)
        shown = "const r = arguments[0]._fullLayout.xaxis.range.map(Number); return r[1] - r[0]"
        narrower = 0.8 * driver.execute_script(shown, chart)
        drag(driver, chart.find_element("css selector", ".nsewdrag"), 80, 5)
        zoomed = becomes(driver, shown, chart, lambda now, narrower=narrower: now < narrower)
        assert zoomed, chart.get_attribute("data-chart")
    entries = charts[0].find_elements("css selector", ".legendtoggle")
    if entries:  # a single curve has none
        visible = "return arguments[0].data.map(t => String(t.visible))"
        observed = driver.execute_script(visible, charts[0])
        entries[0].click()
        assert becomes(driver, visible, charts[0], lambda now: now != observed)
    solid = driver.find_element("css selector", "#part-0 .solid")
    driver.execute_script("arguments[0].scrollIntoView({block: 'center'})", solid)
    eye = "return Object.values(arguments[0]._fullLayout.scene._scene.getCamera().eye)"
    before = driver.execute_script(eye, solid)
    drag(driver, solid, 120, 30)
    assert becomes(driver, eye, solid, lambda now: np.linalg.norm(np.subtract(now, before)) > 0.1)
    slider = driver.find_element("css selector", "#part-0 .state")
    label = driver.find_element("css selector", "#part-0 .label")
    first, several = label.text, slider.get_attribute("max") != "0"
    slider.send_keys(Keys.HOME)
    assert (label.text != first) == several
    Select(driver.find_element("css selector", "#part-0 .field")).select_by_visible_text("status")
    until(driver, "return document.querySelector('#part-0 .legend').textContent !== ''", 20)
    opener = driver.find_elements("css selector", "#part-0 .open")
    if opener:  # several bodies: they come apart
        places = "const p = arguments[0].data[0]; return [p.x, p.y, p.z]"
        together = driver.execute_script(places, solid)
        opener[0].click()
        until(driver, "return document.querySelector('#part-0 .open').checked", 20)
        distance = driver.execute_script(places, solid)
        assert np.ptp(np.subtract(distance, together), axis=1).max() > 1.0  # mm
    assert not [entry for entry in driver.get_log("browser") if entry["level"] == "SEVERE"]
    for width in (PHONE, DESK):
        of_width(driver, width)
        until(driver, f"return document.documentElement.scrollWidth <= {width}", 15)  # charts follow the width
    driver.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})
