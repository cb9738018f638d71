"""The parameter study of the leaf seal: ./tribodyn prove leaf study.

Some thirty configurations, one response curve each, with folds, stability and chattering; a table, the summary of all
curves, and for the scene itself the pictures of the thesis. A configuration that fails is told and left behind."""

import csv
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

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


def study(chosen: Sequence[Case], folder: Path, tell: Callable[[str], None]) -> list[Record]:
    """Solve configurations; each is in the table and told as soon as it is done."""
    records: list[Record] = []
    for case in chosen:
        record = solve(case)
        drawn = case.group in MAPS or not records
        records.append(record if drawn else replace(record, response=None))
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
    scene = records[0].response
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
            if (response := record.response) is not None:
                for name, point in (("beyond resonance", LINEAR_POINT), ("largest motion", STRUCK_POINT)):
                    columns.append((f"{record.case.label}: {name}", response, response.chosen()[point]))
        if columns:
            figures[group] = leaf_figures.contact_figure(columns)
    for name, figure in figures.items():
        paths.append(folder / f"{name}.png")
        figure.savefig(paths[-1])
    return paths


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


def whole(folder: Path, tell: Callable[[str], None]) -> None:
    """Run the whole study into a folder. tell : called with the rows of its table as they come, and what it came to."""
    started, clock = time.perf_counter(), time.process_time()
    folder.mkdir(parents=True, exist_ok=True)
    tell("  ".join(f"{name:{_width(name)}}" for name in COLUMNS))
    with threadpool_limits(1):
        records = study(cases(read_scene("leaf_seal_thesis").mesh_scene), folder, tell)
        paths = draw(records, folder)
    if (first := records[0].response) is not None:
        tell(sizes(first))
    for path in paths:
        tell(str(path))
    tell(
        f"{len(records)} configurations, {sum(not record.complete for record in records)} incomplete; models and "
        f"curves {sum(record.numbers.get('seconds', 0.0) for record in records):.1f} s of processor time, with "
        f"stability and pictures {time.process_time() - clock:.1f} s, "
        f"{time.perf_counter() - started:.1f} s by the clock"
    )
