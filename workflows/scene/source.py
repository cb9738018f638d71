"""Scenes as a caller gives them: by name, path, tables or read before, with changes of keys."""

from collections.abc import Mapping, Sequence
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

from tribodyn.refusal import Refusal
from tribodyn.workflows.scene import scene_file
from tribodyn.workflows.scene.scene_file import SceneFile

Source = SceneFile | str | PathLike[str] | Mapping[str, Any]
"""A scene: one that was read, a name that `scene_names` lists, the path of a .toml file, or its tables as a dict."""

AnyPath = str | PathLike[str]
"""A file or a folder."""

Overrides = Sequence[str] | Mapping[str, Any]
"""Changes of keys: ["wear.step=5 %"] or {"wear.step": "5 %"}; None takes a key out."""


def read_scene(source: Source, overrides: Overrides = (), *, folder: str | PathLike[str] | None = None) -> SceneFile:
    """Read and check a scene; quantities are numbers in SI units or texts with a unit, such as "20 kN".

    source : name, path of a .toml file, tables as a dict, or a scene that was read before
    overrides : keys to change, on top of those that the scene has
    folder : where relative file names of a dict begin, the current folder by default
    Raises  SceneError: one sentence that names the key and what is expected"""
    texts = override_texts(overrides)
    if isinstance(source, SceneFile):
        return scene_file.parse(source.text, f"{source.name}.toml", (*source.overrides, *texts), source.folder)
    if isinstance(source, Mapping):
        text = tomli_w.dumps(_plain(source))
        return scene_file.parse(text, "scene.toml", texts, Path(folder or ".").resolve())
    return scene_file.read(str(source), texts)


def override_texts(overrides: Overrides) -> tuple[str, ...]:
    """Changes of keys as the texts "section.key=value" of the command line."""
    if isinstance(overrides, str):
        raise Refusal(f'overrides is "{overrides}": give a list of texts "section.key=value" or a dict')
    if not isinstance(overrides, Mapping):
        return tuple(overrides)
    return tuple(
        f"{key}=" if value is None else f"{key}={_on_one_line(tomli_w.dumps({'v': _plain(value)}).partition('=')[2])}"
        for key, value in overrides.items()
    )


def _on_one_line(toml: str) -> str:
    """An array over several lines as one: results keep a change in each line."""
    return " ".join(line.strip() for line in toml.strip().splitlines())


def _plain(value: Any) -> Any:
    """A value as TOML has it: arrays as lists, paths as texts; keys whose value is None are left out."""
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items() if item is not None}
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    if isinstance(value, (np.ndarray, np.generic)):
        return value.tolist()
    return str(value) if isinstance(value, PathLike) else value
