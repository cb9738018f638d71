"""The fit of the measured Brake-Reuss beam on its runs of constant force, judged on those of constant response.

python -m proof.cases.brb.fit MEASURED.csv [NAME ...]    NAME : of START
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from time import process_time

import numpy as np
from scipy.optimize import least_squares

from tribodyn.workflows.run import modelling
from tribodyn.workflows.run.progress import Progress
from tribodyn.workflows.scene.scene_file import SceneFile
from tribodyn.workflows.scene.source import read_scene
from tribodyn.workflows.studies.measured.computed_runs import compare_runs
from tribodyn.workflows.studies.measured.measurement import prepared
from tribodyn.workflows.studies.measured.reading import read

SCENE = "brb_half_fitted"
STEP = 0.04  # beyond it the ends of the laps stand back [m]
START = {"friction": 0.09, "damping": 1.6e-3, "ends": 35e-6, "sides": 200e-6, "modulus": 190e9, "bolts": 12249.0}
FACTOR = {"friction": 5.0, "damping": 2.0, "ends": 3.0, "sides": 5.0, "modulus": 1.06, "bolts": 2.0}  # bounds
DIFFERENCE = dict.fromkeys(START, 0.05) | {"sides": 0.1, "modulus": 0.004}  # steps of the logarithms
ACCURACY = np.array([[0.003], [0.15]])  # of frequency and damping


def opening(points: np.ndarray, ends: float, sides: float) -> np.ndarray:
    """Gap (n,) of the laps: how far their ends stand back and their sides are rounded [m]."""
    x, y = np.abs(points[:, :2].T)
    return np.where(x > STEP, ends, 0.0) + sides * (y / 0.0127) ** 2


class Beam:
    """The beam, its parts and reduction made once."""

    def __init__(self, path: Path) -> None:
        self.file = read_scene(SCENE, ["contacts.lap.gap_map="])
        self.young = self.file.scene.materials["steel"].young
        with TemporaryDirectory() as folder:
            mesh, node_sets = modelling.make_mesh(self.file, Path(folder))
        self.part = modelling.make_part(self.file.mesh_scene, mesh, node_sets, self.file.folder)
        self.plain = modelling.plain_model(self.file.mesh_scene, self.part)
        self.measured = prepared(read(path, {"direction": "-z"}), self.file.scene, True)

    def model(self, values: dict[str, float], gap: np.ndarray, *changes: str) -> tuple[SceneFile, modelling.Model]:
        """The beam with other numbers and another gap (n_pair,) [m] of its laps."""
        pull = [f"loads.static.bolt_{k}.value={values['bolts']}" for k in (1, 2, 3)]
        ratios = f"damping.ratios=[{values['damping']}, {0.39 * values['damping']}]"
        file = self.file.changed(f"contacts.lap.friction={values['friction']}", ratios, *pull, *changes)
        plain, i = self.plain, self.plain.interface
        stiffness = values["modulus"] / self.young * np.asarray(plain.system.stiffness)
        reduced = replace(plain, system=replace(plain.system, stiffness=stiffness), interface=replace(i, gap=gap))
        return file, modelling.make_model(file.scene, self.part, modelling.damped(file.scene, reduced))

    def off(self, values: dict[str, float]) -> dict[str, np.ndarray]:
        """Control -> (2, n) logarithms of computed over measured frequency and damping at every point."""
        gap = opening(self.plain.interface.points, values["ends"], values["sides"])
        file, model = self.model(values, gap, "backbone.modal_amplitude=[2.2e-5, 4.6e-4]", "backbone.points=12")
        return {
            compare_run.measured.control: np.log(
                [
                    compare_run.computed.frequency / compare_run.measured.frequency,
                    compare_run.computed.damping / compare_run.measured.damping,
                ]
            )
            for compare_run in compare_runs(file, model, self.measured, Progress())
        }


def main(path: Path, names: list[str]) -> None:
    """Fit, and print both sets of runs."""
    beam, last = Beam(path), [np.zeros(0), np.zeros(0)]

    def values(unknowns: np.ndarray) -> dict[str, float]:
        return START | dict(zip(names, map(float, np.exp(unknowns)), strict=True))

    def residual(unknowns: np.ndarray) -> np.ndarray:
        if np.array_equal(unknowns, last[0]):
            return last[1]
        result = (beam.off(values(unknowns))["force"] / ACCURACY).ravel()
        last[:] = unknowns.copy(), result
        print({n: f"{v:.4g}" for n, v in values(unknowns).items()}, f"cost {result @ result / 2:.3f}", flush=True)
        return result

    def slopes(unknowns: np.ndarray) -> np.ndarray:
        at, steps = residual(unknowns), np.diag([DIFFERENCE[n] for n in names])
        return np.stack([(residual(unknowns + s) - at) / s.sum() for s in steps], axis=1)

    first, wide = (np.log([table[n] for n in names]) for table in (START, FACTOR))
    scale = [DIFFERENCE[n] for n in names]
    result = least_squares(residual, first, slopes, (first - wide, first + wide), x_scale=scale, max_nfev=3)
    spread = np.sqrt(np.diag(np.linalg.pinv(result.jac.T @ result.jac)))
    for name, error in zip(names, spread, strict=True):
        print(f"{name} {values(result.x)[name]:.4g}, standard error {100 * error:.0f} % if the data's are 0.3 and 15 %")
    for control, rows in beam.off(values(result.x)).items():
        for hertz, damping in 100 * np.expm1(rows.T):
            print(f"constant {control}: frequency {hertz:+.2f} %, damping {damping:+.1f} %")
    print(f"{process_time():.0f} s of processor")


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2:] or [name for name in START if name != "bolts"])
