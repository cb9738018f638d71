"""Films from images: MP4 by the encoder that comes with imageio-ffmpeg, GIF by Pillow."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

FORMATS = ("mp4", "gif")
COLOURS = 256  # of an image of a GIF, the most that it can have: small patches of status keep their colours


def write(images: Iterable[np.ndarray], stem: Path, formats: Sequence[str], rate: float) -> list[Path]:
    """Write a film in some formats, each image drawn once.

    images : (height, width, 3), 8 bits a colour, all of one size; rate : images per second
    Returns the paths. Raises ValueError: a format that is not known, or no encoder for MP4
    """
    for name in formats:
        if name not in FORMATS:
            raise ValueError(f'no film format "{name}": take {" or ".join(FORMATS)}')
    paths = {name: stem.with_name(f"{stem.name}.{name}") for name in dict.fromkeys(formats)}
    kept = []
    flow = _even(images)
    first = next(flow)
    with ExitStack() as stack:
        send = _encoder(paths["mp4"], first, rate, stack) if "mp4" in paths else None
        for image in itertools.chain([first], flow):
            if send is not None:
                send(np.ascontiguousarray(image))
            if "gif" in paths:
                kept.append(Image.fromarray(image))
    if kept:
        pages = [image.quantize(COLOURS, dither=Image.Dither.NONE) for image in kept]
        # hundredths of a second are the unit of the format
        pages[0].save(
            paths["gif"], save_all=True, append_images=pages[1:], duration=10 * max(round(100 / rate), 2), loop=0
        )
    return list(paths.values())


def _even(images: Iterable[np.ndarray]) -> Iterator[np.ndarray]:
    """Images of even width and height, which the encoder needs."""
    for image in images:
        yield image[: image.shape[0] // 2 * 2, : image.shape[1] // 2 * 2]


def _encoder(path: Path, first: np.ndarray, rate: float, stack: ExitStack) -> Any:
    """What takes the images of an MP4, closed with the stack."""
    try:
        import imageio_ffmpeg
    except ImportError:
        raise ValueError(
            'mp4 needs the package imageio-ffmpeg: install it with pip install "imageio-ffmpeg", or take gif'
        ) from None
    height, width = first.shape[:2]
    writer = imageio_ffmpeg.write_frames(
        str(path), (width, height), fps=rate, codec="libx264", quality=None, macro_block_size=2,
        output_params=["-crf", "20", "-movflags", "+faststart"],
    )  # fmt: skip
    stack.callback(writer.close)
    writer.send(None)
    return writer.send
