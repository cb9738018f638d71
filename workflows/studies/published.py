"""Published numbers to stand beside a scene's own: NAME.published.toml beside the scene, where there is one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tribodyn.workflows.scene import scene_file
from tribodyn.workflows.scene.scene_file import SceneFile


@dataclass(frozen=True)
class PublishedBackbone:
    """A backbone of the same mode by others.

    source : who, in a few words; modal_amplitude : (n,) [m kg^0.5], rising; frequency : (n,) [Hz]; damping : (n,) ratio
    """

    source: str
    modal_amplitude: np.ndarray
    frequency: np.ndarray
    damping: np.ndarray


def published_backbone(file: SceneFile) -> PublishedBackbone | None:
    """The table [backbone] beside a scene, None where there is none; raises ValueError for one that is incomplete."""
    path = file.folder / f"{file.name}.published.toml"
    table = scene_file.tables(path, "published").get("backbone") if path.is_file() else None
    if table is None:
        return None
    try:
        columns = [np.array(table[name], float) for name in ("modal_amplitude", "frequency_hz", "damping")]
        source = str(table["source"])
    except (KeyError, TypeError, ValueError) as error:
        raise ValueError(f"{path}: [backbone] needs source, modal_amplitude, frequency_hz, damping") from error
    if len({len(c) for c in columns}) > 1 or len(columns[0]) < 2 or (np.diff(columns[0]) <= 0).any():
        raise ValueError(f"{path}: [backbone] needs columns of one length, modal_amplitude rising")
    return PublishedBackbone(source, *columns)
