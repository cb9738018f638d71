"""Films of a result: its contact over wear, and its part and contact over one cycle of a state.

Camera, factors of exaggeration and colour scales are the same in all images of a film. They are written by the encoder
that comes with imageio-ffmpeg."""

from collections.abc import Sequence
from contextlib import ExitStack
from os import PathLike
from pathlib import Path
from typing import Literal

from tribodyn.extras import package
from tribodyn.refusal import Refusal
from tribodyn.workflows.pictures.cycle_film import CycleFilm
from tribodyn.workflows.pictures.matplotlib_names import FFMpegWriter, mpl
from tribodyn.workflows.pictures.offscreen import check
from tribodyn.workflows.pictures.theme import LAYOUT, STYLE
from tribodyn.workflows.pictures.wear_film import WearFilm
from tribodyn.workflows.result.result import Result

FORMATS = ("mp4", "gif")


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
    return encode(new_film, place / new_film.name, formats, dpi)


def encode(film: WearFilm | CycleFilm, stem: Path, formats: Sequence[str], dpi: int = LAYOUT.film_dpi) -> list[Path]:
    """Write a film in some formats, all images with the layout of the first; its paths.

    Raises  Refusal: a format that is not known, or no encoder"""
    if unknown := [name for name in formats if name not in FORMATS]:
        raise Refusal(f'no film format "{unknown[0]}": take {" or ".join(FORMATS)}')
    paths = [stem.with_name(f"{stem.name}.{name}") for name in dict.fromkeys(formats)]
    encoder = {"animation.ffmpeg_path": package("imageio_ffmpeg").get_ffmpeg_exe()}
    with mpl.rc_context({**STYLE, **encoder}), ExitStack() as stack:
        writers = []
        for path in paths:
            quality = ["-pix_fmt", "yuv420p", "-crf", "20", "-movflags", "+faststart"] if path.suffix == ".mp4" else []
            writers.append(FFMpegWriter(fps=LAYOUT.rate, codec="h264", extra_args=quality))
            stack.enter_context(writers[-1].saving(film.figure, path, dpi))
        for number in range(film.count):
            film.show(number)
            if number == 0:
                film.figure.draw_without_rendering()
                film.figure.set_layout_engine("none")
            for writer in writers:
                writer.grab_frame()
    return paths
