"""A result beside direct time integration of the same reduced model, at one frequency, unworn or as worn in one row."""

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from tribodyn.consent import asks_consent
from tribodyn.hbm import newton
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.harmonics import HarmonicBasis, amplitude
from tribodyn.hbm.newton import Solution
from tribodyn.hbm.stability.floquet import is_stable
from tribodyn.hbm.threads import limited
from tribodyn.hbm.time import verify as march
from tribodyn.hbm.time.stepper import Options
from tribodyn.hbm.time.time_integration import FreeMotion, march_freely
from tribodyn.hbm.time.verify import Verification
from tribodyn.hbm.wear.history import WearRow
from tribodyn.refusal import Refusal, SolveFailed
from tribodyn.workflows.errors.time_comparison import steps_of
from tribodyn.workflows.pictures.figures import axes_of, force_unit, length_unit
from tribodyn.workflows.pictures.matplotlib_names import Figure
from tribodyn.workflows.pictures.theme import BLUE, ORANGE
from tribodyn.workflows.result.number_format import named_lines
from tribodyn.workflows.result.provenance import rebuilt
from tribodyn.workflows.result.result import Result
from tribodyn.workflows.result.store import ResultSource, result_of
from tribodyn.workflows.run import modelling, settings
from tribodyn.workflows.run.progress import Report, reporter
from tribodyn.workflows.scene.fields import Frequency
from tribodyn.workflows.scene.scene_file import Overrides, override_texts
from tribodyn.workflows.scene.schema import Scene
from tribodyn.workflows.studies.files import write_files
from tribodyn.workflows.studies.study_result import StudyResult

TOLERANCE = 1e-6  # drift over a period, far below the differences that are looked for
PERIODS = 150
STABLE_WORDS = {True: "yes", False: "no: a machine leaves this motion", None: "not known"}
LEFT_ALONE = 120  # periods of a plain march where the balance solution is unstable or nothing periodic was found
STRIDE = 5e-3  # of the frequency, from the nearest solution to the one asked for


@dataclass(frozen=True, repr=False)
class TimeComparison(StudyResult):
    """The balance at one frequency and what time integration says.

    balance, solution : the problem, with the wear of `row` (None: unworn), and its solution
    integration : the comparison; stable : whether the motion is stable, by `stability_method`
    steps : per period; seconds : spent
    left_alone : what a plain march does where that solution is unstable or nothing periodic was found, else None
    rigid : whether time integration has the contact without its springs"""

    balance: HarmonicBalance
    solution: Solution
    integration: Verification
    stable: bool | None
    stability_method: str
    row: int | None
    steps: int
    seconds: float
    left_alone: FreeMotion | None
    rigid: bool = False

    @property
    def hertz(self) -> float:
        """Frequency [Hz]."""
        return self.integration.omega / (2 * np.pi)

    def record(self) -> dict[str, Any]:
        """Numbers for machines: balance, time integration and the difference over the latter; nan is None."""
        state, integration, motion = self.solution.state, self.integration, self.integration.motion
        ours = amplitude(self.balance.outputs(state), self.balance.basis.harmonics)
        outputs = {
            name: {
                "balance_m": float(ours[i]),
                "time_m": float(motion.amplitude[i]),
                "difference": integration.amplitude[name],
                "waveform_difference": integration.waveform[name],
                "mean_difference": integration.mean[name],
            }
            for i, name in enumerate(integration.amplitude)
        }
        energy, preload = float(self.balance.energy(state).sum()), self.balance.preload(state)
        return {
            "frequency_hz": self.hertz,
            "row": self.row,
            "harmonics": list(self.balance.basis.harmonics),
            "law": "rigid" if self.rigid else "scene",
            "outputs": outputs,
            "energy": {
                "balance_J": energy,
                "time_J": float(motion.energy.sum()),
                "difference": integration.energy,
                "largest_pair_difference": integration.energy_pairs,
            },
            "work": {"loads_J": motion.supplied, "damping_J": motion.damped, "friction_J": float(motion.energy.sum())},
            "preload": {"balance_N": preload, "time_N": motion.preload, "difference": integration.preload},
            "mean_off_m": float(np.abs(motion.hold_error).max()) if motion.hold_error.size else None,
            "contact_difference": integration.contact,
            "largest_difference": integration.largest,
            "stable": self.stable,
            "stable_by": self.stability_method,
            "steps_per_period": self.steps,
            "step_error": integration.step_error if np.isfinite(integration.step_error) else None,
            "periods": integration.periods,
            "drift": integration.drift,
            "outcome": str(integration.outcome),
            "seconds": self.seconds,
            "left_alone": None if self.left_alone is None else self._left_alone(self.left_alone),
        }

    def _left_alone(self, motion: FreeMotion) -> dict[str, Any]:
        names = self.balance.compliance.output_names
        return {
            "energy_J": motion.energy,
            "energy_spread_J": motion.energy_spread,
            "amplitude_m": dict(zip(names, motion.amplitude.tolist(), strict=True)),
            "amplitude_spread_m": dict(zip(names, motion.amplitude_spread.tolist(), strict=True)),
            "drift": motion.drift,
            "periods": motion.periods,
        }

    def lines(self) -> list[str]:
        record = self.record()
        worn = "unworn" if self.row is None else f"worn as in row {self.row}"
        harmonics = ", ".join(map(str, record["harmonics"]))
        shown = [("frequency", f"{self.hertz:.6g} Hz, {worn}, harmonics {harmonics}")]
        if self.rigid:
            shown += [("contact", "without springs in time: unilateral, planar Coulomb friction")]
        shown += [("", f"{'balance':>14} {'rigid' if self.rigid else 'time':>14} {'difference':>12}")]

        def row(name: str, ours: float, theirs: float, difference: float, unit: str) -> None:
            shown.append((name, f"{ours:14.6g} {theirs:14.6g} {difference:12.2%} {unit}"))

        for name, output in record["outputs"].items():
            row(name, output["balance_m"], output["time_m"], output["difference"], "m")
        energy, preload = record["energy"], record["preload"]
        row("energy", energy["balance_J"], energy["time_J"], energy["difference"], "J per cycle")
        row("preload", preload["balance_N"], preload["time_N"], preload["difference"], "N")
        for name, output in record["outputs"].items():
            shown.append((f"waveform {name}", f"{output['waveform_difference']:.2%} at the worst instant"))
        shown.append(("contact", f"{self.integration.contact:.2%} at the worst pair and instant"))
        if (off := record["mean_off_m"]) is not None:
            shown.append(("mean held", f"to {off:.1g} m of what is prescribed"))
        work = record["work"]
        rest = work["loads_J"] - work["damping_J"] - work["friction_J"]
        parts = "loads {loads_J:.6g} J, friction {friction_J:.6g} J, damping {damping_J:.6g} J".format(**work)
        shown.append(("work", f"{parts}: {rest:.1e} J unbalanced"))
        error = "unknown" if record["step_error"] is None else f"{record['step_error']:.1e}"
        shown.append(("time steps", f"{self.steps} per period, their own error {error}"))
        integration, stable = self.integration, STABLE_WORDS[self.stable]
        periodic = f"{integration.outcome}, {integration.periods} periods, drift {integration.drift:.1e}"
        shown += [("periodic", periodic), ("stable", f"{stable}, by {self.stability_method}")]
        if (motion := self.left_alone) is not None:
            spread = f"{motion.energy:.6g} J per cycle on average, spread {motion.energy_spread:.2g} J"
            shown.append(("left alone", f"{spread}, drift {motion.drift:.1e} after {motion.periods} periods"))
        return named_lines(shown)

    @property
    def failure(self) -> str:
        """Why there is no comparison, empty where there is one."""
        if self.integration.motion.periodic:
            return ""
        return f"the time integration found no periodic motion: {self.integration.outcome}"

    def write(self, folder: Path) -> list[Path]:
        """Write verify_FREQUENCY.png."""
        name = f"verify_{self.hertz:.6g}Hz{'' if self.row is None else f'_row{self.row}'}"
        return write_files(folder, {}, lambda: {name: self.plot()})

    def plot(self) -> Figure:
        """Waveform of the first output over a period, and the loop of the pair that dissipates most, both ways."""
        balance, state, motion = self.balance, self.solution.state, self.integration.motion
        angle = self.integration.omega * motion.time
        ours = balance.outputs(state)[0] @ balance.basis.functions(angle).T
        theirs = motion.outputs[0]
        mean = theirs.mean()
        with axes_of(9.0, 3.8, columns=2) as (figure, (waveform, loop)):
            unit, scale = length_unit(np.abs(theirs - mean).max())
            phase = angle / (2 * np.pi)
            waveform.plot(phase, scale * (theirs - mean), color=ORANGE, lw=3.0, alpha=0.6, label="time integration")
            waveform.plot(phase, scale * (ours - mean), color=BLUE, label="harmonic balance")
            name = balance.compliance.output_names[0]
            waveform.set(xlabel="period", ylabel=f"{name} about its mean / {unit}", title=f"{self.hertz:.6g} Hz")
            waveform.legend(loc="best")
            pair = int(np.argmax(np.abs(motion.energy)))
            step = np.roll(motion.x[pair], -1, axis=1) - np.roll(motion.x[pair], 1, axis=1)
            component = int(np.argmax(np.abs(np.sum(motion.force[pair] * step, axis=1))))  # of the largest work
            x, force = balance.history(state)
            unit, scale = length_unit(np.ptp(motion.x[pair, component]))
            unit_f, scale_f = force_unit(np.abs(motion.force[pair, component]).max())
            middle = motion.x[pair, component].mean()
            for a, b, style in (
                (motion.x, motion.force, {"color": ORANGE, "lw": 3.0, "alpha": 0.6}),
                (x, force, {"color": BLUE, "lw": 1.2}),
            ):
                closed = [np.append(v[pair, component], v[pair, component, 0]) for v in (a, b)]
                loop.plot(scale * (closed[0] - middle), scale_f * closed[1], **style)
            direction = balance.contact.components[component]
            loop.set(xlabel=f"{direction} / {unit}", ylabel=f"force / {unit_f}", title=f"Pair {pair}")
        return figure


@asks_consent
def verify(
    result: ResultSource,
    at: Frequency | None = None,
    *,
    row: int | None = None,
    steps: int | None = None,
    law: Literal["scene", "rigid"] = "scene",
    overrides: Overrides = (),
    allow_scripts: bool = False,
    progress: Report = None,
) -> TimeComparison:
    """Check a result against direct time integration of the same model.

    result : folder or file of a result
    at : frequency such as 410Hz; the peak of the response, or the frequency of the row, by default
    row : wear row whose depth the contact has; unworn by default
    steps : time steps per period; 256 or 32 for each harmonic by default, twice as many for a rigid contact
    law : of the contact in time: that of the scene, or without its springs (unilateral contact, Coulomb friction)
    allow_scripts : run Python files and drawings (.geo) that its scene names
    Raises  Refusal: the result has no such row or no solution to start from; SolveFailed: no balance solution"""
    result, report = result_of(result), reporter(progress)
    file, rigid = rebuilt(result, override_texts(overrides)), law == "rigid"
    scene, requested = file.scene, None if at is None else 2 * np.pi * at
    with limited(scene.solver.threads):
        unworn = modelling.build(file, report, result.harmonics).balance
        start = time.perf_counter()
        balance, omega, x = _start(result, scene, unworn, requested, row)
        target = omega if requested is None else requested
        if not 0 < target <= balance.omega_max:
            raise Refusal(
                f"{target / (2 * np.pi):g} Hz is outside what the scene models, up to "
                f"{balance.omega_max / (2 * np.pi):g} Hz: change response.frequency with --set"
            )
        with report.stage("harmonic balance"):
            solution = _walk(balance, omega, target, x, settings.newton_options(scene))
        if not solution.converged:
            raise SolveFailed(f"no balance at {target / (2 * np.pi):g} Hz: {solution.outcome}")
        steps = steps or (2 if rigid else 1) * steps_of(balance)
        with report.stage("time integration"):
            options = Options(steps, tolerance=TOLERANCE, max_periods=PERIODS, rigid=rigid)
            integration = march.verify(balance, solution.state, options)
            with_springs = replace(options, rigid=False)
            stable, reason = is_stable(balance, solution.state, None if rigid else integration, with_springs)
            free = None
            if not (stable or rigid) or not integration.motion.periodic:
                free = march_freely(balance, target, solution.state, LEFT_ALONE, options)
    seconds = time.perf_counter() - start
    return TimeComparison(balance, solution, integration, stable, reason, row, steps, seconds, free, rigid)


def _start(
    result: Result, scene: Scene, unworn: HarmonicBalance, at: float | None, row: int | None
) -> tuple[HarmonicBalance, float, np.ndarray]:
    """The problem, and the known solution to begin at: its frequency and x on the harmonics of the problem."""
    basis = HarmonicBasis(result.harmonics, scene.harmonics.samples)
    if row is not None:
        rows: Sequence[WearRow] = [] if result.wear is None else result.wear.rows()
        if not 0 <= row < len(rows):
            raise Refusal(f"the result has no wear row {row}: it has {f'0 to {len(rows) - 1}' if rows else 'none'}")
        worn = rows[row]
        load = settings.mission(scene)[0].load if scene.wear is not None else 1.0
        balance = unworn.worn(worn.depth).with_load(load)
        return balance, worn.omega, _carried(worn.displacement, basis, balance)
    frf = result.response
    good = [] if frf is None else np.flatnonzero(frf.converged).tolist()
    if frf is None or not good:
        raise Refusal("the result has no response curve to start from: run its scene first")
    best = frf.highest(frf.output_names[0]) if at is None else min(good, key=lambda i: abs(frf.omega[i] - at))
    return unworn, frf.omega[best], _carried(frf.contact[best], basis, unworn)


def _carried(flat: np.ndarray, basis: HarmonicBasis, balance: HarmonicBalance) -> np.ndarray:
    """A solution (n_contact, n_coeff) on the harmonics of a balance, as x (n_pair, n_component, n_coeff)."""
    return balance.shaped(basis.transfer(flat, balance.basis))


def _walk(
    balance: HarmonicBalance, omega: float, target: float, x: np.ndarray, options: newton.NewtonOptions
) -> Solution:
    """Natural steps from a known solution to a frequency; from rest where they fail."""
    count = 1 + int(np.ceil(abs(target / omega - 1) / STRIDE))
    for w in np.linspace(omega, target, count):
        solution = newton.solve(balance, w, x, options)
        if solution.converged:
            x = solution.state.x
    return solution if solution.converged else newton.solve_from_rest(balance, target, options)
