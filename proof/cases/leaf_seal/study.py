"""The parameter study of the leaf seal: ./tribodyn prove leaf study.

Some thirty configurations, one response curve each, with folds, stability and chattering; a table, the summary of all
curves, and for the scene itself the pictures of the thesis. A configuration that fails is told and left behind; every
one that is done is kept, so that a stopped study can be resumed."""

import csv
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure
from threadpoolctl import threadpool_limits

from proof.cases.leaf_seal import figures as leaf_figures, record as leaf_record
from proof.cases.leaf_seal.cases import Case, cases
from proof.cases.leaf_seal.record import COLUMNS, STRUCK_POINT, Record
from proof.cases.leaf_seal.response import LeafResponse, respond
from tribodyn.style import STATUS
from tribodyn.workflows.run.memory import peak as peak_memory
from tribodyn.workflows.scene.scene_file import read_scene

MAPS = ("inclination", "bow")  # parameters whose contact is drawn
LINEAR_POINT = 4  # of the chosen five
RECORDS = "configurations"  # folder of the records


def sizes(response: LeafResponse) -> str:
    """What is allocated for the contact: one unknown per pair and coefficient, and no memory of friction."""
    balance = response.balance
    pairs, basis = balance.contact.n_pair, balance.basis
    state = response.state(0)
    arrays = (state.x, state.cycle.force, state.cycle.slope, state.g, state.residual)
    kilobytes = sum(array.nbytes for array in arrays) / 1024
    return (
        f"{balance.model.system.n_dof} DOFs; {balance.n_unknown} unknowns = {pairs} pairs x "
        f"{len(balance.contact.components)} component x {basis.n_coeff} coefficients; "
        f"friction memory {balance.memory.size} numbers; contact state with derivative {kilobytes:.0f} kB; "
        f"peak memory of the process {peak_memory() / 1e6:.0f} MB"
    )


def solve(case: Case) -> Record:
    """Solve one configuration; what goes wrong stands in the record."""
    try:
        return leaf_record.of_response(case, respond(read_scene("leaf_seal_thesis", case.overrides)))
    except (ArithmeticError, RuntimeError, ValueError) as error:
        return leaf_record.of_failure(case, " ".join(str(error).split()))


def study(
    chosen: Sequence[Case], folder: Path, resume: bool = False, tell: Callable[[str], None] = lambda line: None
) -> list[Record]:
    """Solve configurations; each is kept and told as soon as it is done.

    resume : take from the folder what is complete there and of the same scene"""
    records: list[Record] = []
    for case in chosen:
        scene = read_scene("leaf_seal_thesis", case.overrides).scene
        saved = leaf_record.load(case, scene, folder / RECORDS) if resume else None
        record = saved if saved is not None and saved.complete else solve(case)
        if record is not saved:
            leaf_record.save(record, scene, folder / RECORDS)
        drawn = case.group in MAPS or not records
        records.append(record if drawn else replace(record, response=None))  # a model is some megabytes
        write_table(records, folder / "study.csv")
        tell("  ".join(f"{record.numbers.get(name, '')!s:{_width(name)}}" for name in COLUMNS))
    return records


def write_table(records: Sequence[Record], path: Path) -> None:
    """Write the rows of all records."""
    with open(path, "w", newline="", encoding="utf-8") as file:
        table = csv.DictWriter(file, COLUMNS)
        table.writeheader()
        table.writerows(record.numbers for record in records)


def _width(name: str) -> int:
    return {"group": 19, "value": 9, "fold_hz": 42}.get(name, min(len(name), 8))


def draw(records: Sequence[Record], folder: Path) -> list[Path]:
    """Write the pictures of a study and the chattering of every pair at the chosen points."""
    figures: dict[str, Figure] = {"summary": leaf_figures.summary_figure(records)}
    paths = []
    scene = _response(records[0])
    if scene is not None:
        low, high = scene.branch.frequency[[0, -1]]
        points = scene.chosen()
        names = [f"point {i}: {scene.branch.frequency[point]:.1f} Hz" for i, point in enumerate(points, start=1)]
        figures["response"] = leaf_figures.response_figure(scene, max(low, 0.2 * high), high)
        figures["contact"] = leaf_figures.contact_figure([(n, scene, p) for n, p in zip(names, points, strict=True)])
        figures["history"] = leaf_figures.history_figure(scene, points, names)
        paths.append(folder / "chatter.csv")
        write_chatter(scene, points, paths[-1])
    for group in MAPS:
        columns = []
        of_group = [record for record in records if record.case.group == group]
        for record in of_group[:: len(of_group) - 1 or 1]:  # the extremes
            response = _response(record)
            if response is not None:
                for name, point in (("beyond resonance", LINEAR_POINT), ("largest motion", STRUCK_POINT)):
                    columns.append((f"{record.case.label}: {name}", response, response.chosen()[point]))
        if columns:
            figures[group] = leaf_figures.contact_figure(columns)
    for name, figure in figures.items():
        paths.append(folder / f"{name}.png")
        figure.savefig(paths[-1])
    return paths


def _response(record: Record) -> LeafResponse | None:
    """The response of a record, solved again where it was read from a file; None where there is none."""
    return solve(record.case).response if record.response is None and record.complete else record.response


def write_chatter(response: LeafResponse, points: Sequence[int], path: Path) -> None:
    """Write for every pair at points of the curve its instants, times of contact and impact velocities."""
    face = {pair: name for name, pairs in response.part.pairs.items() for pair in range(pairs.start, pairs.stop)}
    at = response.part.interface.points
    with open(path, "w", newline="", encoding="utf-8") as file:
        table = csv.writer(file)
        table.writerow(
            ("point", "hz", "patch", "pair", "x_mm", "y_mm", "status", "contact_ms", "touching")
            + ("opening_ms", "closing_ms", "impact_velocity_mm_s")
        )
        for number, point in enumerate(points, start=1):
            bounces, status = response.chatter(point), response.state(point).cycle.status
            for pair, name in face.items():
                instants = (bounces.opening[pair], bounces.closing[pair], bounces.approach[pair])
                table.writerow(
                    (number, f"{response.branch.frequency[point]:.3f}", name, pair)
                    + tuple(f"{1e3 * value:.3f}" for value in at[pair, :2])
                    + (STATUS[int(status[pair])][0], f"{1e3 * bounces.contact_duration[pair]:.4f}")
                    + (f"{bounces.touching[pair]:.4f}",)
                    + tuple(" ".join(f"{1e3 * value:.4f}" for value in values) for values in instants)
                )


@dataclass(frozen=True)
class Study:
    """A whole study. allocated : of `sizes`; files : that were written; totals : counts and seconds by name."""

    records: list[Record]
    allocated: str
    files: list[Path]
    totals: dict[str, float]

    def record(self) -> dict[str, Any]:
        """For machines."""
        rows, files = [record.numbers for record in self.records], [str(path) for path in self.files]
        return {"rows": rows, **self.totals, "sizes": self.allocated, "files": files}

    def text(self) -> str:
        """For people, below the table that was told on the way."""
        total = self.totals
        return "\n".join(
            [
                self.allocated,
                *(str(path) for path in self.files),
                f"{total['configurations']} configurations, {total['incomplete']} incomplete; models and curves "
                f"{total['curve_seconds']} s of processor time, with stability and pictures "
                f"{total['processor_seconds']} s, {total['seconds']} s by the clock",
            ]
        )


def whole(folder: Path, resume: bool, tell: Callable[[str], None]) -> Study:
    """Run the whole study into a folder. tell : called with the rows of its table as they come."""
    started, clock = time.perf_counter(), time.process_time()
    folder.mkdir(parents=True, exist_ok=True)
    tell("  ".join(f"{name:{_width(name)}}" for name in COLUMNS))
    with threadpool_limits(1):
        records = study(cases(read_scene("leaf_seal_thesis").mesh_scene), folder, resume, tell)
        first = _response(records[0])
        paths = draw([replace(records[0], response=first), *records[1:]], folder)
        allocated = "" if first is None else sizes(first)
    total = {
        "configurations": len(records),
        "incomplete": sum(not record.complete for record in records),
        "curve_seconds": round(sum(record.numbers.get("seconds", 0.0) for record in records), 1),
        "seconds": round(time.perf_counter() - started, 1),
        "processor_seconds": round(time.process_time() - clock, 1),
    }
    return Study(records, allocated, paths, total)
