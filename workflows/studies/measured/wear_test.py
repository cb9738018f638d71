"""Replay a test plan: wear at an operating point, and at marks on the way sweeps at several forces and scans.

The wear is that of the scene's rule; between its steps the depth grows in proportion to the cycles. A sweep is the
response curve of the contact as worn at its mark."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from tribodyn.hbm.threads import limited
from tribodyn.hbm.wear.history import LIFE_SHARE, WearHistory
from tribodyn.refusal import Refusal, SolveFailed
from tribodyn.workflows.pictures.figures import axes_of, named
from tribodyn.workflows.pictures.maps import draw_field
from tribodyn.workflows.pictures.matplotlib_names import Figure, mpl
from tribodyn.workflows.pictures.theme import BLUE, ORANGE, WEAR_MAP
from tribodyn.workflows.result.number_format import named_lines
from tribodyn.workflows.result.result import Patch
from tribodyn.workflows.run import modelling, pipeline, response_curve, settings, wear_run
from tribodyn.workflows.run.progress import Progress, Report, reporter
from tribodyn.workflows.scene.scene_file import AnyPath, Overrides, SceneFile, Source, read_scene
from tribodyn.workflows.studies.files import write_files
from tribodyn.workflows.studies.measured.measurement import driving_load
from tribodyn.workflows.studies.measured.reading import column_numbers, csv_columns
from tribodyn.workflows.studies.study_result import StudyResult

Columns = dict[str, np.ndarray]


@dataclass(frozen=True, repr=False)
class ReplayedTest(StudyResult):
    """A wear test as a scene runs it.

    tables : columns by name: "marks", a row for each; "peaks" and "sweeps", the highest and all points of the response
        curves; "scans", a row for each pair and scan; "loops" at scans; "compared", a measurement with what is computed
    end : of the wear, a sentence"""

    name: str
    patch: Patch
    tables: Mapping[str, Columns]
    end: str

    def _shown(self) -> dict[str, Columns]:
        return {name: self.tables[name] for name in ("marks", "peaks", "compared") if self.tables[name]}

    def record(self) -> dict[str, Any]:
        tables = {name: {key: c.tolist() for key, c in table.items()} for name, table in self._shown().items()}
        return {"scene": self.name, "end": self.end, **tables}

    def lines(self) -> list[str]:
        """For people: what is measured at every mark, the highest point of every sweep, and the measurement."""
        lines = []
        for columns in self._shown().values():
            lines += ["".join(f"{name:>24}" for name in columns)]
            lines += ["".join(f"{value:24.5g}" for value in row) for row in zip(*columns.values(), strict=True)]
        return [*lines, *named_lines([("wear", self.end)])]

    def write(self, folder: Path) -> list[Path]:
        """Write test_*.csv and test_*.png."""
        tables = {f"test_{name}": table for name, table in self.tables.items() if table and len(table["cycles"])}
        return write_files(folder, tables, self._pictures)

    def _pictures(self) -> Mapping[str, Figure]:
        drawn = {"evolution": self._evolution(), "scans": self._depths()}
        drawn["loops"] = self._by_cycles("loops", "displacement_m", "friction_N")
        if len(self.tables["sweeps"]["cycles"]):
            drawn["sweeps"] = self._by_cycles("sweeps", "frequency_hz", "amplitude_m")
        return {f"test_{name}": figure for name, figure in drawn.items()}

    def _by_cycles(self, name: str, x: str, y: str) -> Figure:
        """Curves of a table, coloured by cycles, a pane for each force of the load."""
        table = self.tables[name]
        force = table.get("force_N", np.zeros(len(table[x])))
        levels = np.unique(force)[::-1]
        with axes_of(7.2, 1.2 + 2.6 * len(levels), rows=len(levels)) as (figure, panes):
            for pane, level in zip(np.atleast_1d(panes), levels, strict=True):
                for cycles in np.unique(table["cycles"]):
                    at = (table["cycles"] == cycles) & (force == level)
                    colour = mpl.colormaps[WEAR_MAP](0.9 * cycles / max(table["cycles"].max(), 1.0))
                    pane.plot(table[x][at], table[y][at], color=colour, label=f"{cycles:.3g} cycles")
                scale = "log" if (table[y] > 0).all() else "linear"
                pane.set(xlabel=_label(x), ylabel=_label(y), yscale=scale, title=f"{level:g} N" if level else "")
            handles, labels = np.atleast_1d(panes)[0].get_legend_handles_labels()
            step = max(len(handles) // 6, 1)
            figure.legend(handles[::step], labels[::step], loc="outside right upper", fontsize=8)
            figure.suptitle(named(self.name, f"{name} of the worn contact"), x=0.01, ha="left")
        return figure

    def _evolution(self) -> Figure:
        """Preload over work and cycles, energy per cycle and worn share of the face over cycles."""
        shown = (("work_J", "preload_N"), ("cycles", "preload_N"), ("cycles", "energy_J"), ("cycles", "worn_share"))
        marks, compared = self.tables["marks"], self.tables["compared"]
        with axes_of(9.2, 6.4, rows=2, columns=2) as (figure, panes):
            for pane, (x, y) in zip(panes.ravel(), shown, strict=True):
                pane.plot(marks[x], marks[y], color=BLUE, label="computed")
                if {x, y} <= compared.keys():
                    pane.plot(compared[x], compared[y], "o", color=ORANGE, mfc="none", label="measured")
                pane.set(xlabel=_label(x), ylabel=_label(y))
            panes[0, 0].legend(fontsize=9)
            figure.suptitle(named(self.name, "wear test"), x=0.01, ha="left")
        return figure

    def _depths(self) -> Figure:
        """Depth of the faces at every scan."""
        table = self.tables["scans"]
        scans, most = np.unique(table["cycles"]), 1e6 * float(table["depth_m"].max())
        columns = min(4, len(scans))
        rows = -(-len(scans) // columns)
        with axes_of(1.0 + 2.6 * columns, 0.8 + 1.9 * rows, rows, columns=columns) as (figure, panes):
            for pane in np.ravel(panes)[len(scans) :]:
                pane.axis("off")
            for pane, at in zip(np.ravel(panes), scans, strict=False):
                shown = draw_field(pane, self.patch, 1e6 * table["depth_m"][table["cycles"] == at], WEAR_MAP, most)
                pane.set_title(f"{at:.3g} cycles", fontsize=9)
            figure.colorbar(shown, ax=np.ravel(panes).tolist(), label="depth / µm")
        return figure


def replay(
    scene: Source, *, measurement: AnyPath | None = None, overrides: Overrides = (), progress: Report = None
) -> ReplayedTest:
    """Replay the test plan of a scene: wear, and at its marks sweeps at several forces, scans and loops.

    scene : name of a scene with [test], or a .toml file
    measurement : .csv file with a column cycles, perhaps force_N, and columns of the results, such as preload_N,
        energy_J, worn_share, volume_m3 at marks or frequency_hz, amplitude_m of the peaks at a force: row by row
    Raises  Refusal for a scene without [test] or [wear] or a measurement without such columns; SolveFailed"""
    file, report = read_scene(scene, overrides), reporter(progress)
    plan = file.scene.test
    if plan is None or not file.scene.wears:
        raise Refusal(f"{file.name}: study test needs [wear] and [test], such as marks = 9, in the scene")
    with limited(file.scene.solver.threads):
        model = modelling.build(file, report)
        with report.stage("wear"):
            history = wear_run.worn_out(file, model, file.scene.wear_table.lost_below or LIFE_SHARE)
        if history.ended.failed:
            raise SolveFailed(f"wear step {len(history.cycles)}: {history.end}")
        patch = pipeline.described(file, model.part, model.balance).patch
        marks = plan.cycles(float(history.cycles[-1]))
        scanned = marks[plan.is_scanned(len(marks))]
        tables = {"marks": _at_marks(history, patch.area, marks), **_swept(file, model, history, marks, report)}
        tables["loops"] = _loops(model, history, patch.area, scanned)
    pairs = [np.column_stack([np.full(len(patch.area), c), patch.points, _depth(history, c)]) for c in scanned]
    tables["scans"] = _columns("cycles x_m y_m z_m depth_m", [rows.T for rows in pairs])
    tables["compared"] = {} if measurement is None else _compared(tables, Path(measurement))
    return ReplayedTest(file.name, patch, tables, str(history.end))


def _depth(history: WearHistory, cycles: float) -> np.ndarray:
    """(n_pair,) depth at a number of cycles [m]."""
    return np.array([np.interp(cycles, history.cycles, column) for column in history.depth.T])


def _columns(names: str, parts: list[np.ndarray]) -> Columns:
    """Columns by their names of parts (n_column, n_row) one below the other."""
    rows = np.concatenate([np.zeros((len(names.split()), 0)), *parts], axis=1)
    return dict(zip(names.split(), rows, strict=True))


def _label(name: str) -> str:
    """Of an axis, the unit behind the word."""
    word, _, unit = name.rpartition("_")
    return f"{word} / {unit.capitalize() if unit == 'hz' else unit}" if len(unit) < 3 else name.replace("_", " ")


def _at_marks(history: WearHistory, area: np.ndarray, marks: np.ndarray, noise: float = 1e-7) -> Columns:
    """Work, preload, energy per cycle, worn share, volume and depth at the marks.

    noise : depth from which on a pair counts as worn [m], what a profilometer tells from noise"""
    rest, work = history.preload_at_rest, history.work.sum(axis=1)
    preload = history.preload if rest is None or not np.isfinite(rest).all() else rest
    rows = {"work_J": np.cumsum(work) - work, "preload_N": preload, "energy_J": history.energy.sum(axis=1)}
    depth = np.array([_depth(history, cycles) for cycles in marks])
    columns = {"cycles": marks} | {name: np.interp(marks, history.cycles, values) for name, values in rows.items()}
    worn = (depth > noise) @ area / area.sum()
    return columns | {"worn_share": worn, "volume_m3": depth @ area, "depth_m": depth.max(axis=1)}


def _swept(
    file: SceneFile, model: modelling.Model, history: WearHistory, marks: np.ndarray, report: Progress
) -> dict[str, Columns]:
    """The highest, of amplitude nan where a curve ends early, and all points of the curves at every mark and force."""
    assert file.scene.test is not None
    forces, points, tops = file.scene.test.sweeps, list[np.ndarray](), list[np.ndarray]()
    scale = abs(driving_load(file.scene)[1]) if forces else 1.0
    with report.track("sweeps") as advance:
        for i, cycles in enumerate(marks):
            worn = model.balance.worn(_depth(history, cycles))
            for force in forces:
                advance(i / len(marks), f"{cycles:.3g} cycles, {force:g} N")
                branch = response_curve.follow_response(file.scene, worn.with_load(force / scale))
                height = branch.amplitude(settings.OUTPUT)
                curve = np.stack([np.full(len(height), cycles), np.full(len(height), force), branch.frequency, height])
                points.append(curve[:, branch.converged])
                tops.append(points[-1][:, [points[-1][3].argmax()]] * ([[1]] * 3 + [[1 if branch.arrived else np.nan]]))
    names = "cycles force_N frequency_hz amplitude_m"
    return {"peaks": _columns(names, tops), "sweeps": _columns(names, points)}


def _loops(model: modelling.Model, history: WearHistory, area: np.ndarray, marks: np.ndarray) -> Columns:
    """Friction force over the mean displacement of the contact at the wear step nearest to every mark, the first again.

    Along the tangential component in which the contact moves most; along the normal one where it has no other."""
    parts = []
    for cycles in marks:
        row = int(np.abs(history.cycles - cycles).argmin())
        worn = model.balance.worn(history.depth[row])
        x = history.duty_displacement[row, 0].reshape(worn.contact.n_pair, -1, worn.basis.n_coeff)
        u, force = worn.history(worn.evaluate(float(history.omega[row]), x))
        closed = [*range(u.shape[2]), 0]
        mean, total = np.tensordot(area / area.sum(), u[..., closed], 1), force[..., closed].sum(axis=0)
        at = max(worn.contact.tangential or [0], key=lambda c: float(np.ptp(mean[c])))
        middle = (mean[at].max() + mean[at].min()) / 2
        parts.append(np.stack([np.full(len(closed), cycles), mean[at] - middle, total[at]]))
    return _columns("cycles displacement_m friction_N", parts)


def _compared(tables: Mapping[str, Columns], path: Path) -> Columns:
    """Columns of a measured test, each with what is computed at its cycles and force, and the relative difference."""
    try:
        measured = {name: column_numbers(name, column) for name, column in csv_columns(path, ())[1].items()}
        if "cycles" not in measured:
            raise Refusal(f"no column cycles among {', '.join(measured)}")
        columns: Columns = {name: measured.pop(name) for name in ("cycles", "force_N") if name in measured}
        for name, values in measured.items():
            at_force = name not in tables["marks"]
            table = tables["peaks" if at_force else "marks"]
            if name not in table or (at_force and "force_N" not in columns):
                known = ", ".join(tables["marks"] | tables["peaks"])
                raise Refusal(f"column {name}: there is {known}; those of sweeps need a column force_N")
            computed = np.full(len(values), np.nan)
            for i, cycles in enumerate(columns["cycles"]):
                rows = table["force_N"] == columns["force_N"][i] if at_force else np.full(len(table["cycles"]), True)
                if rows.any():
                    computed[i] = np.interp(cycles, table["cycles"][rows], table[name][rows], right=np.nan)
            columns |= {name: values, f"computed_{name}": computed, f"{name}_difference": computed / values - 1}
    except (Refusal, OSError) as trouble:
        raise Refusal(f"{path.name}: {trouble}") from None
    return columns
