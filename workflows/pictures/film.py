"""Films of a result: its contact over wear, and its part and contact over one cycle of a state.

Camera, factors of exaggeration and colour scales are the same in all images of a film. MP4 is written by the encoder
that comes with imageio-ffmpeg, GIF by Pillow.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Sequence
from contextlib import ExitStack
from os import PathLike
from pathlib import Path
from typing import Any, Literal, Protocol

import matplotlib as mpl
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch as Swatch
from PIL import Image

from tribodyn.extras import package
from tribodyn.hbm.contact.contact_law import SEPARATES, SLIPS, STICKS
from tribodyn.refusal import Refusal
from tribodyn.workflows.pictures import opened as book
from tribodyn.workflows.pictures.figures import (
    force_unit,
    heading,
    length_unit,
    pressure_unit,
    scale_bar,
    status_legend,
    status_name,
)
from tribodyn.workflows.pictures.offscreen import check
from tribodyn.workflows.pictures.plots import cycle_axis, loop_of, loop_size
from tribodyn.workflows.pictures.render import MovingPart
from tribodyn.workflows.pictures.shots import shoot, show, with_room
from tribodyn.workflows.pictures.theme import (
    BLUE,
    INK,
    LAYOUT,
    MOTION_MAP,
    ORANGE,
    PRESSURE_MAP,
    RED,
    STATUS,
    STYLE,
    WEAR_MAP,
)
from tribodyn.workflows.pictures.view import wear_scale
from tribodyn.workflows.result.faces import Meeting
from tribodyn.workflows.result.result import Result
from tribodyn.workflows.result.states import State, instant_status, over_a_cycle, shown_cycles, shown_states, state_of

FORMATS = ("mp4", "gif")
ROOT = 1 / 3  # power of the scale of pressure: the first pressures are many times the last
PANELS = ("depth", "status", "pressure")
AT_ONCE = (STICKS, SLIPS, SEPARATES)  # what a pair can do at an instant


class Filmed(Protocol):
    """A figure that shows one image of a film after the other."""

    figure: Figure

    @property
    def count(self) -> int: ...
    def show(self, number: int) -> None: ...


def film(
    result: Result,
    folder: str | PathLike[str],
    over: Literal["wear", "cycle"],
    row: int | None = None,
    formats: Sequence[str] = ("mp4",),
    images: int = LAYOUT.images,
    dpi: int = LAYOUT.film_dpi,
    deformation: float | None = None,
    wear: float | None = None,
) -> list[Path]:
    """Write a film of a result into a folder, named wear or cycle_ROW; returns its paths.

    over : "wear" shows depth, status and pressure of the opened contact at the wear steps; "cycle" shows part and
        status by pair over one cycle of a state
    row : of the wear history, or point of the response, whose cycle is shown; that whose contact works most by default
    dpi : dots per inch; a film is 12.8 by 7.2 inches
    deformation, wear : factors by which displacement and depth are exaggerated, chosen by size where None
    Raises  ValueError: the result has nothing of the kind to show; RenderingUnavailable
    """
    if images < 2:
        raise Refusal(f"a film of {images} images: ask for 2 at least")
    if not 20 <= dpi <= 400:
        raise Refusal(f"--dpi {dpi}: give a film 20 to 400 dots per inch")
    if over not in ("wear", "cycle"):
        raise Refusal(f'no film over "{over}": take wear or cycle')
    check()
    made = WearFilm(result, images, wear) if over == "wear" else CycleFilm(result, row, images, deformation, wear)
    place = Path(folder)
    place.mkdir(parents=True, exist_ok=True)
    return encode(drawn(made, dpi), place / made.name, formats)


def drawn(made: Filmed, dpi: int = LAYOUT.film_dpi) -> Iterator[np.ndarray]:
    """The images (height, width, 3) of a film, all with the layout of the first."""
    with mpl.rc_context(STYLE):
        canvas = FigureCanvasAgg(made.figure)
        made.figure.set_dpi(dpi)
        for number in range(made.count):
            made.show(number)
            canvas.draw()
            if number == 0:
                made.figure.set_layout_engine("none")
            yield np.asarray(canvas.buffer_rgba())[..., :3].copy()


def encode(images: Iterable[np.ndarray], stem: Path, formats: Sequence[str]) -> list[Path]:
    """Write a film in some formats, each image drawn once.

    images : (height, width, 3), 8 bits a colour, all of one size
    Returns the paths. Raises ValueError: a format that is not known, or no encoder for MP4
    """
    for name in formats:
        if name not in FORMATS:
            raise Refusal(f'no film format "{name}": take {" or ".join(FORMATS)}')
    paths = {name: stem.with_name(f"{stem.name}.{name}") for name in dict.fromkeys(formats)}
    kept, rate = [], LAYOUT.rate
    flow = (image[: image.shape[0] // 2 * 2, : image.shape[1] // 2 * 2] for image in images)  # even, as MP4 needs it
    first = next(flow)
    with ExitStack() as stack:
        send = _encoder(paths["mp4"], first, rate, stack) if "mp4" in paths else None
        for image in itertools.chain([first], flow):
            if send is not None:
                send(np.ascontiguousarray(image))
            if "gif" in paths:
                kept.append(Image.fromarray(image))
    if kept:
        pages = [image.quantize(dither=Image.Dither.NONE) for image in kept]
        # hundredths of a second are the unit of the format
        pages[0].save(
            paths["gif"], save_all=True, append_images=pages[1:], duration=10 * max(round(100 / rate), 2), loop=0
        )
    return list(paths.values())


def _encoder(path: Path, first: np.ndarray, rate: float, stack: ExitStack) -> Any:
    """What takes the images of an MP4, closed with the stack."""
    height, width = first.shape[:2]
    writer = package("imageio_ffmpeg").write_frames(
        str(path), (width, height), fps=rate, codec="libx264", quality=None, macro_block_size=2,
        output_params=["-crf", "20", "-movflags", "+faststart"],
    )  # fmt: skip
    stack.callback(writer.close)
    writer.send(None)
    return writer.send


class WearFilm:
    """A film over wear: its figure, and how a state gets into it.

    images : wear states at the most, evenly chosen among the rows that curves show
    wear : factor by which the depth is exaggerated, chosen by size where None
    Raises  ValueError where the result has no worn contact with faces
    """

    def __init__(self, result: Result, images: int, wear: float | None = None):
        patch, history = result.patch, result.wear
        if history is None or not result.wear_steps or not book.contacts(result):
            raise Refusal("the result holds no worn contact with faces: there is no film over wear")
        last = int(np.flatnonzero(history.cycles <= shown_cycles(history))[-1])
        rows = np.unique(np.linspace(0, last, images).round().astype(int))
        self.contact = book.opened(result, _most_worn(result, rows))
        self.states = [self.contact.own(state_of(result, int(row))) for row in rows]
        depth = np.stack([state.depth for state in self.states])
        self._pressure_top = max(float(_pressure(state).max()) for state in self.states)
        self._depth_top = float(depth.max())
        self.scale = wear or wear_scale(self.contact.contact.patch, depth)
        with mpl.rc_context(STYLE):
            self.figure = Figure(figsize=LAYOUT.film, layout="constrained")
            halves: Any = self.figure.subfigures(2, 1, height_ratios=[1.8, 1])
            upper, lower = halves
            self._panels = dict(zip(PANELS, upper.subplots(1, 3), strict=True))
            present = {int(bits) for s in self.states if s.status is not None for bits in s.status}
            status_legend(upper, present, patch.components)
            self._bars(upper)
            self._marks = _curves(result, lower.subplots(1, 3), rows)
            heading(self.figure, result, f"wear of the {self.contact.sides}, relief × {self.scale:g}")
            self._start()

    @property
    def count(self) -> int:
        """Number of images."""
        return len(self.states)

    @property
    def name(self) -> str:
        """Name of the film's files."""
        return "wear"

    def show(self, number: int) -> None:
        """Put a state into the figure."""
        state = self.states[number]
        for name, axes in self._panels.items():
            image = np.full(axes.images[0].get_array().shape, 255, np.uint8)
            image[: LAYOUT.film_contact[1]] = self._shot(state, name)
            axes.images[0].set_data(image)
        self._panels["depth"].set_title(state.label)
        for mark, x, y in self._marks:
            mark.set_data(x[number : number + 1], y[number : number + 1])

    def _start(self) -> None:
        images, corner = with_room([self._shot(self.states[-1], name) for name in PANELS])
        for axes, image in zip(self._panels.values(), images, strict=True):
            show(axes, image, self.contact.camera, book.AXES, corner)
            axes.set_title(" ")

    def _shot(self, state: State, name: str) -> np.ndarray:
        view = self.contact.view(state.depth, self.scale, self._paint(state, name))
        return shoot(view, self.contact.camera, LAYOUT.film_contact)

    def _paint(self, state: State, name: str) -> book.Paint:
        if name == "status":
            return book.StatusPaint(np.zeros(len(state.depth), int) if state.status is None else state.status)
        if name == "depth":
            return book.FieldPaint(state.depth, (0.0, self._depth_top), WEAR_MAP)
        return book.FieldPaint(np.maximum(_pressure(state), 0) ** ROOT, (0.0, self._pressure_top**ROOT), PRESSURE_MAP)

    def _bars(self, figure: Any) -> None:
        unit, factor = length_unit(self._depth_top)
        scale_bar(figure, self._panels["depth"], WEAR_MAP, 0, factor * self._depth_top, f"total wear depth / {unit}")
        unit, factor = pressure_unit(self._pressure_top)
        most, label = factor * self._pressure_top, f"mean pressure / {unit}"
        scale_bar(figure, self._panels["pressure"], PRESSURE_MAP, 0, most, label, ROOT)


def _most_worn(result: Result, rows: np.ndarray) -> Meeting:
    """The contact that has lost most volume in the last of some rows."""
    patch, wear = result.patch, result.wear
    assert wear is not None
    volume = wear.depth[rows[-1]] * patch.area
    return max(book.contacts(result), key=lambda one: float(volume[one.pairs].sum()))


def _pressure(state: State) -> np.ndarray:
    return np.zeros(len(state.depth)) if state.pressure is None else state.pressure


def _curves(result: Result, panels: Any, rows: np.ndarray) -> list[tuple[Any, np.ndarray, np.ndarray]]:
    """Depth, amplitude and preload against cycles, each with a mark; returns mark, x and y of the rows."""
    wear = result.wear
    assert wear is not None
    depth, found = wear.depth.max(axis=1), []
    (unit_d, d), (unit_a, a) = length_unit(depth.max()), length_unit(wear.amplitude.max())
    unit_f, f = force_unit(wear.preload.max())
    for axes, label, values, color in zip(
        panels,
        (f"largest total depth / {unit_d}", f"amplitude / {unit_a}", f"preload / {unit_f}"),
        (d * depth, a * wear.amplitude, f * wear.preload),
        (BLUE, ORANGE, BLUE),
        strict=True,
    ):
        scale = cycle_axis(axes, wear)
        axes.plot(scale * wear.cycles, values, color=color)
        axes.set_ylabel(label)
        axes.locator_params(axis="x", nbins=5)
        mark = axes.plot([], [], "o", color=RED, ms=7, zorder=5)[0]
        found.append((mark, scale * wear.cycles[rows], values[rows]))
    panels[1].set_yscale("log" if wear.amplitude.max() > 30 * wear.amplitude.min() > 0 else "linear")
    return found


class CycleFilm:
    """A film over one cycle of a state: its figure, and how an instant gets into it.

    row : of the wear history, or point of the response; that whose contact works most where None
    count : of images, evenly over the period
    deformation, wear : factors by which displacement and depth are exaggerated, chosen by size where None
    Raises  ValueError where nothing is kept of the cycle
    """

    def __init__(
        self, result: Result, row: int | None, count: int, deformation: float | None = None, wear: float | None = None
    ):
        loops, patch = result.loops, result.patch
        if loops is None:
            raise Refusal("the result keeps no cycle of a contact: its scene needs pictures.plots = true")
        states = {state.number: state for state in shown_states(result) if state.number in loops.row.tolist()}
        if row is None:
            row = int(loops.row[np.argmax(loop_size(result).sum(axis=(1, 2)))])
        if row not in states:
            raise Refusal(f"the result keeps no cycle of row {row}: it has those of {', '.join(map(str, states))}")
        self.state, self.count = states[row], count
        at = loops.row.tolist().index(row)
        self._status = instant_status(result, at)
        size = loop_size(result)[at]
        busiest, component = (int(index) for index in np.unravel_index(int(np.argmax(size)), size.shape))
        self._loop = loop_of(result, at, busiest, component)
        shown = [one for one in book.contacts(result) if busiest in range(*one.pairs.indices(len(patch.area)))]
        self._contact = book.opened(result, shown[0]) if shown else None
        self._moving = None
        if self.state.field is not None and result.part is not None and len(patch.faces):
            self._moving = MovingPart(result, deformation, wear)
            _, moved = over_a_cycle(result, self.state.field, count)
            self._vibration = moved - moved.mean(axis=0)
            self._factor = self._moving.vibration_scale(self._moving.swing(self.state))
            self._top = float(self._moving.amplitude(self.state).max())
        self._wear = self._moving.wear if self._moving is not None else wear or 1.0
        with mpl.rc_context(STYLE):
            self.figure = Figure(figsize=LAYOUT.film, layout="constrained")
            self._draw(result)

    @property
    def name(self) -> str:
        """Name of the film's files."""
        return f"cycle_{self.state.number}"

    def show(self, number: int) -> None:
        """Put an instant into the figure."""
        sample = number * self._status.shape[1] // self.count
        for axes, image in zip(self._panels, self._shots(number, sample), strict=True):
            padded = np.full(axes.images[0].get_array().shape, 255, np.uint8)
            padded[: LAYOUT.film_part[1]] = image
            axes.images[0].set_data(padded)
        x, force = self._loop.displacement, self._loop.force
        self._mark.set_data(x[sample : sample + 1], force[sample : sample + 1])
        share = number / self.count
        self._now.set_xdata([share, share])
        self._clock.set_text(f"{share:.2f} of the period")

    def _draw(self, result: Result) -> None:
        views = [name for name, there in (("part", self._moving), ("contact", self._contact)) if there is not None]
        if views:
            halves: Any = self.figure.subfigures(2, 1, height_ratios=[1.9, 1])
            upper, lower = halves
            self._panels = list(np.atleast_1d(upper.subplots(1, len(views))))
            self._start(upper, views)
        else:
            lower, self._panels = self.figure.subfigures(1, 1), []
        left, right = lower.subplots(1, 2, width_ratios=[1, 1.6])
        self._draw_loop(left)
        self._draw_status(right, result)
        hertz = "" if result.wear is None else f", {self.state.omega / (2 * np.pi):.4g} Hz"
        heading(self.figure, result, f"one cycle, {self.state.label}{hertz}")
        self._clock = self.figure.text(0.99, 0.985, "", ha="right", va="top")

    def _start(self, figure: Any, views: list[str]) -> None:
        for axes, name, image in zip(self._panels, views, self._shots(0, 0), strict=True):
            (shown,), corner = with_room([image])
            if name == "part" and self._moving is not None:
                show(axes, shown, self._moving.camera, "xyz", corner)
                unit, factor = length_unit(self._top)
                label = f"distance from the mean position / {unit}"
                scale_bar(figure, axes, MOTION_MAP, 0.0, factor * self._top, label)
                axes.set_title(self._moving.factors(self._factor))
            elif self._contact is not None:
                show(axes, shown, self._contact.camera, book.AXES, corner)
                axes.set_title(f"opened {self._contact.sides}")

    def _shots(self, number: int, sample: int) -> list[np.ndarray]:
        found = []
        if self._moving is not None:
            vibration = self._vibration[number]
            points = self._moving.points(self.state, self._factor * vibration)
            values = np.linalg.norm(vibration, axis=1)
            view = self._moving.view(points, values, (0.0, self._top))
            found.append(self._moving.marked(shoot(view, self._moving.camera, LAYOUT.film_part), points))
        if self._contact is not None:
            own = self._contact.own(self.state)
            paint = book.StatusPaint(self._status[self._contact.contact.pairs, sample])
            view = self._contact.view(own.depth, self._wear, paint)
            found.append(shoot(view, self._contact.camera, LAYOUT.film_part))
        return found

    def _draw_loop(self, axes: Any) -> None:
        x, force = self._loop.displacement, self._loop.force
        axes.plot(np.append(x, x[0]), np.append(force, force[0]), color=BLUE)
        self._mark = axes.plot([], [], "o", color=RED, ms=7, zorder=5)[0]
        axes.set_xlabel(self._loop.along)
        axes.set_ylabel(self._loop.label)
        axes.locator_params(nbins=5)

    def _draw_status(self, axes: Any, result: Result) -> None:
        """Status of every pair over the period, pairs in the order of their contact."""
        patch = result.patch
        colors = [STATUS[bits][1] for bits in AT_ONCE]
        norm = BoundaryNorm([0.5, 1.5, 3.0, 5.0], 3)
        axes.imshow(
            self._status, aspect="auto", cmap=ListedColormap(colors), norm=norm, interpolation="nearest",
            extent=(0, 1, len(self._status) - 0.5, -0.5),
        )  # fmt: skip
        self._now = axes.axvline(0, color=INK)
        axes.grid(False)
        axes.set_xlabel("share of the period")
        axes.set_ylabel("contact pair")
        present = [bits for bits in AT_ONCE if (self._status == bits).any()]
        swatches = [Swatch(facecolor=STATUS[b][1], label=status_name(b, patch.components)) for b in present]
        axes.legend(handles=swatches, loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=3)
