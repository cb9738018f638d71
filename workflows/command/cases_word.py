"""The word `tribodyn cases`; it loads no solver, mesher or plots."""

from tribodyn.workflows.scene import scene_file


def cases() -> None:
    """List the scenes that come with the program."""
    for name in scene_file.names():
        print(f"{name:12} {scene_file.title(name)}")
