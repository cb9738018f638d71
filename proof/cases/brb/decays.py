"""What the fitted beam says of a free decay after a hammer's blow: bending modes 1 to 3 over the amplitude.

python -m proof.cases.brb.decays STEPPED_SINE.csv FILE.json

The fit has seen the stepped sine of the first mode alone; of the blow and of modes 2 and 3 nothing was looked at.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np

from proof.cases.brb.fit import START, Beam, opening
from tribodyn.hbm.continuation.nonlinear_modes import BackboneOptions, backbone
from tribodyn.hbm.time.decrement import decrement

FITTED = START | {"friction": 0.0887, "damping": 1.405e-3, "ends": 36.5e-6, "sides": 226e-6, "modulus": 190.4e9}
FIRST_FIT = START | {"friction": 0.137, "damping": 1.14e-3, "modulus": 192.31e9}  # with a parabola along the lap
MODES = {"first": (6, 2e-7, 2e-4), "second": (8, 5e-8, 2e-5), "third": (9, 5e-8, 1e-5)}  # number, amplitudes [m]
STATED = (
    "blow and sensor at one point, 84 mm from the end of the half beam `lower`, across the lap (z), on its middle line",
    "amplitudes are those of that point, single mode; frequency and damping do not depend on how they were reached",
    "damping is the logarithmic decrement over 2 pi, of a decaying harmonic fitted in a window of four periods",
    "a blow I [N s] starts mode k with I / (modal_mass_kg 2 pi frequency); a half sine of length T times "
    "cos(w T / 2) / (1 - (w T / pi)^2)",
    "predicted: the fit; least and most: of it and of the earlier fit with a parabolic opening; the decay itself is "
    "known to 2 % in damping",
    "linear damping of modes 2 and 3 is no result: 0.39 of the first in the second, proportional to both in the third",
)


def decays(beam: Beam) -> dict[str, Any]:
    """Frequency [Hz], damping, seconds since the largest amplitude, of each mode, by variant and in all."""
    points = beam.plain.interface.points
    parabola = 0.55e-3 * (points[:, 0] / 0.06) ** 2
    fitted = opening(points, FITTED["ends"], FITTED["sides"])
    models = [
        beam.model(FITTED, fitted)[1],
        beam.model(FIRST_FIT, parabola)[1],
    ]
    result: dict[str, Any] = {"stated": STATED}
    for name, (number, low, high) in MODES.items():
        at = np.geomspace(high, low, 13)[:7]  # below, a decrement is a quotient of small differences
        hertz, damping = np.empty((2, len(models), len(at)))
        for k, model in enumerate(models):
            mode = backbone(model.balance, low, high, number, "response", BackboneOptions(12))
            loss, size = decrement(model.balance, mode), np.log(mode.first_harmonic)
            hertz[k] = np.exp(np.interp(np.log(at), size, np.log(mode.frequency)))
            damping[k] = np.exp(np.interp(np.log(at), size, np.log(loss)))
            if not k:
                mass = float((mode.modal_amplitude[0] / mode.amplitude[0]) ** 2)
        rate = 2 * np.pi * hertz * damping
        step = np.diff(-np.log(at)) * 2 / (rate[:, 1:] + rate[:, :-1])
        seconds = np.concatenate([np.zeros((len(models), 1)), np.cumsum(step, axis=1)], axis=1)
        result[name] = {"modal_mass_kg": mass, "amplitude_m": at.tolist()}
        for word, rows in (("frequency_hz", hertz), ("damping", damping), ("seconds", seconds)):
            ends = {"predicted": rows[0], "least": rows.min(0), "most": rows.max(0)}
            result[name][word] = {key: values.tolist() for key, values in ends.items()}
        for j in range(0, len(at), 2):
            f = hertz[:, j]
            print(
                f"{name} {1e6 * at[j]:8.3g} um {f[0]:8.2f} Hz ({f.min():.2f} to {f.max():.2f}) "
                f"{100 * damping[0, j]:.3f} % ({100 * damping[:, j].min():.3f} to {100 * damping[:, j].max():.3f}) "
                f"after {seconds[0, j]:.3g} s",
                flush=True,
            )
        print(f"{name} modal mass {mass:.3f} kg")
    return result


if __name__ == "__main__":
    Path(sys.argv[2]).write_text(json.dumps(decays(Beam(Path(sys.argv[1]))), indent=1) + "\n", encoding="utf-8")
