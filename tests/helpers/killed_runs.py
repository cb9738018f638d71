"""A run in a process of its own that can be killed: without the imports, which the server has done before."""

from __future__ import annotations

from pathlib import Path

from tribodyn.workflows.result import store
from tribodyn.workflows.run import checkpoint, pipeline
from tribodyn.workflows.run.progress import Progress
from tribodyn.workflows.scene.scene_file import read


def go_on(folder: Path, overrides: tuple[str, ...]) -> None:
    """Begin the small beam in a folder, or resume it."""
    path = folder / "result.h5"
    file = read("beam", overrides)
    earlier = store.load(path) if path.exists() else None
    if earlier is None or not checkpoint.is_complete(earlier, file.scene):
        pipeline.run(file, folder, Progress(), earlier)
