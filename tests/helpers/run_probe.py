"""Run scenes and tell as JSON what each imported, factorised, allocated and stored.

python -m tests.helpers.run_probe reads lines [SCENE, [section.key=value ...]] and answers each with a line. A scene
runs in a child of an interpreter that has imported nothing but this file."""

import json
import os
import sys
import tempfile
from pathlib import Path

import h5py

from tribodyn.fem import factor as fem_factor
from tribodyn.workflows.run import modelling, pipeline
from tribodyn.workflows.run.progress import Progress
from tribodyn.workflows.scene import scene_file

OPTIONAL = ("gmsh", "pyvista", "vtk", "matplotlib", "surfalize", "cyclopts")


def tell(scene: str, overrides: list[str]) -> None:
    """Run and tell."""
    factorised, models = [], []

    def counted(kind: type) -> type:
        class Counted(kind):  # type: ignore[misc]
            def __init__(self, K, *arguments, **options):
                factorised.append(K.shape[0])
                super().__init__(K, *arguments, **options)

        return Counted

    fem_factor.Pardiso, fem_factor.SuperLU = counted(fem_factor.Pardiso), counted(fem_factor.SuperLU)
    build = modelling.build
    modelling.build = lambda *arguments: models.append(build(*arguments)) or models[-1]
    with tempfile.TemporaryDirectory() as folder:
        result = pipeline.run(scene_file.read(scene, overrides), Path(folder), Progress())
        arrays: dict[str, tuple[int, ...]] = {}
        with h5py.File(Path(folder) / "result.h5") as file:
            file.visititems(lambda name, item: arrays.update({name: getattr(item, "shape", None)}) and None)
    balance = models[0].balance
    messages = {
        "state": result.state, "imported": [name for name in OPTIONAL if name in sys.modules],
        "factorised": factorised, "models": len(models),
        "groups": sorted(name for name, shape in arrays.items() if shape is None),
        "arrays": {name: shape for name, shape in arrays.items() if shape is not None},
        "pairs": balance.contact.n_pair, "components": len(balance.contact.components),
        "coefficients": balance.basis.n_coeff, "unknowns": balance.n_unknown, "memory": balance.memory.size,
        "systems": len(balance.compliance.groups), "coordinates": balance.model.system.n_dof,
        "masters": len(balance.model.origin.masters), "modes": balance.model.origin.n_modes,
        "delta_max": result.facts.delta_max,
    }  # fmt: skip
    print(json.dumps(messages), flush=True)


if __name__ == "__main__":
    os.environ["TRIBODYN_CACHE"] = "off"  # what is kept of an earlier run is not factorised again
    for line in sys.stdin:
        if (child := os.fork()) == 0:
            tell(*json.loads(line))
            sys.exit()
        if os.waitpid(child, 0)[1]:
            sys.exit(1)
