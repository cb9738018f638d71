"""Oscillators that a balance gets wrong, as scenes of matrices: what a run reports holds in time, or it reports not."""

from pathlib import Path
from typing import Any

import numba
import numpy as np
import pytest

import tribodyn as td
from tribodyn.workflows.report import text
from tribodyn.workflows.result.verdict import Status
from tribodyn.workflows.scene.scene_file import parse

OMEGA = 2 * np.pi * 10  # of the free oscillator of 1 kg [rad/s]
SCENE = """
[scene]
title = "oscillator"
[model]
file = "part.npz"
[contact]
dofs = {pairs}
area = 1e-6
{contact}
[loads.harmonic.shaker]
vector = {{variable = "load"}}
value = 1.0
[response]
dofs = [{output}]
frequency = {band}
[harmonics]
kept = {harmonics}
samples = {samples}
"""


def ran(folder: Path, damping: float, contact: str, force: float, band: list[float], harmonics: list[int]) -> td.Result:
    """A run of one mass; damping : ratio."""
    matrices = {"M": np.eye(1), "K": np.eye(1) * OMEGA**2, "C": np.eye(1) * 2 * damping * OMEGA}
    np.savez(folder / "part.npz", **matrices, load=np.array([force * OMEGA**2]))
    numbers = {"pairs": [[0]], "output": 0, "band": f"{band}\npoints = 60", "harmonics": harmonics, "samples": 512}
    return td.run(parse(SCENE.format(contact=contact, **numbers), "oscillator.toml", (), folder))


@numba.njit  # type: ignore[untyped-decorator]
def marched(damping, force, hertz, stop, gap, spring, limit, x, v, periods, steps):  # type: ignore[no-untyped-def]
    """Half the range of the last tenth of a march from x, v: a stop and a slider."""
    w, w0 = 2 * np.pi * hertz, 2 * np.pi * 10
    h, slider, low, high = 1 / hertz / steps, x, np.inf, -np.inf
    for step in range(periods * steps):
        fixed = min(max(spring * (x - slider), -limit), limit)
        slider = x - (fixed / spring if spring > 0 else 0.0)
        pull = force * w0**2 * np.cos(w * h * step) - w0**2 * x - 2 * damping * w0 * v - fixed
        v += h * (pull - max(stop * (x - gap), 0.0))
        x += h * v
        if step >= 0.9 * periods * steps:
            low, high = min(low, x), max(high, x)
    return (high - low) / 2


def in_time(result: td.Result, damping: float, force: float, **law: float) -> float:
    """The same oscillator, marched from the highest point of the response by a scheme that shares nothing."""
    curve = result.response
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
    item = statement.statements["amplitude"]
    off = abs(item.value / in_time(result, 0.05, 0.1, stop=stop, gap=gap) - 1)
    assert item.status != Status.REPORTED or off < (item.error or 0.0)


def test_few_harmonics_do_not_count_at_a_given_frequency(tmp_path: Path) -> None:
    """Gross slip, the response rises to the end of its range: values in time are stated there."""
    contact = f'components = ["t1"]\nlaw = "jenkins_constant"\ntangential_stiffness = {20 * OMEGA**2}'
    result = ran(tmp_path, 0.05, f"{contact}\nfriction = 1.0\nnormal_load = {0.6 * OMEGA**2}", 1.0, [3.0, 6.0], [1])
    item = result.verdict.statements["amplitude"]
    truth = in_time(result, 0.05, 1.0, spring=20 * OMEGA**2, limit=0.6 * OMEGA**2)
    assert abs(item.value / truth - 1) < item.error < 0.01
    assert result.response.amplitude("response").max() < 0.6 * truth


@pytest.mark.parametrize(("force", "stable"), [(0.5, True), (1.5, False)])
def test_negative_damping_that_friction_limits_is_right_or_not_reported(force, stable, tmp_path):
    contact = f'components = ["t1"]\nlaw = "jenkins_constant"\ntangential_stiffness = {4 * OMEGA**2}'
    contact += f"\nfriction = 1.0\nnormal_load = {OMEGA**2}"
    result = ran(tmp_path, -0.02, contact, force, [6.0, 30.0], [1, 3, 5, 7])
    item = result.verdict.statements["amplitude"]
    assert item.status in ((Status.REPORTED,) if stable else (Status.UNSTABLE, Status.UNSETTLED))
    if stable:
        outcome = in_time(result, -0.02, force, spring=4 * OMEGA**2, limit=OMEGA**2)
        assert item.value == pytest.approx(outcome, rel=item.error)


SHEARED = np.array([[1.0, 1.0], [0.0, 1.0]])
TWO = {
    "mass": np.eye(2),
    "stiffness": np.diag([1.0, (7 * 1.245) ** 2]),
    "damping": 0.02 * np.eye(2),
    "load": [0.3, 0.0],
}
STUCK = {"force": 1e-5, "spring": 1.0, "limit": 100.0, "band": (1.4141, 1.4143)}
SEVERE = {"spring": 1e4, "limit": 0.7}


@pytest.mark.parametrize(("scene", "truth"), [
    # a superharmonic of order 7, in time: the peak of few harmonics is none
    ({**TWO, "pairs": 31, "harmonics": "[0, 1, 2, 3]"}, {"peak_frequency": 0.1988, "amplitude": 0.0603}),
    ({**TWO, "pairs": 31}, {"peak_frequency": 0.1988, "amplitude": 0.0603}),
    # Den Hartog 1931: rigid friction of 0.7 and 0.8 of the force needs many harmonics
    ({**SEVERE, "harmonics": "[0, 1, 2, 3]"}, {"peak_frequency": 0.1393, "amplitude": 1.359, "energy": 3.713}),
    (SEVERE, {"peak_frequency": 0.1393, "amplitude": 1.359, "energy": 3.713}),
    ({**SEVERE, "pairs": 32, "harmonics": str(list(range(10)))}, {"peak_frequency": 0.1393, "energy": 3.713}),
    ({**SEVERE, "limit": 0.8, "band": (0.2, 0.6)}, {"peak_frequency": 0.6 / 2 / np.pi, "amplitude": 1.0407}),
    # stuck for ever: the phase error of time steps is no contradiction
    *(({**STUCK, "damping": d}, {"amplitude": 1e-5 / d / np.sqrt(2)}) for d in (2e-4, 2e-5, 2e-6)),
])  # fmt: skip
def test_a_stated_number_is_right(scene: dict[str, object], truth: dict[str, float], tmp_path: Path) -> None:
    """Truths by integration in time with small steps, or exact; a stuck motion has to be stated."""
    numbers: dict[str, Any] = {"mass": np.eye(1), "stiffness": np.eye(1), "damping": 0.1, "pairs": 1} | scene
    load, band = [numbers.get("force", 1.0)], (0.5, 1.6)
    numbers = {"force": 1.0, "load": load, "spring": 1.0, "limit": 0.5, "band": band} | numbers
    t = SHEARED if len(numbers["load"]) == 2 else np.eye(1)
    np.savez(
        tmp_path / "part.npz", M=t.T @ numbers["mass"] @ t, K=t.T @ numbers["stiffness"] @ t,
        C=t.T @ (numbers["damping"] * np.eye(len(t))) @ t,
        load=t.T @ np.array(numbers["load"]),
    )  # fmt: skip
    low, high = (omega / 2 / np.pi for omega in numbers["band"])
    contact = f'components = ["t1"]\nlaw = "jenkins_constant"\ntangential_stiffness = {numbers["spring"]}\n'
    contact += f"friction = 1.0\nnormal_load = {numbers['limit'] / numbers['pairs']}"
    text = SCENE.format(
        pairs=[[0]] * numbers["pairs"], contact=contact, output=len(t) - 1, band=f"[{low}, {high}]",
        harmonics=numbers.get("harmonics", '"auto"'), samples=256,
    )  # fmt: skip
    verdict = td.run(parse(text, "oscillator.toml", (), tmp_path)).verdict
    for name, right in truth.items():
        item = verdict.statements[name]
        assert not item.stated or abs((item.value or 0.0) / right - 1) < (item.error or 0.0), name
        assert item.stated or scene.get("force") is None


def test_a_balance_that_negative_damping_feeds_is_no_motion(tmp_path: Path) -> None:
    """It grows by 0.63 of itself a second, too slowly to be seen in time; friction takes little of what feeds it."""
    law = 'components = ["t1"]\nlaw = "jenkins_constant"\ntangential_stiffness = 1e3\nfriction = 0.4\nnormal_load = 0.1'
    result = ran(tmp_path, -0.01, law, 2.5e-3, [8.0, 13.0], [0, 1, 3])
    assert result.verdict is not None
    assert not any(statement.stated for statement in result.verdict.statements.values())
    assert "; the motion in time is another one, see errors" in "\n".join(text.brief(result))
