"""What every number of a scene's response depends on: exact derivatives by every number of the scene."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from time import process_time
from typing import Any, Literal

import numpy as np

from tribodyn.hbm import quantity
from tribodyn.hbm.derivatives.derivative_rules import NoDerivative
from tribodyn.hbm.derivatives.derivative_table import Derivatives
from tribodyn.hbm.derivatives.parameter_change import ParameterChange
from tribodyn.hbm.quantity import CycleQuantity, StatedQuantity, WearQuantity
from tribodyn.hbm.threads import limited
from tribodyn.refusal import SolveFailed
from tribodyn.workflows.pictures.figures import axes_of, named
from tribodyn.workflows.pictures.matplotlib_names import Figure
from tribodyn.workflows.pictures.theme import CYCLE, GREY
from tribodyn.workflows.run import pipeline, response_curve, wear_run
from tribodyn.workflows.run.parameter_variation import ParameterVariation
from tribodyn.workflows.run.progress import Report, reporter
from tribodyn.workflows.run.scene_numbers import geometry_keys, keys
from tribodyn.workflows.scene.fields import Frequency
from tribodyn.workflows.scene.scene_file import Overrides, SceneError, SceneFile, Source, read_scene
from tribodyn.workflows.scene.units import to_si
from tribodyn.workflows.studies.derivatives_at_points import changes_of, life_share, of_branch, of_life
from tribodyn.workflows.studies.files import write_files
from tribodyn.workflows.studies.study_result import StudyResult

SHOWN = 12  # parameters in the picture
MICROMETRE = 1e-6


@dataclass(frozen=True, repr=False)
class ResponseDerivatives(StudyResult):
    """Derivatives of a scene's response at one point of it.

    derivatives : by key of the scene; at : the values of the keys, SI units; joints : joint -> its pairs
    response_seconds, seconds : of one processor, of the response and of the derivatives
    reduced_keys : keys that need a new reduction of the model, which takes most of the time
    without : keys without a derivative, each with the reason"""

    name: str
    derivatives: Derivatives
    at: Mapping[str, float]
    joints: Mapping[str, np.ndarray]
    response_seconds: float
    seconds: float
    reduced_keys: tuple[str, ...]
    without: Mapping[str, str] = field(default_factory=dict)

    @property
    def elasticities(self) -> dict[str, np.ndarray]:
        """Key -> (n_quantity,) d ln q / d ln p; of the phase d q / d ln p [rad]; the strongest on the amplitude first.

        The gap of a joint, which is zero for most, counts by the micrometre: d ln q / d gap [%/um]"""
        f, size = self.derivatives, self._size
        rows = {key: f.slopes[:, i] * value / size for i, (key, value) in enumerate(self.at.items())}
        for joint, pairs in self.joints.items():
            if f.by_gap[:, pairs].any():
                rows[f"gap of {joint}, by um"] = f.by_gap[:, pairs].sum(axis=1) * 100 * MICROMETRE / size
        first = self._first
        return dict(sorted(rows.items(), key=lambda row: -abs(row[1][first])))

    @property
    def _quantities(self) -> list[StatedQuantity]:
        return [quantity.load(name.partition(" of ")[0]) for name in self.derivatives.names]

    @property
    def _first(self) -> int:
        """The first number that moves at a fixed frequency: amplitude or life."""
        return int(np.argmax(self.derivatives.above.any(axis=1)))

    @property
    def _size(self) -> np.ndarray:
        return np.where([q.relative for q in self._quantities], self.derivatives.values, 1.0)

    @property
    def corners(self) -> tuple[str, ...]:
        """Keys at a corner of the contact forces."""
        return tuple(key for key, c in zip(self.derivatives.parameters, self.derivatives.corner, strict=True) if c)

    def record(self) -> dict[str, Any]:
        f = self.derivatives
        return {
            "quantities": dict(zip(f.names, f.values.tolist(), strict=True)),
            "parameters": dict(self.at),
            "derivatives": {
                key: dict(zip(f.names, f.slopes[:, i].tolist(), strict=True)) for i, key in enumerate(f.parameters)
            },
            "elasticities": {
                key: dict(zip(f.names, row.tolist(), strict=True)) for key, row in self.elasticities.items()
            },
            "corners": list(self.corners),
            "seconds": self.seconds,
            "response_seconds": self.response_seconds,
        }

    def lines(self) -> list[str]:
        """Elasticities, the strongest on the amplitude or the life first."""
        f = self.derivatives
        quantities, first = self._quantities, self._first
        names = [n if q.relative else f"{n} [{q.unit}]" for n, q in zip(f.names, quantities, strict=True)]
        width = [max(12, len(name) + 2) for name in names]
        values = (f"{n} {v:.6g} {q.unit}".rstrip() for n, v, q in zip(f.names, f.values, quantities, strict=True))
        lines = [", ".join(values), "per cent of each for one per cent of:"]
        lines.append("".join(f"{name:>{w}}" for name, w in zip(names, width, strict=True)))
        for key, row in self.elasticities.items():
            lines.append("".join(f"{value:>+{w}.4f}" for value, w in zip(row, width, strict=True)) + f"  {key}")
        if f.follows_corner:
            lines.append("the peak is a corner of the curve, which moves with the contact transition that begins there")
        is_of_wear, is_of_cycle = (isinstance(quantities[first], kind) for kind in (WearQuantity, CycleQuantity))
        if is_of_wear and self.corners:
            lines.append(
                "warning: at a state of the wear a pair is at a corner of its contact force, such as grazing or first "
                "slip, or touches for so few samples that its wear law is rough: the table is that of one side"
            )
        for key in self.corners if not is_of_wear else ():
            i = f.parameters.index(key)
            upper, lower = (side[first, i] * self.at[key] / f.values[first] for side in (f.above, f.below))
            where = " at a fixed frequency" if is_of_cycle else ""
            lines.append(
                f"warning: {key} is at a corner of the contact forces, such as grazing or first slip: the "
                f"{quantities[first].label} has "
                f"{upper:+.4g} above it and {lower:+.4g} below{where}, and the table their mean"
            )
        share = 100 * self.seconds / self.response_seconds
        subject = "life" if is_of_wear else "response"
        lines.append(f"{self.seconds:.3g} s, {share:.2g} % of the {self.response_seconds:.3g} s of the {subject}")
        lines += [f"without {key}: {reason}" for key, reason in self.without.items()]
        if self.reduced_keys:
            lines.append(f"most of them for {len(self.reduced_keys)} keys with which the model is reduced anew")
        return lines

    def write(self, folder: Path) -> list[Path]:
        """Write derivatives.csv, derivatives.png."""
        rows = self.elasticities
        table = {"parameter": list(rows)}
        columns = {name: [float(row[i]) for row in rows.values()] for i, name in enumerate(self.derivatives.names)}
        return write_files(folder, {"derivatives": {**table, **columns}}, lambda: {"derivatives": self.plot()})

    def plot(self) -> Figure:
        """Bars of the elasticities of every number of the whole contact."""
        rows = dict(list(self.elasticities.items())[:SHOWN])
        whole_contact = zip(self._quantities, self.derivatives.names, strict=True)
        shown = [q.name for q, name in whole_contact if q.relative and q.name == name]
        columns = len(shown)
        with axes_of(2.6 + 2.2 * columns, 1.4 + 0.28 * len(rows), columns=columns) as (figure, panes):
            for i, (axes, name) in enumerate(zip(np.atleast_1d(panes), shown, strict=True)):
                values = [row[self.derivatives.names.index(name)] for row in rows.values()]
                axes.barh(range(len(rows)), values, color=CYCLE[i])
                axes.axvline(0.0, color=GREY, lw=0.8)
                axes.set(title=name, yticks=range(len(rows)), yticklabels=list(rows) if i == 0 else [])
                axes.invert_yaxis()
            figure.supxlabel("change in % by 1 % of each parameter", fontsize=10)
            figure.suptitle(named(self.name, "what the response depends on"), x=0.01, ha="left", fontsize=12)
        return figure


def derivatives(
    scene: Source,
    *,
    of: Literal["response", "life"] = "response",
    at: Frequency | None = None,
    only: tuple[str, ...] = (),
    overrides: Overrides = (),
    progress: Report = None,
) -> ResponseDerivatives:
    """Show what peak, energy and preload of a response depend on: exact derivatives by every number of the scene.

    The response is solved once: an adjoint gives the derivatives by all numbers together. Numbers with which the model
    is reduced anew, such as the stiffness of one body of several, take four reductions each.

    scene : name of a scene or a .toml file
    of : the response; the life by [wear], which ends at `wear.lost_below`, with the largest depth and the volume that
        are worn then
    at : frequency of the cycle; the highest peak of the response by default, whose own frequency moves too
    only : keys of the scene to look at, such as contact.friction; all by default
    Raises  SceneError for a key that is no such number; SolveFailed where there is no derivative, as at a fold"""
    file, at = read_scene(scene, overrides), None if at is None else to_si(at, "Hz")
    numbers, moving = keys(file.scene), geometry_keys(file.scene)
    if of == "life":
        if file.scene.wear is None:
            raise SceneError("a life needs [wear] in the scene")
        numbers |= {key: value for key, (value, *_) in wear_run.law_numbers(file.scene).items()}
    unknown = [key for key in only if key not in numbers | moving]
    if unknown:
        raise SceneError(
            f"{unknown[0]} is no number that a response depends on: these are {', '.join(numbers | moving)}"
        )
    if at is not None and of == "life":
        raise SceneError("--at is a frequency of --of response")
    values = {key: value for key, value in (numbers | moving).items() if key in (only or numbers)}
    with limited(file.scene.solver.threads):
        return _of_scene(file, of, at, values, None if only else {}, reporter(progress))


def _of_scene(
    file: SceneFile, of: str, at: float | None, values: Mapping[str, float], without: dict[str, str] | None, report: Any
) -> ResponseDerivatives:
    """Of a scene that was read; at : frequency [Hz]; values : by key; without : see `changes_of`."""
    varying = ParameterVariation(file, report)
    balance, clock = varying.model.balance, process_time()
    find: Callable[[Iterator[ParameterChange]], Derivatives]
    if of == "life":
        with report.track("wear") as advance:
            worn = wear_run.worn_out(file, varying.model, life_share(file.scene))
        find = partial(of_life, varying, worn, values=values)
    else:
        with report.track("frequency response") as advance:
            branch = response_curve.follow_response(file.scene, balance, advance)
        pipeline.check_branch(branch)
        find = partial(of_branch, file.scene, balance, branch, at=at)
    solved = process_time()
    with report.track("derivatives") as advance:
        try:
            derivatives_found = find(changes_of(varying, values, advance, without))
        except NoDerivative as reason:
            raise SolveFailed(f"{file.name} has no derivatives here: {reason}") from None
    return ResponseDerivatives(
        file.name,
        derivatives_found,
        {key: values[key] for key in derivatives_found.parameters},
        {joint.name: joint.rows for joint in balance.contact.joints},
        solved - clock,
        process_time() - solved,
        tuple(key for key in derivatives_found.parameters if varying.is_reduced_again(key)),
        without or {},
    )
