"""The parameter study of the leaf seal: tribodyn leaf study.

Some thirty configurations, one response curve each, with folds, stability and chattering; a table, the summary of all
curves, and for the scene itself the pictures of the thesis.
"""

from __future__ import annotations

import csv
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

from hbm.law import SEPARATES, STICKS
from workflows import leaf_figures, scene_file
from workflows.leaf_cases import Case, cases
from workflows.leaf_response import LINER_NODE, LeafResponse, respond

COLUMNS = (
    "group", "value", "points", "folds", "fold_hz", "unstable_points", "peak_hz", "peak_um",
    "stick", "stick_separation", "separation", "impact_velocity_mm_s", "least_touching",
    "impact_work_mJ", "pin_work_mJ", "patch_wear_um", "pin_wear_um", "newton_steps", "seconds",
)  # fmt: skip
MAPS = ("inclination", "bow")  # parameters whose contact is drawn
WEAR_CYCLES = 1e9  # that the depths in the table stand for: some 2000 hours
STRUCK_POINT = 2  # of the chosen five, where the leaf moves most


def row(case: Case, response: LeafResponse) -> dict[str, object]:
    """The numbers of one configuration; contact is that of the point where the leaf moves most."""
    branch, point = response.branch, response.chosen()[STRUCK_POINT]
    chattering, status = response.chatter(point), response.state(point).cycle.status
    height = branch.amplitude(LINER_NODE)
    folds = [f"{branch.frequency[i]:.2f}" for i in branch.folds]
    patches, pins = (1e6 * WEAR_CYCLES * rates.max() for rates in response.wear_rates(point))
    count = {kind: int(np.sum(status == kind)) for kind in (STICKS, STICKS | SEPARATES, SEPARATES)}
    return dict(
        zip(
            COLUMNS,
            (
                case.group,
                case.label,
                len(branch.omega),
                len(folds),
                " ".join(folds),
                int(np.sum(~response.stability.stable)),
                round(float(branch.frequency[height.argmax()]), 2),
                round(1e6 * float(height.max()), 1),
                *count.values(),
                round(1e3 * float(chattering.impact_velocity.max()), 1),
                round(float(chattering.touching.min()), 3),
                round(1e3 * float(response.impact_work(point).sum()), 4),
                round(1e3 * sum(response.pin_work(point).values()), 4),
                round(float(patches), 3),
                round(float(pins), 3),
                int(branch.newton_steps.sum()),
                round(response.seconds, 2),
            ),
            strict=True,
        )
    )


def sizes(response: LeafResponse) -> str:
    """What is allocated for the contact: one unknown per pair and coefficient, and no memory of friction."""
    balance = response.balance
    pairs, basis = balance.parameters.n_pair, balance.basis
    state = response.state(0)
    assert state.cycle.jacobian is not None
    arrays = (state.x, state.cycle.force, state.cycle.jacobian, state.g, state.residual)
    kilobytes = sum(array.nbytes for array in arrays) / 1024
    return (
        f"{balance.model.system.n_dof} DOFs; {balance.n_unknown} unknowns = {pairs} pairs x "
        f"{len(balance.parameters.components)} component x {basis.n_coeff} coefficients; "
        f"friction memory {balance.memory.size} numbers; contact state with derivative {kilobytes:.0f} kB"
    )


def study(chosen: Sequence[Case], folder: Path) -> dict[str, list[tuple[Case, LeafResponse]]]:
    """Run configurations, print and write a row for each as soon as it is done; responses by group."""
    studied: dict[str, list[tuple[Case, LeafResponse]]] = {}
    folder.mkdir(parents=True, exist_ok=True)
    with open(folder / "study.csv", "w", newline="", encoding="utf-8") as file:
        table = csv.DictWriter(file, COLUMNS)
        table.writeheader()
        for case in chosen:
            response = respond(scene_file.read("leaf_seal", case.overrides))
            studied.setdefault(case.group, []).append((case, response))
            numbers = row(case, response)
            table.writerow(numbers)
            file.flush()
            print("  ".join(f"{numbers[name]!s:{_width(name)}}" for name in COLUMNS), flush=True)
    return studied


def _width(name: str) -> int:
    return {"group": 19, "value": 9, "fold_hz": 42}.get(name, min(len(name), 8))


def draw(studied: dict[str, list[tuple[Case, LeafResponse]]], folder: Path) -> list[Path]:
    """Write the pictures of a study."""
    _, scene = studied["liner"][0]
    low, high = scene.branch.frequency[[0, -1]]
    points = scene.chosen()
    names = [f"point {i}: {scene.branch.frequency[point]:.1f} Hz" for i, point in enumerate(points, start=1)]
    figures = {
        "summary": leaf_figures.summary_figure(studied),
        "response": leaf_figures.response_figure(scene, max(low, 0.2 * high), high),
        "contact": leaf_figures.contact_figure([(n, scene, p) for n, p in zip(names, points, strict=True)]),
        "history": leaf_figures.history_figure(scene, points, names),
    }
    for group in MAPS:
        columns = []
        for case, response in studied.get(group, [])[:: len(studied.get(group, [])) - 1 or 1]:  # the extremes
            linear, *_ = points = response.chosen()
            columns.append((f"{case.label}: linear regime", response, linear))
            columns.append((f"{case.label}: largest motion", response, points[STRUCK_POINT]))
        if columns:
            figures[group] = leaf_figures.contact_figure(columns)
    paths = []
    for name, figure in figures.items():
        paths.append(folder / f"{name}.png")
        figure.savefig(paths[-1])
    return paths


def run(folder: Path) -> None:
    """Run the whole study into a folder."""
    started, clock = time.perf_counter(), time.process_time()
    print("  ".join(f"{name:{_width(name)}}" for name in COLUMNS))
    with threadpool_limits(1):
        studied = study(cases(scene_file.read("leaf_seal").part_scene), folder)
        print(sizes(studied["liner"][0][1]))
        for path in draw(studied, folder):
            print(path)
    print(f"{time.perf_counter() - started:.0f} s, of which {time.process_time() - clock:.0f} s of processor time")
