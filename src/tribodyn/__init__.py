"""From geometry to worn surface: vibration, friction and fretting wear of jointed parts.

    import tribodyn as td

    result = td.run("beam")                 # or a path, or a dict; td.scene_names() lists those that come along
    print(result.summary()["peak_hz"])
    result.plot_response().savefig("response.png")

    matrices = td.read_matrices("part.npz")         # or td.from_arrays(M, K)
    rows = matrices.contact_rows([[1, 0, -1]], ("t1",), area=1e-4)  # x = q_0 - q_2
    rub = td.Contact("rub", rows, "jenkins_constant", 1e5, numbers={"friction": 0.5, "normal_load": 20.0})
    structure = td.reduce(matrices, rub, loads={"shaker": 2}, outputs={"tip": 2}, damping_ratio=0.01)
    balance = structure.balance((1, 3, 5), up_to=200.0, harmonic={1: {"shaker": 5.0}})
    curve = balance.response(20.0, 200.0, points=100)
    print(curve.frequency, curve.amplitude("tip"))

Units are SI, frequencies are in Hz on both sides. What is not in `__all__` may change without notice. Names are
imported when they are first used, so that this import takes no time.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from tribodyn.hbm.continuation import names as continuations
    from tribodyn.hbm.law import names as contact_laws
    from tribodyn.hbm.wear_law import names as wear_laws
    from tribodyn.reduction.foreign import ForeignMatrices as Matrices
    from tribodyn.reduction.foreign import from_arrays, read_matrices
    from tribodyn.workflows.api.own_matrices import Balance, Contact, Cycle, Structure, reduce, wear_law
    from tribodyn.workflows.api.scenes import build, load, plan, read_scene, run, scene_names
    from tribodyn.workflows.result.result import Result
    from tribodyn.workflows.result.store import ResultError
    from tribodyn.workflows.run.failure import SolveFailed
    from tribodyn.workflows.run.modelling import Model
    from tribodyn.workflows.scene.scene_file import SceneError, SceneFile

# name here -> module, and name there where it is another one
_HOME: dict[str, tuple[str, ...]] = {
    "Balance": ("tribodyn.workflows.api.own_matrices",),
    "Contact": ("tribodyn.workflows.api.own_matrices",),
    "Cycle": ("tribodyn.workflows.api.own_matrices",),
    "Matrices": ("tribodyn.reduction.foreign", "ForeignMatrices"),
    "Model": ("tribodyn.workflows.run.modelling",),
    "Result": ("tribodyn.workflows.result.result",),
    "ResultError": ("tribodyn.workflows.result.store",),
    "SceneError": ("tribodyn.workflows.scene.scene_file",),
    "SceneFile": ("tribodyn.workflows.scene.scene_file",),
    "SolveFailed": ("tribodyn.workflows.run.failure",),
    "Structure": ("tribodyn.workflows.api.own_matrices",),
    "__version__": ("tribodyn.version",),
    "build": ("tribodyn.workflows.api.scenes",),
    "contact_laws": ("tribodyn.hbm.law", "names"),
    "continuations": ("tribodyn.hbm.continuation", "names"),
    "from_arrays": ("tribodyn.reduction.foreign",),
    "load": ("tribodyn.workflows.api.scenes",),
    "plan": ("tribodyn.workflows.api.scenes",),
    "read_matrices": ("tribodyn.reduction.foreign",),
    "read_scene": ("tribodyn.workflows.api.scenes",),
    "reduce": ("tribodyn.workflows.api.own_matrices",),
    "run": ("tribodyn.workflows.api.scenes",),
    "scene_names": ("tribodyn.workflows.api.scenes",),
    "wear_law": ("tribodyn.workflows.api.own_matrices",),
    "wear_laws": ("tribodyn.hbm.wear_law", "names"),
}

__all__ = [
    "Balance",
    "Contact",
    "Cycle",
    "Matrices",
    "Model",
    "Result",
    "ResultError",
    "SceneError",
    "SceneFile",
    "SolveFailed",
    "Structure",
    "__version__",
    "build",
    "contact_laws",
    "continuations",
    "from_arrays",
    "load",
    "plan",
    "read_matrices",
    "read_scene",
    "reduce",
    "run",
    "scene_names",
    "wear_law",
    "wear_laws",
]


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'tribodyn' has no attribute '{name}'")
    module, *there = _HOME[name]
    value = getattr(importlib.import_module(module), there[0] if there else name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
