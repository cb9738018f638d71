"""A measurement beside a scene: both overlaid, with the scatter of the one and the band of the other's inputs."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from tribodyn.hbm.threads import limited
from tribodyn.workflows.pictures.figures import axes_of, length_unit, named
from tribodyn.workflows.pictures.style import BLUE, GREY, ORANGE
from tribodyn.workflows.result.columns import named_lines
from tribodyn.workflows.run import modelling
from tribodyn.workflows.run.progress import Report, reporter
from tribodyn.workflows.scene.source import AnyPath, Overrides, Source
from tribodyn.workflows.studies.files import write_files
from tribodyn.workflows.studies.measured.beside import Beside, beside
from tribodyn.workflows.studies.measured.measurement import Measurement, Run
from tribodyn.workflows.studies.measured.reading import read
from tribodyn.workflows.studies.measured.resonance import prepared
from tribodyn.workflows.studies.variation import changed

WHAT = {
    "frequency_hz": "frequency",
    "damping": "damping",
    "force_N": "force",
    "amplitude_m": "amplitude",
    "phase_deg": "phase",
}


@dataclass(frozen=True)
class Compared:
    """A measurement and a scene.

    name : of the scene; measured : in its directions, repeated runs as their mean
    runs : every run with what the scene computes; band : the same of every change of the scene, by the change
    """

    name: str
    measured: Measurement
    runs: tuple[Beside, ...]
    band: Mapping[str, tuple[Beside, ...]]

    def rows(self) -> list[dict[str, Any]]:
        """A row for each measured point; `X` measured, `computed_X`, `X_difference` (relative, of a phase absolute)."""
        found = []
        for k, one in enumerate(self.runs):
            others = [changed_runs[k] for changed_runs in self.band.values()]
            measured, computed = (self._quantities(run) for run in (one.measured, one.computed))
            least, most = (
                {name: limit([self._quantities(b.computed)[name] for b in (one, *others)], axis=0) for name in computed}
                for limit in (np.min, np.max)
            )
            for i in range(len(one.measured.frequency)):
                row: dict[str, Any] = {"run": one.measured.name}
                if self.measured.kind == "response":
                    row["frequency_hz"] = float(one.measured.frequency[i])
                if self.measured.kind == "backbone":
                    row["amplitude_m"] = float(one.measured.amplitude[i])
                for name, values in measured.items():
                    ours, theirs = float(computed[name][i]), float(values[i])
                    row |= {name: theirs, f"computed_{name}": ours, f"{name}_difference": _apart(name, theirs, ours)}
                    if others:
                        row |= {f"least_{name}": float(least[name][i]), f"most_{name}": float(most[name][i])}
                for name, errors in zip(self._scattered(), one.measured.errors[i], strict=True):
                    if np.isfinite(errors) and name in measured:
                        row[f"{name}_scatter"] = float(errors)
                found.append(row)
        return found

    def _quantities(self, run: Run) -> dict[str, np.ndarray]:
        """What is compared at the points of a run."""
        if self.measured.kind != "response":
            found = {"frequency_hz": run.frequency, "damping": run.damping}
            return found | ({"force_N": run.force} if self.measured.kind == "backbone" else {})
        phase = {"phase_deg": np.degrees(np.angle(run.displacement))} if self.measured.phased else {}
        return {"amplitude_m": run.amplitude, **phase}

    def _scattered(self) -> tuple[str, str]:
        return "frequency_hz", "amplitude_m" if self.measured.kind == "response" else "damping"

    def largest(self) -> dict[str, float | None]:
        """Largest difference of every quantity over all points that the scene reaches, None where there is none."""
        rows, found = self.rows(), {}
        for name in dict.fromkeys(n for row in rows for n in row if n.endswith("_difference")):
            sizes = [abs(row[name]) for row in rows if np.isfinite(row.get(name, np.nan))]
            found[name] = max(sizes) if sizes else None
        return found

    def peaks(self) -> list[dict[str, Any]]:
        """Of every run of a response: frequency and amplitude of the highest point, measured and computed."""
        found = []
        for one in self.runs if self.measured.kind == "response" else ():
            row: dict[str, Any] = {"run": one.measured.name, "force_N": float(one.computed.force[0])}
            for name, run in (("", one.measured), ("computed_", one.curve)):
                top = int(run.amplitude.argmax())
                row |= {
                    f"{name}frequency_hz": float(run.frequency[top]),
                    f"{name}amplitude_m": float(run.amplitude[top]),
                }
            for name in ("frequency_hz", "amplitude_m"):
                row[f"{name}_difference"] = row[f"computed_{name}"] / row[name] - 1
            found.append(row)
        return found

    def record(self) -> dict[str, Any]:
        """For machines, SI units; what is not known is None."""
        rows = [{n: None if v != v else v for n, v in row.items()} for row in self.rows()]
        return {
            "scene": self.name, "measurement": self.measured.source, "kind": self.measured.kind, "rows": rows,
            "peaks": self.peaks(), "largest": self.largest(), "outside": self._outside(),
        }  # fmt: skip

    def _outside(self) -> int:
        """Points that the scene does not reach."""
        key = "computed_amplitude_m" if self.measured.kind == "response" else "computed_frequency_hz"
        return sum(not np.isfinite(row[key]) for row in self.rows())

    def lines(self) -> list[str]:
        """For people: peaks or points, measured, computed and the difference."""
        told = {
            f"largest {name.removesuffix('_difference')}": "nothing to compare" if v is None else _difference(name, v)
            for name, v in self.largest().items()
        }
        if outside := self._outside():
            told["outside"] = f"{outside} points are beyond what the scene computes"
        return [*self._table(), *named_lines((name.split("_")[0] + " off", text) for name, text in told.items())]

    def _table(self) -> Iterator[str]:
        rows = self.peaks() or self.rows()
        names = [n for n in WHAT if f"computed_{n}" in rows[0] and any(np.isfinite(row[n]) for row in rows)]
        first = "amplitude_m" if self.measured.kind == "backbone" else "run"
        yield (
            f"{'run':24}"
            + (f"{'amplitude':>12}" if first != "run" else "")
            + "".join(f"{WHAT[n]:>12}{'computed':>12}{'':>10}" for n in names)
        )
        for row in rows:
            cells = "".join(
                f"{_shown(n, row[n]):>12}{_shown(n, row[f'computed_{n}']):>12}"
                f"{_difference(n, row[f'{n}_difference'], True):>10}"
                for n in names
            )
            yield f"{row['run'][:23]:24}" + (f"{_shown(first, row[first]):>12}" if first != "run" else "") + cells

    def write(self, folder: Path) -> list[Path]:
        """Write compare.csv and compare.png."""
        rows = self.rows()
        names = list(dict.fromkeys(name for row in rows for name in row))
        columns = {name: [row.get(name, "") for row in rows] for name in names}
        return write_files(folder, {"compare": columns}, {"compare": self.plot()})

    def plot(self) -> Figure:
        """Amplitude, phase and force over frequency, or frequency, damping and force over amplitude."""
        first = self._quantities(self.runs[0].measured)
        known = [n for n in first if any(np.isfinite(self._quantities(one.measured)[n]).any() for one in self.runs)]
        names = [*known, *(["force_N"] if self.measured.kind == "response" else [])]
        unit, scale = length_unit(
            max(float(one.measured.amplitude.max()) for one in self.runs) if self.measured.kind != "modes" else 1.0
        )
        with axes_of(7.2, 1.0 + 2.4 * len(names), rows=len(names)) as (figure, found):
            for axes, name in zip(np.atleast_1d(found), names, strict=True):
                for k, one in enumerate(self.runs):
                    self._draw(axes, name, k, one, scale)
                axes.set_ylabel(
                    {
                        "amplitude_m": f"amplitude / {unit}",
                        "frequency_hz": "frequency / Hz",
                        "damping": "damping ratio / %",
                        "force_N": "force / N",
                        "phase_deg": "phase / deg",
                    }[name]
                )
                if name in ("amplitude_m", "damping", "force_N") and self.measured.kind != "modes":
                    axes.set_yscale("log")
            along = {"response": "frequency / Hz", "backbone": f"amplitude / {unit}", "modes": "frequency / Hz"}
            axes.set_xlabel(along[self.measured.kind])
            if self.measured.kind == "backbone":
                axes.set_xscale("log")
            top = np.atleast_1d(found)[0]
            top.set_title(named(self.name, f"beside {self.measured.source}"))
            top.legend(fontsize=9)
        return figure

    def _draw(self, axes: Any, name: str, k: int, one: Beside, scale: float) -> None:
        def place(run: Run) -> np.ndarray:
            return scale * run.amplitude if self.measured.kind == "backbone" else run.frequency

        def height(run: Run) -> np.ndarray:
            factor = {"damping": 100.0, "amplitude_m": scale}.get(name, 1.0)
            return factor * (run.force if name == "force_N" else self._quantities(run)[name])

        for other in self.band.values():
            axes.plot(
                place(other[k].curve), height(other[k].curve), color=GREY, lw=0.8, label="changed" if not k else None
            )
        marks = {"color": ORANGE, "marker": "os^dv"[k % 5], "ms": 3.5, "ls": "", "mfc": "none"}
        errors = dict(zip(self._scattered(), one.measured.errors.T, strict=True)).get(name)
        x, y = place(one.measured), height(one.measured)
        if errors is not None and np.isfinite(errors).any():
            axes.errorbar(x, y, yerr=y * np.nan_to_num(errors), color=ORANGE, lw=0.8, ls="")
        axes.plot(x, y, label=f"measured, {one.measured.name}", **marks)
        if self.measured.kind == "modes":
            axes.plot(place(one.computed), height(one.computed), "x", color=BLUE, label="computed")
        else:
            axes.plot(place(one.curve), height(one.curve), color=BLUE, lw=1.2, label="computed" if not k else None)


def compare(
    scene: Source,
    measurement: AnyPath,
    *,
    facts: Sequence[str] | Mapping[str, str] = (),
    resonance: bool = False,
    band: Sequence[str] = (),
    overrides: Overrides = (),
    progress: Report = None,
) -> Compared:
    """Put a measurement beside what a scene computes: response, backbone, free decay or modes.

    scene : name of a scene or a .toml file
    measurement : file .csv, .mat, .uff or .unv; its columns are those of docs/howto/measurements.md
    facts : what the file does not say, such as "direction=-z" or "output=tip"; can be repeated
    resonance : take each run of a response as one point of a backbone, its resonance; so are runs of constant response
    band : compute it again with this changed, such as "contact.friction=0.4", or several keys joined by ";"; the range
        of all is the band of the inputs; can be repeated
    Raises  ValueError for a measurement that cannot be read or does not belong to the scene; SolveFailed
    """
    report = reporter(progress)
    given = facts if isinstance(facts, Mapping) else dict(_named(text) for text in facts)
    measured = read(Path(measurement), given)
    files = changed(scene, overrides, band)
    own = files[""]
    try:
        measured = prepared(measured, own.scene, resonance)
        found = {}
        for change, file in files.items():
            with limited(file.scene.solver.threads):
                model = modelling.build(file, None, report)
                measured.near(file.scene, model.part)
                found[change] = beside(file, model, measured, report)
    except ValueError as trouble:
        raise ValueError(f"{measured.source}: {trouble}") from None
    first = found.pop("")
    return Compared(own.name, measured, first, found)


def _named(text: str) -> tuple[str, str]:
    name, equals, value = text.partition("=")
    if not equals:
        raise ValueError(f'--fact {text}: give a name and what it is, such as "direction=-z"')
    return name.strip(), value.strip()


def _apart(name: str, measured: float, computed: float) -> float:
    """Relative difference; of a phase in degrees, the shorter way round."""
    if name == "phase_deg":
        return float((computed - measured + 180) % 360 - 180)
    return computed / measured - 1 if measured else np.nan


def _difference(name: str, value: float, signed: bool = False) -> str:
    if value != value:
        return "-"
    number = f"{value if name.startswith('phase') else 100 * value:{'+' if signed else ''}.3g}"
    return f"{number} {'deg' if name.startswith('phase') else '%'}"


def _shown(name: str, value: float) -> str:
    if value != value:
        return "-"
    if name == "amplitude_m":
        unit, scale = length_unit(value)
        return f"{scale * value:.4g} {unit}"
    unit, scale = {"damping": ("%", 100.0), "force_N": ("N", 1.0), "frequency_hz": ("Hz", 1.0)}.get(name, ("deg", 1.0))
    return f"{scale * value:.5g} {unit}"
