"""Every picture is drawn and is not blank; geometry of the pictures is checked where it carries meaning."""

from dataclasses import replace
from pathlib import Path
from typing import Literal

import imageio_ffmpeg
import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection, TriMesh
from matplotlib.colors import to_rgb, to_rgba
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from PIL import Image

from tests.helpers.pictures import assert_not_blank
from tests.helpers.synthetic_result import result
from tribodyn.workflows.pictures import (
    film,
    loop_plots,
    maps,
    offscreen,
    plots,
    render,
    response_plots,
    view,
    wear_plots,
)
from tribodyn.workflows.pictures.film import CycleFilm, WearFilm
from tribodyn.workflows.pictures.theme import LAYOUT, MOTION_MAP, RED, STATUS
from tribodyn.workflows.result.contact_states import shown_states

COARSE = 60  # dots per inch: what is drawn is the same, in a tenth of the time


def test_curves_and_maps(tmp_path: Path) -> None:
    written = plots.draw(result(), tmp_path, dpi=COARSE)
    of_wear = {"cycles_per_step", "peak", "preload", "depth", "energy", "status", "status_maps"}
    assert {path.stem for path in written} == of_wear | {"frf", "hysteresis", "patch"}
    for path in written:
        assert_not_blank(path)


def drawn(figure: Figure) -> list[np.ndarray]:
    """Heights of all lines of a figure, without those that only stand in a legend."""
    heights = (np.asarray(line.get_ydata(), float) for axes in figure.axes for line in axes.lines)
    return [values[np.isfinite(values)] for values in heights if len(values)]


def test_curves_show_the_numbers_of_the_result() -> None:
    inputs = result()
    frf, wear, loops = inputs.response, inputs.wear, inputs.loops

    def has(figure: Figure, wanted: np.ndarray) -> bool:
        return any(len(line) == len(wanted) and np.allclose(line, wanted, rtol=1e-12) for line in drawn(figure))

    curve = response_plots.response(inputs)
    for height in (inputs.references.free, inputs.references.stuck, wear.amplitude):
        assert has(curve, 1e3 * height)
    stretches = np.concatenate(drawn(curve))
    assert np.isin(1e3 * frf.amplitude("response"), stretches).all()  # stable and unstable ones, point by point
    mean = wear.depth @ inputs.patch.area / inputs.patch.area.sum()  # type: ignore[union-attr]
    for height in (wear.depth.max(axis=1), wear.depth.min(axis=1), mean):
        assert has(wear_plots.wear(inputs, "depth"), 1e3 * height)
    assert has(wear_plots.wear(inputs, "preload"), 1e-3 * wear.preload)
    assert has(wear_plots.wear(inputs, "preload"), 1e-3 * wear.preload_at_rest)
    assert has(wear_plots.wear(inputs, "peak"), wear.omega / (2 * np.pi))
    assert has(wear_plots.wear(inputs, "cycles_per_step"), 1e-6 * wear.cycles_in_step[:-1])
    pair = 3
    for at, loop in enumerate(drawn(loop_plots.hysteresis(inputs, [pair]))):
        force = loops.force[at, pair]
        assert any(np.allclose(loop, np.append(item, item[0])) for item in force)


def test_maps_show_the_numbers_of_the_result() -> None:
    inputs = result()
    figure = maps.patch_maps(inputs, [4])
    fields = [shown.get_array() for axes in figure.axes for shown in axes.collections if isinstance(shown, TriMesh)]
    pressure = inputs.wear.normal_force[4] / inputs.patch.area  # type: ignore[union-attr]
    for shown, expected in zip(fields, (1e3 * inputs.wear.depth[4], 1e-6 * pressure), strict=True):
        np.testing.assert_allclose(shown, expected, rtol=1e-12)
    (statuses,) = (shown for axes in figure.axes for shown in axes.collections if isinstance(shown, PolyCollection))
    colors = {to_rgba(STATUS[int(bits)][1]) for bits in inputs.wear.status[4]}
    assert {tuple(color) for color in statuses.get_facecolor()} == colors


def test_a_response_alone_is_drawn_too(tmp_path: Path) -> None:
    written = plots.draw(replace(result(), wear=None, fields=None, loops=None), tmp_path, dpi=COARSE)
    assert [path.stem for path in written] == ["frf"]
    assert_not_blank(written[0])


def test_renders(tmp_path: Path) -> None:
    """The part has the colours of its scale and the outline of its contact, the contact those of its statuses."""
    inputs = result()
    paths = {path.stem: path for path in render.draw(inputs, tmp_path, dpi=100)}
    assert set(paths) == {"part", "contact", "stress"}
    assert inputs.wear is not None
    ends = [to_rgb(mpl.colormaps[MOTION_MAP](end)) for end in (0.02, 0.5, 0.98)]
    status = {STATUS[int(bits)][1] for state in shown_states(inputs) for bits in np.asarray(state.status)}
    for name, colors in (("part", [*ends, to_rgb(RED)]), ("contact", [to_rgb(color) for color in status])):
        with Image.open(paths[name]) as image:
            pixels = np.asarray(image.convert("RGB"), int).reshape(-1, 3)
        for color in colors:
            nearby = np.abs(pixels - np.round(255 * np.array(color))).max(axis=1) < 12
            assert nearby.sum() > 20, f"{name} has no {color}"


def test_missing_libraries_are_said_in_a_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(offscreen, "PROBE", "import os; os.abort()")
    with pytest.raises(offscreen.RenderingUnavailable, match=r"install the system libraries .*libegl1"):
        offscreen.check()


def test_shares_of_the_patch_have_the_area_of_its_faces() -> None:
    patch = result().patch
    corners, pair = patch.shares(patch.flat)
    x, y = corners[..., 0], corners[..., 1]
    area = 0.5 * np.abs(np.sum(x * np.roll(y, -1, 1) - np.roll(x, -1, 1) * y, axis=1))
    assert area.sum() == pytest.approx(0.05 * 0.02)
    assert set(pair) == set(range(len(patch.area)))


def test_swing_is_the_largest_vibration_over_the_cycle() -> None:
    displacement = np.zeros((2, 3, 3))
    displacement[1, 2] = [5.0, 3.0, 4.0]
    assert np.abs(view.swing(displacement, (0, 1))[1, 2]) == pytest.approx(5.0, rel=2e-3)  # 64 instants of a cycle
    assert not view.swing(displacement, (0, 1))[0].any()
    assert view.at_rest(displacement, (0, 1))[1, 2] == 5.0


def test_swing_is_that_of_the_harmonics_kept() -> None:
    """cos t - cos 3t reaches 1.54, cos t - cos 2t would reach 2."""
    displacement = np.zeros((1, 3, 4))
    displacement[0, 0] = [1.0, 0.0, -1.0, 0.0]  # without harmonic 0
    assert np.abs(view.swing(displacement, (1, 3))[0, 0]) == pytest.approx(8 / 27**0.5, rel=5e-3)
    assert not view.at_rest(displacement, (1, 3)).any()


@pytest.mark.parametrize(("value", "nice"), [(1.0, 1.0), (1.99, 1.0), (2.0, 2.0), (7.0, 5.0), (0.3, 0.2), (5e3, 5e3)])
def test_factors_are_round(value: float, nice: float) -> None:
    assert view.nice(value) == nice


def test_bodies_that_slide_at_rest_are_drawn_into_each_other_by_a_tenth_of_the_thinnest():
    """A beam of 1 m that bends by 1 mm, and a bolt of 10 mm that is pulled 20 um along it."""
    cube = np.array(np.meshgrid([0, 1], [0, 1], [0, 1])).reshape(3, -1).T
    beam, bolt = cube * [1.0, 0.02, 0.02], cube * [0.01, 0.01, 0.05]
    points, body = np.concatenate([beam, bolt]), np.repeat([0, 1], 8)
    static = np.zeros((1, 16, 3))
    static[0, beam[:, 0].argmax(), 2], static[0, beam[:, 0].argmin(), 2] = 1e-3, -1e-3
    assert view.rest_scale(static, points, body) == view.deformation_scale(static, 1.0) == 50.0
    static[0, 8:, 2] = -20e-6
    assert view.rest_scale(static, points, body) == 50.0  # 1 mm, a tenth of the bolt
    static[0, 8:, 2] = -200e-6
    assert view.rest_scale(static, points, body) == 5.0
    assert view.rest_scale(static[:, :8], beam, body[:8]) == 50.0  # one body


@pytest.mark.parametrize("over", ["wear", "cycle"])
def test_a_film_is_written_whole(over: Literal["wear", "cycle"], tmp_path: Path) -> None:
    paths = {path.suffix: path for path in film.film(result(), tmp_path, over, formats=("mp4", "gif"), images=3)}
    assert {path.stem for path in paths.values()} == {"wear" if over == "wear" else "cycle_8"}
    counted, seconds = imageio_ffmpeg.count_frames_and_secs(str(paths[".mp4"]))
    assert counted == 3
    assert seconds == pytest.approx(3 / LAYOUT.rate, rel=0.01)
    with Image.open(paths[".gif"]) as gif:
        assert gif.n_frames == 3
        pages = []
        for number in range(3):
            gif.seek(number)
            pages.append(np.asarray(gif.convert("RGB"), int))
    reader = imageio_ffmpeg.read_frames(str(paths[".mp4"]))
    width, height = next(reader)["size"]
    shown = [np.frombuffer(image, np.uint8).reshape(height, width, 3).astype(int) for image in reader]
    for page, image in zip(pages, shown, strict=True):  # both show the same
        assert page.shape == image.shape
        assert np.abs(page - image).mean() < 4
    assert np.abs(pages[2] - pages[0]).mean() > 0.05  # and something moves


def test_colours_and_camera_of_a_film_are_those_of_its_largest_values() -> None:
    """The last depth reaches the end of the scale, and the same depth has the same colour in every image."""
    inputs = result()
    wear_film = WearFilm(inputs, 2)
    wear_film.show(0)
    bars = [axes for axes in wear_film.figure.findobj(Axes) if "wear depth" in axes.get_xlabel()]
    assert bars[0].get_xlim() == (0.0, pytest.approx(1e3 * inputs.wear.depth.max()))
    # the view of the unworn contact in the first image is what is drawn for it alone with the same camera
    repeated = WearFilm(inputs, 3)
    repeated.show(0)
    views = [[view.get_array() for view in each.figure.findobj(AxesImage)] for each in (wear_film, repeated)]
    assert len(views[0]) == 3
    for first, second in zip(*views, strict=True):
        assert np.abs(first.astype(int) - second.astype(int)).mean() < 0.01


def test_a_cycle_is_drawn_at_its_instants() -> None:
    """Mark, line of time and status belong to one instant."""
    inputs = result()
    cycle_film = CycleFilm(inputs, 0, 4)
    cycle_film.show(3)
    samples = inputs.loops.force.shape[-1]
    lines = [line for axes in cycle_film.figure.findobj(Axes) for line in axes.lines]
    loop = next(line for line in lines if len(line.get_xdata()) == samples + 1)
    mark = next(line for line in lines if line.get_marker() == "o")
    at = 3 * samples // 4
    assert (mark.get_xdata()[0], mark.get_ydata()[0]) == (loop.get_xdata()[at], loop.get_ydata()[at])
    assert [line.get_xdata()[0] for line in lines if len(line.get_xdata()) == 2] == [0.75]
    with pytest.raises(ValueError, match="no cycle of row 3: it has those of 0, 4, 8"):
        CycleFilm(inputs, 3, 4)


def test_a_result_without_wear_has_no_film_over_it() -> None:
    with pytest.raises(ValueError, match="no worn contact with faces"):
        WearFilm(replace(result(), wear=None), 3)
