"""Oscillators that a balance gets wrong, as scenes of matrices: what a run reports holds in time, or it reports not."""

from __future__ import annotations

from pathlib import Path

import numba
import numpy as np
import pytest

import tribodyn as td
from tribodyn.workflows.result.verdict import Refinement, Status
from tribodyn.workflows.scene.scene_file import parse

OMEGA = 2 * np.pi * 10  # of the free oscillator of 1 kg [rad/s]


def ran(folder: Path, damping: float, contact: str, force: float, band: list[float], harmonics: list[int]) -> td.Result:
    """A run of one mass; damping : ratio."""
    np.savez(folder / "part.npz", M=np.eye(1), K=np.eye(1) * OMEGA**2, C=np.eye(1) * 2 * damping * OMEGA)
    text = f"""
[scene]
title = "oscillator"
[model]
file = "part.npz"
[contact]
dofs = [[0]]
area = 1e-6
{contact}
[loads.harmonic.shaker]
dofs = [0]
value = {force * OMEGA**2}
[response]
dofs = [0]
frequency = {band}
points = 60
[harmonics]
kept = {harmonics}
samples = 512
"""
    return td.run(parse(text, "oscillator.toml", (), folder))


@numba.njit  # type: ignore[untyped-decorator]
def marched(damping, force, hertz, stop, gap, spring, limit, x, v, periods, steps):  # type: ignore[no-untyped-def]
    """Amplitude, the root of twice the mean square, in the last tenth of a march from x, v: a stop and a slider."""
    w, w0 = 2 * np.pi * hertz, 2 * np.pi * 10
    h, slider, total, square, count = 1 / hertz / steps, x, 0.0, 0.0, 0
    for step in range(periods * steps):
        fixed = min(max(spring * (x - slider), -limit), limit)
        slider = x - (fixed / spring if spring > 0 else 0.0)
        pull = force * w0**2 * np.cos(w * h * step) - w0**2 * x - 2 * damping * w0 * v - fixed
        v += h * (pull - max(stop * (x - gap), 0.0))
        x += h * v
        if step >= 0.9 * periods * steps:
            total, square, count = total + x, square + x * x, count + 1
    return np.sqrt(2 * (square / count - (total / count) ** 2))


def in_time(result: td.Result, damping: float, force: float, **law: float) -> float:
    """The same oscillator, marched from the highest point of the response by a scheme that shares nothing."""
    curve = result.response
    assert curve is not None
    best = int(np.argmax(curve.amplitude("response")))
    x = curve.contact[best][0]
    order = np.array([h for h in result.harmonics for _ in range(2 if h else 1)])
    static = int(order[0] == 0)
    start, rate = x[:static].sum() + x[static::2].sum(), (order[static::2] * x[static + 1 :: 2]).sum()
    numbers = {"stop": 0.0, "gap": 0.0, "spring": 0.0, "limit": 0.0} | law
    hertz = float(curve.frequency[best])
    outcome: float = marched(
        damping, force, hertz, numbers["stop"], numbers["gap"], numbers["spring"], numbers["limit"], start,
        2 * np.pi * hertz * rate, 400, 8000,
    )  # fmt: skip
    return outcome


@pytest.mark.parametrize(("gap", "top"), [(0.5, 5), (0.2, 15)])
def test_an_oscillator_that_hammers_on_a_stop_is_right_or_not_reported(gap: float, top: int, tmp_path: Path) -> None:
    stop = 300 * OMEGA**2
    contact = f'components = ["n"]\nlaw = "unilateral"\nnormal_stiffness = {stop}\ngap = {gap}'
    result = ran(tmp_path, 0.05, contact, 0.1, [5.0, 25.0], list(range(top + 1)))
    statement = result.verdict
    assert statement is not None
    item = statement.statements["amplitude"]
    combined = [
        row for row in statement.changes if row.refinement == Refinement.COMBINED and row.quantity == "amplitude"
    ]
    assert [row.relative is not None for row in combined] == [True]
    assert item.value is not None
    assert item.error is not None
    off = abs(item.value / in_time(result, 0.05, 0.1, stop=stop, gap=gap) - 1)
    assert off > item.error, "an error that holds needs no flag"
    assert item.status in (Status.CONTRADICTED, Status.UNSETTLED, Status.UNSTABLE)


@pytest.mark.parametrize(("force", "stable"), [(0.5, True), (1.5, False)])
def test_negative_damping_that_friction_limits_is_right_or_not_reported(
    force: float, stable: bool, tmp_path: Path
) -> None:
    contact = f'components = ["t1"]\nlaw = "jenkins_constant"\ntangential_stiffness = {4 * OMEGA**2}'
    contact += f"\nfriction = 1.0\nnormal_load = {OMEGA**2}"
    result = ran(tmp_path, -0.02, contact, force, [6.0, 30.0], [1, 3, 5, 7])
    assert result.verdict is not None
    item = result.verdict.statements["amplitude"]
    assert item.status in ((Status.REPORTED,) if stable else (Status.UNSTABLE, Status.UNSETTLED))
    if stable:
        outcome = in_time(result, -0.02, force, spring=4 * OMEGA**2, limit=OMEGA**2)
        assert item.value == pytest.approx(outcome, rel=item.error)
