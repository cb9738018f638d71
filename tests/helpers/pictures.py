"""Whether a picture shows anything."""

from pathlib import Path

import numpy as np
from PIL import Image


def assert_not_blank(path: Path) -> None:
    with Image.open(path) as image:
        assert min(image.size) > 200
        picture = np.asarray(image.convert("RGB"), np.int64)[::2, ::2]
    assert np.mean(np.any(picture < 230, axis=-1)) > 0.005
    assert len(np.unique(picture @ (65536, 256, 1))) > 20
