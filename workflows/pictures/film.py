"""Films of a result: its contact over wear, and its part and contact over one cycle of a state.

Camera, factors of exaggeration and colour scales are the same in all images of a film. MP4 is written by the encoder
that comes with imageio-ffmpeg, GIF by Pillow."""

import itertools
from collections.abc import Iterable, Iterator, Sequence
from contextlib import ExitStack
from os import PathLike
from pathlib import Path
from typing import Any, Literal, Protocol

import numpy as np

from tribodyn.extras import package
from tribodyn.refusal import Refusal
from tribodyn.workflows.pictures.cycle_film import CycleFilm
from tribodyn.workflows.pictures.matplotlib_names import Figure, FigureCanvasAgg, Image, mpl
from tribodyn.workflows.pictures.offscreen import check
from tribodyn.workflows.pictures.theme import LAYOUT, STYLE
from tribodyn.workflows.pictures.wear_film import WearFilm
from tribodyn.workflows.result.result import Result

FORMATS = ("mp4", "gif")


class FilmFigure(Protocol):
    """A figure that shows one image of a film after the other."""

    figure: Figure

    @property
    def count(self) -> int: ...
    def show(self, number: int) -> None: ...


def film(
    result: Result, folder: str | PathLike[str], over: Literal["wear", "cycle"], row: int | None = None,
    formats: Sequence[str] = ("mp4",), images: int = LAYOUT.images, dpi: int = LAYOUT.film_dpi,
    deformation: float | None = None, wear: float | None = None,
) -> list[Path]:  # fmt: skip
    """Write a film of a result into a folder, named wear or cycle_ROW; returns its paths.

    over : "wear" shows depth, status and pressure of the opened contact at the wear steps; "cycle" shows part and
        status by pair over one cycle of a state
    row : of the wear history, or point of the response, whose cycle is shown; that whose contact works most by default
    dpi : dots per inch; a film is 12.8 by 7.2 inches
    deformation, wear : factors by which displacement and depth are exaggerated, chosen by size where None
    Raises  Refusal: the result has nothing of the kind to show; RenderingUnavailable"""
    if images < 2:
        raise Refusal(f"a film of {images} images: ask for 2 at least")
    if not 20 <= dpi <= 400:
        raise Refusal(f"--dpi {dpi}: give a film 20 to 400 dots per inch")
    if over not in ("wear", "cycle"):
        raise Refusal(f'no film over "{over}": take wear or cycle')
    check()
    new_film = WearFilm(result, images, wear) if over == "wear" else CycleFilm(result, row, images, deformation, wear)
    place = Path(folder)
    place.mkdir(parents=True, exist_ok=True)
    return encode(drawn(new_film, dpi), place / new_film.name, formats)


def drawn(film: FilmFigure, dpi: int = LAYOUT.film_dpi) -> Iterator[np.ndarray]:
    """The images (height, width, 3) of a film, all with the layout of the first."""
    with mpl.rc_context(STYLE):
        canvas = FigureCanvasAgg(film.figure)
        film.figure.set_dpi(dpi)
        for number in range(film.count):
            film.show(number)
            canvas.draw()
            if number == 0:
                film.figure.set_layout_engine("none")
            yield np.asarray(canvas.buffer_rgba())[..., :3].copy()


def encode(images: Iterable[np.ndarray], stem: Path, formats: Sequence[str]) -> list[Path]:
    """Write a film in some formats, each image drawn once.

    images : (height, width, 3), 8 bits a colour, all of one size
    Returns the paths. Raises Refusal: a format that is not known, or no encoder for MP4"""
    for name in formats:
        if name not in FORMATS:
            raise Refusal(f'no film format "{name}": take {" or ".join(FORMATS)}')
    paths = {name: stem.with_name(f"{stem.name}.{name}") for name in dict.fromkeys(formats)}
    gif_images, rate = [], LAYOUT.rate
    flow = (image[: image.shape[0] // 2 * 2, : image.shape[1] // 2 * 2] for image in images)  # even, as MP4 needs it
    first = next(flow)
    with ExitStack() as stack:
        send = _encoder(paths["mp4"], first, rate, stack) if "mp4" in paths else None
        for image in itertools.chain([first], flow):
            if send is not None:
                send(np.ascontiguousarray(image))
            if "gif" in paths:
                gif_images.append(Image.fromarray(image))
    if gif_images:
        pages = [image.quantize(dither=Image.Dither.NONE) for image in gif_images]
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
