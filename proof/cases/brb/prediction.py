"""A prediction of the measured Brake-Reuss beam from inputs of the literature, and the measurement beside it.

python -m proof.cases.brb.prediction predict FILE.json
python -m proof.cases.brb.prediction compare FILE.json MEASURED.csv PICTURE.png
"""

from __future__ import annotations

import csv
import json
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import least_squares

SCENE = "brb_half_fitted"
BEFORE_THE_FIT = [  # inputs of the literature alone, in place of what was fitted
    "materials.steel.young=200 GPa", "materials.steel.poisson=0.29", "contacts.lap.friction=0.03",
    "contacts.lap.gap_map=",
    "bodies.lower.n_lap=1", "bodies.upper.n_lap=1", "bodies.lower.n_length=16", "bodies.upper.n_length=16",
    "loads.harmonic.shaker.group=lower.tip", "response.group=upper.tip", 'damping.ratios=["0.087 %", "0.034 %"]',
    "backbone.modal_amplitude=[2e-8, 1e-4]", "backbone.points=36",
]  # fmt: skip
DRIVEN = 0.1  # of the length from the end: a photograph
BOLTS = tuple(f"loads.static.bolt_{k}.value" for k in (1, 2, 3))
VARIANTS: dict[str, list[str]] = {
    "flat": [],
    "wavy": ['contacts.lap.gap_map="waviness.csv"'],
    "friction 0.3": ["contacts.lap.friction=0.3"],
    "bolts 6 kN": [f'{bolt}="6 kN"' for bolt in BOLTS],
}
HIGHER = {"second bending mode": 8, "third bending mode": 9}
ASSUMED = (
    "720 mm long, 25.4 mm wide, 12.7 mm high in the direction of vibration, laps of 6.35 mm",
    "bolts, nuts and washers as those of the full beam, shank 38.1 mm, bolts of 12 249 N",
    "faces as those of the full beam: density of asperities, friction 0.03, flat",
    "linear damping 0.087 % and 0.034 % in the first two bending modes, measured on the full beam",
    "E = 200 GPa, nu = 0.29, 7800 kg/m3; free in space; shaker and stinger add nothing",
    "driven and measured at a tenth of the length from one end, first bending shape of a free beam",
)
ACCELERATION = np.geomspace(0.05, 20.0, 25)  # of the driven point [m/s2]
DECAY = 120e-6  # at the end of the beam [m]


def shape(x: float) -> float:
    """First bending shape of a free uniform beam, over that at its end; x : over the length."""
    b = 4.730040744862704
    ratio = (np.cosh(b) - np.cos(b)) / (np.sinh(b) - np.sin(b))
    return float((np.cosh(b * x) + np.cos(b * x) - ratio * (np.sinh(b * x) + np.sin(b * x))) / 2)


def curve(backbone: dict[str, Any]) -> dict[str, np.ndarray]:
    """Frequency [Hz], damping, force [N] of phase resonance against the acceleration of the driven point [m/s2]."""
    q, hertz, zeta, tip = (
        np.array(backbone[name]) for name in ("modal_amplitude", "frequency_hz", "damping", "amplitude_m")
    )
    omega, phi = 2 * np.pi * hertz, tip / q * shape(DRIVEN)
    a, force = omega**2 * phi * q, 2 * zeta * omega**2 * q / phi
    logs = np.log(ACCELERATION)
    result = {"frequency_hz": hertz, "damping": zeta, "force_N": force}
    return {name: np.exp(np.interp(logs, np.log(a), np.log(values))) for name, values in result.items()}


def decay(backbone: dict[str, Any], seconds: np.ndarray) -> np.ndarray:
    """Amplitude at the end [m] of a free decay from DECAY."""
    hertz, zeta, tip = (np.array(backbone[name]) for name in ("frequency_hz", "damping", "amplitude_m"))
    logs, rate = np.log(tip), 2 * np.pi * hertz * zeta
    grid = np.linspace(np.log(DECAY), logs[0], 4000)
    slope = np.interp(grid, logs, rate)
    at = np.concatenate([[0.0], np.cumsum(-np.diff(grid) * 2 / (slope[1:] + slope[:-1]))])
    return np.asarray(np.exp(np.interp(seconds, at, grid)))


def predict(path: Path) -> None:
    """Solve the backbones and write the prediction."""
    import tribodyn as td

    result = {
        name: td.studies.backbone(SCENE, overrides=[*BEFORE_THE_FIT, *over]).record() for name, over in VARIANTS.items()
    }
    small = [*BEFORE_THE_FIT, "backbone.points=4", "backbone.modal_amplitude=[2e-8,2e-6]"]
    higher = {
        name: td.studies.backbone(SCENE, overrides=[*small, f"backbone.mode={mode}"]).record()["frequency_hz"][0]
        for name, mode in HIGHER.items()
    }
    curves = {name: curve(item) for name, item in result.items()}
    seconds = np.array([0.0, 0.1, 0.2, 0.5, 1.0, 2.0, 4.0, 8.0])
    record: dict[str, Any] = {
        "assumed": ASSUMED,
        "stated": "flat is the prediction; the least and the largest of the variants are its error",
        "acceleration_m_s2": ACCELERATION.tolist(),
        "decay_s": seconds.tolist(),
        "higher_modes_hz": higher,
    }
    for name in ("frequency_hz", "damping", "force_N"):
        all_of = np.array([item[name] for item in curves.values()])
        record[name] = {
            "predicted": all_of[0].tolist(),
            "least": all_of.min(0).tolist(),
            "most": all_of.max(0).tolist(),
        }
    falls = np.array([decay(item, seconds) for item in result.values()])
    record["decay_m"] = {"predicted": falls[0].tolist(), "least": falls.min(0).tolist(), "most": falls.max(0).tolist()}
    path.write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")


@dataclass(frozen=True)
class Resonance:
    """What one stepped sine says: control and run, frequency [Hz], damping, modal mass of the driven point [kg]

    acceleration [m/s2], force [N] : at resonance; misfit : rms of the accelerance left, over its largest
    """

    control: str
    run: str
    frequency_hz: float
    damping: float
    mass: float
    acceleration: float
    force: float
    misfit: float


def resonances(path: Path) -> list[Resonance]:
    """One linear mode fitted to the complex accelerance of each run."""
    with path.open(encoding="utf-8") as file:
        rows = list(csv.DictReader(line for line in file if not line.startswith("#")))
    runs: dict[tuple[str, str], list[list[float]]] = {}
    for row in rows:
        numbers = [float(row[name]) for name in ("frequency_hz", "response_m_s2", "force_N", "phase_deg")]
        runs.setdefault((row["control"], row["run"]), []).append(numbers)
    return [_fitted(*key, np.array(points)) for key, points in runs.items()]


def _fitted(control: str, run: str, points: np.ndarray) -> Resonance:
    hertz, a, force, phase = points.T
    measured = a / force * np.exp(1j * np.radians(phase))
    omega = 2 * np.pi * hertz
    top = int(np.abs(measured).argmax())

    def fit(p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        w, zeta = omega[top] * (1 + p[0]), np.exp(p[1])
        basis = (omega**2 / (w**2 - omega**2 + 2j * zeta * w * omega))[:, None]
        amount = np.linalg.lstsq(basis, measured, rcond=None)[0]
        return basis @ amount - measured, amount

    result = least_squares(lambda p: fit(p)[0].view(float), [0.0, np.log(3e-3)], x_scale=[1e-3, 1.0])
    remaining, amount = fit(result.x)
    return Resonance(
        control, run, float(hertz[top] * (1 + result.x[0])), float(np.exp(result.x[1])), float(1 / np.abs(amount[0])),
        float(a[top]), float(force[top]), float(np.sqrt(np.mean(np.abs(remaining) ** 2)) / np.abs(measured).max()),
    )  # fmt: skip


def compare(path: Path, measured: Path, picture: Path) -> None:
    """Print the measurement beside the prediction, and draw both."""
    from matplotlib import pyplot as plt

    record = json.loads(path.read_text(encoding="utf-8"))
    at = np.log(record["acceleration_m_s2"])
    print("control run   m/s2     Hz   predicted  damping %  predicted (range)   force N  predicted   mass kg  misfit")
    for row in resonances(measured):
        inside = np.log(row.acceleration) <= at[-1]
        hertz, zeta, least, largest, force = (
            float(np.exp(np.interp(np.log(row.acceleration), at, np.log(record[name][kind])))) if inside else np.nan
            for name, kind in (
                ("frequency_hz", "predicted"), ("damping", "predicted"), ("damping", "least"), ("damping", "most"),
                ("force_N", "predicted"),
            )
        )  # fmt: skip
        print(
            f"{row.control:8} {row.run} {row.acceleration:7.1f} {row.frequency_hz:7.2f} {hertz:8.2f} "
            f"{100 * row.damping:9.3f} {100 * zeta:9.3f} ({100 * least:.2f} to {100 * largest:.2f}) "
            f"{row.force:8.3f} {force:8.3f} {row.mass:9.2f} {row.misfit:8.3f}"
        )
    figure, two_results = plt.subplots(1, 2, figsize=(9, 3.6), layout="constrained")
    for axes, name, label in zip(
        two_results, ("frequency_hz", "damping"), ("frequency / Hz", "damping ratio"), strict=True
    ):
        axes.fill_between(record["acceleration_m_s2"], record[name]["least"], record[name]["most"], alpha=0.2)
        axes.plot(record["acceleration_m_s2"], record[name]["predicted"], label="predicted, with its range")
        for control, mark in (("force", "o"), ("response", "s")):
            runs = [row for row in resonances(measured) if row.control == control]
            values = [getattr(row, name) for row in runs]
            axes.plot(
                [row.acceleration for row in runs],
                values,
                mark,
                ms=4,
                label=f"measured, constant {control}",
            )
        axes.set(xscale="log", xlabel="acceleration of the driven point / (m/s²)", ylabel=label)
    two_results[1].set_yscale("log")
    two_results[0].legend(fontsize=8)
    figure.savefig(picture, dpi=150)


if __name__ == "__main__":
    word, *files = sys.argv[1:]
    {"predict": predict, "compare": compare}[word](*map(Path, files))
