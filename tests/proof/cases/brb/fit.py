"""The fit of the measured Brake-Reuss beam on its runs of constant force, judged on those of constant response.

python -m tests.proof.cases.brb.fit MEASURED.csv [NAME ...]    NAME : of friction, crown, damping, bolts
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from scipy.optimize import least_squares

from tribodyn.workflows.run import modelling
from tribodyn.workflows.run.progress import Progress
from tribodyn.workflows.scene.source import read_scene
from tribodyn.workflows.studies.measured.beside import beside
from tribodyn.workflows.studies.measured.measurement import Measurement
from tribodyn.workflows.studies.measured.reading import read
from tribodyn.workflows.studies.measured.resonance import prepared

SCENE = "brb_half_fitted"
START = {"friction": 0.12, "crown": 6e-4, "damping": 1.2e-3, "bolts": 12249.0}
LOW = {"friction": 0.03, "crown": 5e-5, "damping": 3e-4, "bolts": 3e3}
HIGH = {"friction": 1.0, "crown": 2e-3, "damping": 2.5e-3, "bolts": 3e4}
WANTED = np.array([0.003, 0.15])  # of frequency and damping


class Beam:
    """The beam, its parts and reduction made once."""

    def __init__(self) -> None:
        self.file = read_scene(SCENE, ["contacts.lap.gap_map="])
        with TemporaryDirectory() as folder:
            mesh, node_sets = modelling.make_mesh(self.file, Path(folder))
        self.part = modelling.make_part(self.file.mesh_scene, mesh, node_sets, self.file.folder)
        self.plain = modelling.plain_model(self.file.mesh_scene, self.part)

    def off(self, values: dict[str, float], measured: Measurement) -> np.ndarray:
        """(n, 2) logarithms of computed over measured frequency and damping at every point."""
        damping = values["damping"]
        pull = [f"loads.static.bolt_{k}.value={values['bolts']}" for k in (1, 2, 3)]
        ratios = f"damping.ratios=[{damping}, {0.39 * damping}]"
        file = self.file.changed(f"contacts.lap.friction={values['friction']}", ratios, *pull)
        crown = values["crown"] * (self.plain.interface.points[:, 0] / 0.06) ** 2
        reduced = replace(self.plain, interface=replace(self.plain.interface, gap=crown))
        model = modelling.make_model(file.scene, self.part, modelling.damped(file.scene, reduced))
        pairs = beside(file, model, measured, Progress())
        ratio = [
            np.log([o.computed.frequency / o.measured.frequency, o.computed.damping / o.measured.damping])
            for o in pairs
        ]
        return np.concatenate(ratio, axis=1).T


def main(path: Path, names: list[str]) -> None:
    """Fit, and print both sets of runs."""
    beam, every = Beam(), read(path, {"direction": "-z"})
    runs = {
        control: prepared(
            replace(every, runs=tuple(r for r in every.runs if r.control == control)), beam.file.scene, True
        )
        for control in ("force", "response")
    }

    def values(unknowns: np.ndarray) -> dict[str, float]:
        return START | dict(zip(names, map(float, np.exp(unknowns)), strict=True))

    def residual(unknowns: np.ndarray) -> np.ndarray:
        found = (beam.off(values(unknowns), runs["force"]) / WANTED).ravel()
        print(values(unknowns), f"cost {found @ found / 2:.3f}", flush=True)
        return found

    first, *bounds = (np.log([table[n] for n in names]) for table in (START, LOW, HIGH))
    found = least_squares(residual, first, bounds=bounds, diff_step=0.02, max_nfev=8)
    spread = np.sqrt(np.diag(np.linalg.pinv(found.jac.T @ found.jac)))
    for name, error in zip(names, spread, strict=True):
        print(
            f"{name} {values(found.x)[name]:.4g}, one standard error {100 * error:.0f} % if 0.3 and 15 % are the data's"
        )
    for control, measured in runs.items():
        for row in beam.off(values(found.x), measured):
            hertz, damping = 100 * np.expm1(row)
            print(f"constant {control}: frequency {hertz:+.2f} %, damping {damping:+.1f} %")


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2:] or ["friction", "crown", "damping"])
