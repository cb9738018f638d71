"""Measured hysteresis loops: friction, tangential stiffness, energy and preload with intervals, for a scene."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from tribodyn.output_file import write_text
from tribodyn.refusal import Refusal
from tribodyn.workflows.pictures.figures import axes_of, length_unit
from tribodyn.workflows.pictures.matplotlib_names import Figure
from tribodyn.workflows.pictures.theme import BLUE, CYCLE, GREY, ORANGE
from tribodyn.workflows.result.number_format import measured, named_lines
from tribodyn.workflows.result.summary import plain
from tribodyn.workflows.scene.fields import Frequency, Number, quantity
from tribodyn.workflows.scene.scene_file import AnyPath
from tribodyn.workflows.studies.files import write_files
from tribodyn.workflows.studies.measured.channels import NONE, Channels, read_channels
from tribodyn.workflows.studies.measured.loop_cycles import ForceSeries, LoopCycles
from tribodyn.workflows.studies.measured.loop_evaluation import (
    STIFFNESS_RULES,
    LoopEvaluation,
    LoopEvaluator,
    LoopInterval,
)
from tribodyn.workflows.studies.measured.loop_rules import slides
from tribodyn.workflows.studies.study_result import StudyResult

CHANNELS = ("displacement", "tangential", "normal")
KEYS = {"friction": "friction", "stiffness": "tangential_stiffness"}  # of a contact
UNITS = {"friction": "", "stiffness": "N/m", "energy": "J", "preload": "N", "sliding": "m", "travel": "m", "delay": "s"}
REASONS = {
    "largest": "mean over cycles of the largest |T|/N: takes peaks and noise along",
    "plateau": "T = T_off +- mu N where it slides",
    "energy_sliding": "E / (4 N s), s half of the sliding range: takes the rise after reversal along",
    "energy_travel": "E / (4 N x), x half of the displacement's range: low by the elastic share of it",
    "reversal": "slope at reversal of a parabola through the flank",
    "window": "slope of a line over the window: low where slip begins within it",
}


@dataclass(frozen=True, repr=False)
class MeasuredLoops(StudyResult):
    """Loops of all runs of a measurement. source : its file; area : nominal, of the contact [m2]"""

    source: str
    runs: Mapping[str, LoopEvaluation]
    area: float | None

    @property
    def governing(self) -> LoopEvaluation:
        """The run with the largest sliding range, which the keys of the scene are taken from."""
        return max(self.runs.values(), key=lambda run: run.numbers["sliding"])

    def record(self) -> Any:
        runs = {}
        for name, run in self.runs.items():
            ends = {key: dict(zip(("value", "low", "high"), (i.value, *i.ends), strict=True))
                    for key, i in run.intervals.items()}  # fmt: skip
            cycles = {"frequency_hz": run.loop.cycles.frequency, "cycles": run.loop.cycles.count}
            states = {"running_in": run.running_in, "slides": slides(run.numbers)}
            runs[name] = {**cycles, **states, **ends, "rules": dict(run.rules)}
        return plain({"measurement": self.source, "runs": runs})

    def lines(self) -> list[str]:
        lines = []
        for name, run in self.runs.items():
            cycles, (x, force) = run.loop.cycles, run.loop.cycles.drift
            head = f"{cycles.count} cycles at {cycles.frequency:.5g} Hz, the first {run.running_in} left out"
            lines += named_lines([(name or "loops", head)])
            drift = f"displacement {measured(x, 'm')}, tangential force {measured(force, 'N')}, both taken off"
            lines += named_lines([("drift", drift)])
            for key, interval in run.intervals.items():
                lines.append(f"{key:14} {_text(key, interval.value):>12}   {_range(key, interval)}")
            if not slides(run.numbers):
                least = f"above {run.rules['largest']:.3g}, the largest T/N: the contact does not slide as a whole"
                lines += named_lines([("friction", least)])
            lines += ["by rule"]
            for rule, value in run.rules.items():
                key = "stiffness" if rule in STIFFNESS_RULES else "friction"
                if np.isfinite(value):
                    lines.append(f"  {rule:18} {_text(key, value):>12}   {REASONS[rule]}")
        return lines + self.scene_lines()

    def _determined(self) -> dict[str, tuple[LoopInterval, str]]:
        """What the governing run determines of a contact, by its key, and the unit that it is written in."""
        intervals = self.governing.intervals
        of_keys = {key: (intervals[name], UNITS[name]) for name, key in KEYS.items()}
        return {key: of for key, of in of_keys.items() if np.isfinite(of[0].value)}

    def scene_lines(self) -> list[str]:
        """The table of a contact, the ends of each interval behind its number."""
        lines = ["[contact]"]
        for key, (i, unit) in self._determined().items():
            value = f'{key} = "{i.value:.5g} {unit}"' if unit else f"{key} = {i.value:.4g}"
            lines.append(f"{value:40} # {i.ends[0]:.4g} to {i.ends[1]:.4g}")
        return lines

    def spread_lines(self) -> list[str]:
        """The same as distributions that a study draws from, each a normal one whose 95 % are the interval."""
        lines = ["[vary]"]
        for key, (i, unit) in self._determined().items():
            mean = f'"{i.value:.6g} {unit}"' if unit else f"{i.value:.6g}"
            cov = 100 * i.half / 1.96 / i.value
            lines.append(f'contact.{key} = {{ distribution = "normal", mean = {mean}, cov = "{cov:.3g} %" }}')
        return lines

    def tables(self) -> dict[str, dict[str, Any]]:
        """loops: a row for each run; rules: one for each rule; cycles: one for each group of cycles."""
        loops: dict[str, list[Any]] = {"run": [*self.runs]}
        for key, unit in UNITS.items():
            column = f"{key}_{unit.replace('/', '_per_')}".rstrip("_")
            of_runs = [(i.value, *i.ends) for i in (run.intervals[key] for run in self.runs.values())]
            ends = (column, f"{column}_low", f"{column}_high")
            loops |= dict(zip(ends, map(list, zip(*of_runs, strict=True)), strict=True))
        rows = [(run, rule, value) for run, of in self.runs.items() for rule, value in of.rules.items()]
        rules = dict(zip(("run", "rule", "value"), zip(*rows, strict=True), strict=True))
        history: dict[str, list[Any]] = {}
        for name, run in self.runs.items():
            columns: dict[str, Any] = {"run": [name] * len(run.history["cycle"]), **run.history}
            if self.area is not None:
                columns["energy_density_J_per_m2"] = run.history["work_J"] / self.area
            for key, values in columns.items():
                history.setdefault(key, []).extend(values)
        return {"loops": loops, "rules": rules, "cycles": history}

    def write(self, folder: Path) -> list[Path]:
        """Write loops.csv, rules.csv, cycles.csv, loops.png, contact.toml and vary.toml."""
        written = write_files(folder, self.tables(), lambda: {"loops": self.plot()})
        head = f"# from {self.source}\n"
        for name, lines in (("contact", self.scene_lines()), ("vary", self.spread_lines())):
            written.append(write_text(folder / f"{name}.toml", head + "\n".join(lines) + "\n"))
        return written

    def plot(self) -> Figure:
        """Loops of all runs, and forces of the governing one over its cycle between the limits of friction."""
        unit, scale = length_unit(max(run.numbers["travel"] for run in self.runs.values()))
        with axes_of(9.6, 4.2, columns=2, share=False) as (figure, (left, right)):
            for (name, run), color in zip(self.runs.items(), CYCLE * len(self.runs), strict=False):
                _, x, force, _ = run.samples
                left.plot(scale * x, force, ".", ms=1.5, color=color, label=name or None)
            left.set(xlabel=f"displacement over the contact / {unit}", ylabel="tangential force / N", title="loops")
            if len(self.runs) > 1:
                left.legend(fontsize=8)
            _draw_cycle(right, self.governing)
        return figure


def _draw_cycle(axes: Any, run: LoopEvaluation) -> None:
    phase, _, tangential, normal = run.samples
    axes.plot(phase, tangential, ".", ms=1.5, color=BLUE, label="tangential force")
    axes.plot(phase, normal, color=GREY, label="normal force")
    if slides(run.numbers):
        for friction, label in ((run.numbers["plateau"], "friction limit"), (-run.numbers["plateau"], None)):
            axes.plot(phase, run.numbers["offset"] + friction * normal, "--", color=ORANGE, label=label)
    axes.set(xlabel="phase / cycles", ylabel="force / N", title="one cycle")
    axes.legend(fontsize=8)


def _text(key: str, value: float, digits: int = 4) -> str:
    if not np.isfinite(value):
        return "-"
    return measured(value, UNITS[key], digits) if UNITS[key] else f"{value:.{digits}g}"


def _range(key: str, interval: LoopInterval) -> str:
    if not np.isfinite(interval.value):
        return "not determined"
    parts = ", ".join(f"{name} {_text(key, size, 2)}" for name, size in interval.parts.items() if size)
    return f"{_text(key, interval.ends[0])} to {_text(key, interval.ends[1])} ({parts})"


def loops(
    measurement: AnyPath,
    *,
    displacement: str | None = None,
    tangential: str | None = None,
    normal: str | None = None,
    rate: Frequency | None = None,
    frequency: Frequency | None = None,
    delay: Annotated[float | None, quantity("s")] = None,
    compliance: Annotated[float, quantity("m/N")] = 0.0,
    compliance_error: Number = 0.0,
    reading: Annotated[Sequence[float] | None, quantity("N")] = None,
    window: Annotated[Sequence[float] | None, quantity("")] = None,
    skip: int | None = None,
    area: Annotated[float | None, quantity("m2")] = None,
) -> MeasuredLoops:
    """Evaluate measured hysteresis loops: friction by all rules, stiffness, energy, preload; each with its interval.

    measurement : time series in a file .csv, .mat, .uff, .unv, .h5 or .hdf5; see docs/howto/fretting_rig.md
    displacement : channel, or linear combination of channels such as "x1 - x2"; the channel of that name by default
    tangential, normal : the same of the forces, such as "cos(45 deg)*F1 + cos(45 deg)*F2"; or "31 N"
    rate : samples per second, where there is no channel time
    frequency : about that of the cycles; that of the displacement by default
    delay : of the forces behind the displacement; it is found by default
    compliance : of the fixture, that is in the displacement; compliance_error : its standard error, as a share
    reading : static normal force before and after the record, such as "31 N, 30.5 N": takes the transducer's drift off
    window : shares of the elastic travel R / k between which a line is laid through a flank; 0.1, 0.5 by default
    skip : cycles at the beginning that are left out; those of the running-in by default
    area : nominal, of the contact: energy is then given per area too
    Raises  Refusal: a channel, unit or number of cycles that does not do"""
    window = (0.1, 0.5) if window is None else window
    if len(window) != 2 or not 0 <= window[0] < window[1] <= 1:
        raise Refusal(f"--window {', '.join(f'{w:g}' for w in window)}: give two shares such as 0.1, 0.5")
    if reading is not None and len(reading) != 2:
        raise Refusal('--reading: give two forces, before and after, such as "31 N, 30.5 N"')
    path = Path(measurement)
    facts, tables = read_channels(path, CHANNELS)
    names = {
        name: given or facts.get(name, name)
        for name, given in zip(CHANNELS, (displacement, tangential, normal), strict=True)
    }
    shares = window[0], window[1]
    evaluator = LoopEvaluator(compliance, compliance_error * compliance, shares, skip, reading is not None)
    try:
        cycles = {run.run: LoopCycles.of(_series(run, names, rate), frequency, reading) for run in tables}
        return MeasuredLoops(path.name, evaluator.runs(cycles, delay), area)
    except Refusal as trouble:
        raise Refusal(f"{path.name}: {trouble}") from None


def _series(run: Channels, names: Mapping[str, str], rate: float | None) -> ForceSeries:
    displacement, tangential, normal = (
        run.combined(names[name], unit) for name, unit in zip(CHANNELS, ("m", "N", "N"), strict=True)
    )
    if "time" in run.values:
        time = run.combined("time", "s") if run.values["time"][1].dimension != NONE.dimension else run.values["time"][0]
    elif rate is not None:
        time = np.arange(len(displacement)) / rate
    else:
        raise Refusal('no channel time: name one time [s], or give --rate, such as "10 kHz"')
    if not (np.diff(time) > 0).all():
        raise Refusal("time does not rise in every row: give the runs another name in a column run")
    return ForceSeries(time, displacement, tangential, normal)
