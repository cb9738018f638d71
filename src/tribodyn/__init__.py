"""From geometry to worn surface: vibration, friction and fretting wear of jointed parts.

    import tribodyn as td

    result = td.run("beam")                 # or a path, or a dict; td.scene_names() lists those that come along
    print(result.summary()["peak_hz"])
    result.plot_response().savefig("response.png")

Units are SI, frequencies are in Hz on both sides. What is not in `__all__` may change without notice. Names are
imported when they are first used, so that this import takes no time.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from tribodyn.workflows.api.scenes import build, load, plan, read_scene, run, scene_names
    from tribodyn.workflows.result.result import Result
    from tribodyn.workflows.result.store import ResultError
    from tribodyn.workflows.run.failure import SolveFailed
    from tribodyn.workflows.run.modelling import Model
    from tribodyn.workflows.scene.scene_file import SceneError, SceneFile

_HOME = {
    "tribodyn.workflows.api.scenes": ("build", "load", "plan", "read_scene", "run", "scene_names"),
    "tribodyn.workflows.result.result": ("Result",),
    "tribodyn.workflows.result.store": ("ResultError",),
    "tribodyn.workflows.run.failure": ("SolveFailed",),
    "tribodyn.workflows.run.modelling": ("Model",),
    "tribodyn.workflows.scene.scene_file": ("SceneError", "SceneFile"),
    "tribodyn.version": ("__version__",),
}
_MODULE = {name: module for module, names in _HOME.items() for name in names}

__all__ = [
    "Model",
    "Result",
    "ResultError",
    "SceneError",
    "SceneFile",
    "SolveFailed",
    "__version__",
    "build",
    "load",
    "plan",
    "read_scene",
    "run",
    "scene_names",
]


def __getattr__(name: str) -> Any:
    if name not in _MODULE:
        raise AttributeError(f"module 'tribodyn' has no attribute '{name}'")
    value = getattr(importlib.import_module(_MODULE[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
