"""The resonance that a stepped sine shows, as a point of the backbone: one mode whose frequency and damping change with
its amplitude, fitted to the force over the displacement of all points of a run.

    F / x = m [w_0(a)^2 - w^2 + 2 i zeta(a) w_0(a) w]

is linear in m, m w_0^2 and 2 m zeta w_0. Along a curve of constant response a does not change and both are constants;
along one of constant force both are parabolas in a.
Source  single nonlinear mode: Szemplinska-Stupnicka, JSV 63 (1979) 475; as a fit in this form ours
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tribodyn.workflows.scene.schema import Scene
from tribodyn.workflows.studies.measured.measurement import Measurement, Run, merged

BENT = 2.0  # of the largest over the least amplitude of a run, from which on frequency and damping are parabolas in it


def prepared(measured: Measurement, scene: Scene, resonance: bool) -> Measurement:
    """A measurement as it is compared: in the directions of a scene, repeats as their mean, resonances where wanted."""
    measured = measured.on(scene)
    held = any(run.control == "response" for run in measured.runs)
    if measured.kind == "response" and (resonance or held):
        measured = resonances(measured)
    return merged(measured)


def resonances(measured: Measurement) -> Measurement:
    """Each run of a response as a point of a backbone; runs of one control become one, by amplitude.

    Raises  ValueError where a run has no force or no phase, or no resonance
    """
    if not measured.phased or any(not np.isfinite(run.force).all() for run in measured.runs) or measured.per_force:
        raise ValueError("the resonance of a run needs its force and its phase in every row")
    found: dict[str, list[Run]] = {}
    for run in measured.runs:
        found.setdefault(run.control, []).append(resonance(run))
    return replace(measured, kind="backbone", runs=tuple(_joined(name, points) for name, points in found.items()))


def _joined(control: str, points: list[Run]) -> Run:
    """Points by amplitude as one run."""
    order = np.argsort([point.amplitude[0] for point in points])
    columns = ("frequency", "displacement", "force", "damping", "errors")
    arrays = (np.concatenate([getattr(points[i], column) for i in order]) for column in columns)
    return Run(f"constant {control}" if control else "resonances", control, *arrays)


def resonance(run: Run) -> Run:
    """The point of a run at its largest amplitude, at resonance where that is constant; its force is that of resonance.

    Raises  ValueError where no resonance is within the run
    """
    omega, a = 2 * np.pi * run.frequency, run.amplitude
    stiffness, s = run.force / run.displacement, a / a.max() - 1
    bent = len(a) > 10 and a.max() > BENT * a.min()
    powers = np.stack([s**k for k in range(3 if bent else 1)], axis=1)
    none = np.zeros_like(powers)
    rows = np.vstack(
        [np.column_stack([-(omega**2), powers, none]), np.column_stack([0 * omega, none, powers * omega[:, None]])]
    )
    weight = np.tile(1 / np.abs(stiffness), 2)  # relative errors
    scale = np.abs(rows).max(axis=0)
    target = np.concatenate([stiffness.real, stiffness.imag])
    design = weight[:, None] * rows / scale
    solved, _, rank, _ = np.linalg.lstsq(design, weight * target, rcond=None)
    which = [0, 1, 1 + powers.shape[1]]
    mass, square, rate = (solved / scale)[which]
    if rank < design.shape[1] or not (square / mass > 0 and rate / mass > 0):
        raise ValueError(f"run {run.name}: no resonance of one mode is within it")
    natural = float(np.sqrt(square / mass))
    left = weight * target - design @ solved
    covariance = (
        np.linalg.inv(design.T @ design)[np.ix_(which, which)] * (left @ left) / max(len(left) - len(solved), 1)
    )
    slopes = np.array([[-0.5, 0.5, 0.0], [-0.5, -0.5, 1.0]]) / solved[which]  # of the logarithms of w_0 and zeta
    errors = np.sqrt(np.einsum("ij,jk,ik->i", slopes, covariance, slopes))
    order = np.argsort(omega)
    size = a.max() if bent else np.interp(natural, omega[order], a[order])  # held constant, as an acceleration perhaps
    hertz, top, damping = (np.array([v]) for v in (natural / (2 * np.pi), size, rate / mass / (2 * natural)))
    return Run(run.name, run.control, hertz, top.astype(complex), abs(rate) * natural * top, damping, errors[None])
