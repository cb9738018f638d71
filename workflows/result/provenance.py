"""The scene that a result was computed from."""

from collections.abc import Sequence
from pathlib import Path

from tribodyn.workflows.result.result import Result
from tribodyn.workflows.scene import scene_file


def rebuilt(result: Result, overrides: Sequence[str] = ()) -> scene_file.SceneFile:
    """The scene that a result was computed from, with further overrides."""
    record = result.provenance
    before = [text for text in record["overrides"].split("\n") if text]
    return scene_file.parse(
        record["scene_text"], f"{record['scene_name']}.toml", [*before, *overrides], Path(record["folder"])
    )
