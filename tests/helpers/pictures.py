"""Whether a picture shows anything."""

from __future__ import annotations

from pathlib import Path

import matplotlib.image
import numpy as np


def assert_not_blank(path: Path) -> None:
    picture = matplotlib.image.imread(path)[..., :3]
    assert min(picture.shape[:2]) > 200
    assert np.mean(np.any(picture < 0.9, axis=-1)) > 0.005
    assert len(np.unique((picture * 255).astype(int).reshape(-1, 3), axis=0)) > 20
