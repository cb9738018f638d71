"""Published numbers to stand beside a scene's own: NAME.published.toml beside the scene, where there is one."""

from __future__ import annotations

import tomllib

from tribodyn.workflows.scene.scene_file import SceneFile

WearStep = tuple[int, int, float, float]
"""Wear iterations, seconds, largest depth [mm], its error against the finest step."""


def published_wear_steps(file: SceneFile) -> dict[float, WearStep]:
    """Published wear runs by the largest depth of a step over delta_max; empty where the scene has none beside it."""
    path = file.folder / f"{file.name}.published.toml"
    if not path.is_file():
        return {}
    rows = tomllib.loads(path.read_text(encoding="utf-8")).get("wear_step", [])
    return {float(r["step"]): (r["wear_steps"], r["seconds"], r["depth_mm"], r["depth_error"]) for r in rows}
