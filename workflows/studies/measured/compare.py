"""Compare a measurement with a scene: both overlaid, with the scatter of the measurement and a band of inputs."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from tribodyn.hbm.threads import limited
from tribodyn.refusal import Refusal
from tribodyn.workflows.pictures.figures import axes_of, length_unit, named
from tribodyn.workflows.pictures.matplotlib_names import Figure
from tribodyn.workflows.pictures.theme import BLUE, GREY, ORANGE
from tribodyn.workflows.result.number_format import named_lines
from tribodyn.workflows.result.summary import plain
from tribodyn.workflows.run import modelling
from tribodyn.workflows.run.progress import Report, reporter
from tribodyn.workflows.scene.scene_file import AnyPath, Overrides, SceneFile, Source, read_scene
from tribodyn.workflows.studies.files import write_files
from tribodyn.workflows.studies.measured.computed_runs import ComparedRun, compare_runs
from tribodyn.workflows.studies.measured.measurement import Measurement, Run, prepared
from tribodyn.workflows.studies.measured.reading import read
from tribodyn.workflows.studies.study_result import StudyResult


@dataclass(frozen=True)
class ColumnFormat:
    """How a quantity is printed and drawn: its word, unit, factor from SI, and whether its axis is logarithmic."""

    word: str
    unit: str
    factor: float = 1.0
    log: bool = False

    @property
    def label(self) -> str:
        """Of an axis."""
        return f"{self.word} / {self.unit}" if self.unit else self.word

    def value(self, x: float) -> str:
        """With its unit."""
        return f"{self.factor * x:.5g} {self.unit}" if np.isfinite(x) else "-"

    def off(self, x: float, sign: str = "+") -> str:
        """A difference: relative, of a phase in degrees."""
        relative = self.word != "phase"
        return f"{(100 if relative else 1) * x:{sign}.3g} {'%' if relative else 'deg'}" if np.isfinite(x) else "-"


@dataclass(frozen=True, repr=False)
class MeasurementComparison(StudyResult):
    """A measurement and a scene.

    name : of the scene; measured : in its directions, repeated runs as their mean
    runs : every run with what the scene computes; band : the same of every change of the scene, by the change"""

    name: str
    measured: Measurement
    runs: tuple[ComparedRun, ...]
    band: Mapping[str, tuple[ComparedRun, ...]]

    @property
    def abscissa(self) -> str:
        """Column over which the others are compared."""
        return {"response": "frequency_hz", "backbone": "amplitude_m", "modes": "number"}[self.measured.kind]

    def rows(self) -> list[dict[str, Any]]:
        """A row for each measured point; `X` measured, `computed_X`, `X_difference` (relative, of a phase absolute)."""
        table = []
        for k, run in enumerate(self.runs):
            measured, computed = self._columns(run.measured), self._columns(run.computed)
            columns: dict[str, np.ndarray] = {self.abscissa: measured.pop(self.abscissa)}
            for name, values in measured.items():
                columns |= {name: values, f"computed_{name}": computed[name]}
                columns[f"{name}_difference"] = _difference(name, values, computed[name])
                if self.band:
                    variants = [computed[name], *(self._columns(b[k].computed)[name] for b in self.band.values())]
                    columns |= {f"least_{name}": np.min(variants, axis=0), f"most_{name}": np.max(variants, axis=0)}
            for name, errors in self._errors(run.measured).items():
                columns[f"{name}_scatter"] = errors
            rows = np.array([*columns.values()]).T
            table += [{"run": run.measured.name, **dict(zip(columns, map(float, row), strict=True))} for row in rows]
        return table

    def _columns(self, run: Run) -> dict[str, np.ndarray]:
        """What is compared, and over what."""
        if self.measured.kind == "response":
            phase = {"phase_deg": np.degrees(np.angle(run.displacement))} if self.measured.phased else {}
            return {"frequency_hz": run.frequency, "amplitude_m": run.amplitude, **phase}
        columns = {"frequency_hz": run.frequency, "damping": run.damping}
        if self.measured.kind == "modes":
            return {"number": np.arange(1.0, 1 + len(run.frequency)), **columns}
        return {"amplitude_m": run.amplitude, **columns, "force_N": run.force}

    def _errors(self, run: Run) -> dict[str, np.ndarray]:
        """Relative scatter of what has one."""
        names = ("", "amplitude_m") if self.measured.kind == "response" else ("frequency_hz", "damping")
        return {n: e for n, e in zip(names, run.errors.T, strict=True) if n and np.isfinite(e).any()}

    def largest(self) -> dict[str, float | None]:
        """Largest difference of every quantity over all points that the scene reaches, None where there is none."""
        rows, largest_by_name = self.rows(), {}
        for name in (n for n in rows[0] if n.endswith("_difference")):
            sizes = [abs(row[name]) for row in rows if np.isfinite(row[name])]
            largest_by_name[name] = max(sizes) if sizes else None
        return largest_by_name

    def peaks(self) -> list[dict[str, Any]]:
        """Of every run of a response: frequency and amplitude of the highest point, measured and computed."""
        peaks_of_runs = []
        for run in self.runs if self.measured.kind == "response" else ():
            tops = [(r.frequency[i], r.amplitude[i]) for r in (run.measured, run.curve) for i in [r.amplitude.argmax()]]
            row: dict[str, Any] = {"run": run.measured.name, "force_N": float(run.computed.force[0])}
            for name, ours, theirs in zip(("frequency_hz", "amplitude_m"), tops[1], tops[0], strict=True):
                difference = float(ours / theirs - 1)
                row |= {name: float(theirs), f"computed_{name}": float(ours), f"{name}_difference": difference}
            peaks_of_runs.append(row)
        return peaks_of_runs

    def record(self) -> dict[str, Any]:
        return {
            "scene": self.name, "measurement": self.measured.source, "kind": self.measured.kind,
            "rows": plain(self.rows()),
            "peaks": self.peaks(), "largest": self.largest(), "outside": self._outside(),
            "unused": [*self.measured.unused],
        }  # fmt: skip

    def _outside(self) -> int:
        """Points that the scene does not reach."""
        first = "amplitude_m" if self.measured.kind == "response" else "frequency_hz"
        return sum(not np.isfinite(row[f"computed_{first}"]) for row in self.rows())

    def _shown(self) -> dict[str, ColumnFormat]:
        unit, scale = length_unit(max(float(np.nan_to_num(run.measured.amplitude).max()) for run in self.runs))
        return {
            "number": ColumnFormat("mode", ""),
            "frequency_hz": ColumnFormat("frequency", "Hz"),
            "damping": ColumnFormat("damping", "%", 100.0, log=True),
            "amplitude_m": ColumnFormat("amplitude", unit, scale, log=True),
            "phase_deg": ColumnFormat("phase", "deg"),
            "force_N": ColumnFormat("force", "N", log=True),
        }

    def lines(self) -> list[str]:
        """For people: peaks or points, measured, computed and the difference; the largest of all points below."""
        rows, shown = self.peaks() or self.rows(), self._shown()
        names = [n for n in shown if f"{n}_difference" in rows[0] and any(np.isfinite(row[n]) for row in rows)]
        first = [] if self.measured.kind == "response" else [self.abscissa]
        heads = [shown[n].word for n in first] + [w for n in names for w in (shown[n].word, "computed", "")]
        table = [f"{'run':20}" + "".join(f"{head:>13}" for head in heads)]
        for row in rows:
            cells = [shown[n].value(row[n]) for n in first]
            for n in names:
                cells += [shown[n].value(row[n]), shown[n].value(row[f"computed_{n}"])]
                cells.append(shown[n].off(row[f"{n}_difference"]))
            table.append(f"{row['run'][:20]:20}" + "".join(f"{cell:>13}" for cell in cells))
        off = {n.removesuffix("_difference"): v for n, v in self.largest().items() if v is not None}
        table += named_lines((f"{shown[n].word} off", f"{shown[n].off(v, '')} at most") for n, v in off.items())
        outside, unused = self._outside(), self.measured.unused
        table += named_lines([("outside", f"{outside} points, not reached")] if outside else [])
        return [*table, *named_lines([("left out", "; ".join(unused))] if unused else [])]

    def write(self, folder: Path) -> list[Path]:
        """Write compare.csv and compare.png."""
        rows = self.rows()
        columns = {n: [row[n] for row in rows] for n in rows[0]}
        return write_files(folder, {"compare": columns}, lambda: {"compare": self.plot()})

    def plot(self) -> Figure:
        """Amplitude, phase and force over frequency, or frequency, damping and force over amplitude."""
        shown, place = self._shown(), self.abscissa
        columns = [self._columns(run.measured) for run in self.runs]
        names = [n for n in columns[0] if n != place and any(np.isfinite(c[n]).any() for c in columns)]
        names += ["force_N"] if self.measured.kind == "response" else []
        with axes_of(7.2, 1.0 + 2.4 * len(names), rows=len(names)) as (figure, panes_of_names):
            columns_of_runs = np.atleast_1d(panes_of_names)
            for axes, name in zip(columns_of_runs, names, strict=True):
                for k, run in enumerate(self.runs):
                    once = "" if not k else "_"  # in the legend
                    for other in self.band.values():
                        self._draw(axes, name, other[k].curve, fmt="-", color=GREY, label=f"{once}changed")
                    look = {"fmt": "os^dv"[k % 5], "color": ORANGE, "ms": 3.5, "mfc": "none"}
                    self._draw(axes, name, run.measured, label=f"measured, {run.measured.name}", **look)
                    curve, mark = (run.computed, "x") if self.measured.kind == "modes" else (run.curve, "-")
                    self._draw(axes, name, curve, fmt=mark, color=BLUE, label=f"{once}computed")
                axes.set(ylabel=shown[name].label, yscale="log" if shown[name].log else "linear")
            columns_of_runs[-1].set(xlabel=shown[place].label, xscale="log" if shown[place].log else "linear")
            columns_of_runs[0].set_title(named(self.name, f"beside {self.measured.source}"))
            columns_of_runs[0].legend(fontsize=9)
        return figure

    def _draw(self, axes: Any, name: str, run: Run, **look: Any) -> None:
        """A quantity of a run, with its scatter."""
        formats, columns = self._shown(), {**self._columns(run), "force_N": run.force}
        x, y = (formats[n].factor * columns[n] for n in (self.abscissa, name))
        error = self._errors(run).get(name)
        axes.errorbar(x, y, None if error is None else np.nan_to_num(error) * y, lw=1.1, **look)


def compare(
    scene: Source,
    measurement: AnyPath,
    *,
    facts: Sequence[str] = (),
    resonance: bool = False,
    band: Sequence[str] = (),
    overrides: Overrides = (),
    progress: Report = None,
) -> MeasurementComparison:
    """Put a measurement beside what a scene computes: response, backbone, free decay or modes.

    scene : name of a scene or a .toml file
    measurement : file .csv, .mat, .uff or .unv; its columns are those of docs/howto/measurements.md
    facts : what the file does not say, such as "direction=-z" or "output=tip"; can be repeated
    resonance : take each run of a response as one point of a backbone, its resonance; so are runs of constant response
    band : compute it again with this changed, such as "contact.friction=0.4", or several keys joined by ";"; the range
        of all is the band of the inputs; can be repeated
    Raises  Refusal for a measurement that cannot be read or does not belong to the scene; SolveFailed"""
    report = reporter(progress)
    measured = read(Path(measurement), dict(_named(text) for text in facts))
    files = changed(scene, overrides, band)
    base_runs = files[""]
    try:
        measured = prepared(measured, base_runs.scene, resonance)
        runs_by_change = {}
        for change, file in files.items():
            with limited(file.scene.solver.threads):
                model = modelling.build(file, report)
                measured.check_position(file.scene, model.part)
                runs_by_change[change] = compare_runs(file, model, measured, report)
    except Refusal as trouble:
        raise Refusal(f"{measured.source}: {trouble}") from None
    first = runs_by_change.pop("")
    return MeasurementComparison(base_runs.name, measured, first, runs_by_change)


def changed(scene: Source, overrides: Overrides, changes: Sequence[str]) -> dict[str, SceneFile]:
    """The scene, and the scene with each of the changes; raises SceneError for one that it does not know."""
    base = read_scene(scene, overrides)
    keys_of = {change: [override.strip() for override in change.split(";") if override.strip()] for change in changes}
    return {"": base} | {change: base.changed(*keys) for change, keys in keys_of.items()}


def _named(text: str) -> tuple[str, str]:
    name, equals, value = text.partition("=")
    if not equals:
        raise Refusal(f'--fact {text}: give a name and what it is, such as "direction=-z"')
    return name.strip(), value.strip()


def _difference(name: str, measured: np.ndarray, computed: np.ndarray) -> np.ndarray:
    """Relative difference; of a phase in degrees, the shorter way round."""
    if name == "phase_deg":
        return np.asarray((computed - measured + 180) % 360 - 180)
    return np.asarray(computed / measured - 1)
