"""What was measured: curves of one place in one direction, in SI units, checked against an output of a scene.

Three kinds: a response over frequency, a backbone (frequency and damping over amplitude; a free decay is read as one),
and the modes at small amplitude. The resonance that a stepped sine shows is a point of the backbone: one mode whose
frequency and damping change with its amplitude, fitted to the force over the displacement of all points of a run.

    F / x = m [w_0(a)^2 - w^2 + 2 i zeta(a) w_0(a) w]

is linear in m, m w_0^2 and 2 m zeta w_0. Along a curve of constant response a does not change and both are constants;
along one of constant force both are parabolas in a.
Source  single nonlinear mode: Szemplinska-Stupnicka, JSV 63 (1979) 475; as a fit in this form ours"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from tribodyn.fem.part import Part
from tribodyn.refusal import Refusal
from tribodyn.workflows.scene.load_tables import HarmonicLoad
from tribodyn.workflows.scene.matrix_scene import MatrixScene
from tribodyn.workflows.scene.schema import Scene
from tribodyn.workflows.scene.units import parse_unit

OUTPUT = "response"  # name of the first output of a scene
ORDERS = ("m", "m/s", "m/s2")  # by the derivative of the displacement
Kind = Literal["response", "backbone", "modes"]
BENT = 2.0  # of the largest over the least amplitude of a run, from which on frequency and damping are parabolas in it


@dataclass(frozen=True)
class ResponseUnit:
    """order : of the derivative of the displacement; factor : to SI units; per_force : whether it is per force"""

    order: int
    factor: float
    per_force: bool

    @classmethod
    def parsed(cls, text: str) -> ResponseUnit:
        """A unit such as mm/s2, g or (m/s^2)/N; raises Refusal."""
        unit = parse_unit(plain_unit(text))
        for per_force in (False, True):
            for order, base in enumerate(ORDERS):
                target = parse_unit(f"{base}/N" if per_force else base)
                if unit.dimension == target.dimension:
                    return cls(order, float(unit.factor / target.factor), per_force)
        raise Refusal(f"expected a displacement, velocity or acceleration, or one per force, not {text}")


def plain_unit(label: str) -> str:
    """A unit as the program knows it: of analysers g is the standard gravity."""
    return re.sub(r"\bsec(?![a-zA-Z])", "s", re.sub(r"\bg(?![a-zA-Z])", "gn", label.strip().replace("**", "^")))


@dataclass(frozen=True)
class Run:
    """One measured curve; what was not measured is nan.

    name : runs of one name repeat each other; control : what was held constant, "force", "response" or ""
    frequency : (n,) [Hz]; displacement : (n,) complex amplitude of harmonic 1, exp(i w t) understood [m], or [m/N]
    force : (n,) amplitude [N]; damping : (n,) ratio
    errors : (n, 2) relative standard deviations of frequency and damping; of a response the second is of its amplitude
    """

    name: str
    control: str
    frequency: np.ndarray
    displacement: np.ndarray
    force: np.ndarray
    damping: np.ndarray
    errors: np.ndarray

    @property
    def amplitude(self) -> np.ndarray:
        """(n,) [m], or [m/N]."""
        return np.abs(self.displacement)


@dataclass(frozen=True)
class Measurement:
    """Curves that were measured at one place in one direction.

    source : file; output : of a scene that they belong to; order : of the measured derivative of the displacement
    direction, force_direction : as in a scene, None where not said; position : (3,) [m] or None
    per_force : displacement is [m/N]; phased : its phase was measured, against the force or, `timed`, against t = 0
    decay : damping is a logarithmic decrement over 2 pi, of a free decay; unused : clauses on what is left out"""

    kind: Kind
    runs: tuple[Run, ...]
    source: str = ""
    output: str = OUTPUT
    order: int = 0
    direction: tuple[float, float, float] | None = None
    force_direction: tuple[float, float, float] | None = None
    position: tuple[float, float, float] | None = None
    per_force: bool = False
    phased: bool = False
    timed: bool = False
    decay: bool = False
    unused: tuple[str, ...] = ()

    def on(self, scene: Scene) -> Measurement:
        """The measurement in the directions of a scene's output and force, in metres, its phase against the force.

        Raises  Refusal: the scene has no such output, force or direction"""
        outputs = outputs_of(scene)
        if self.output not in outputs:
            raise Refusal(f'output = "{self.output}": the scene has {", ".join(outputs)}; give output = NAME')
        sign = 1.0
        if not isinstance(scene, MatrixScene):
            sign = _sign(self.direction, outputs[self.output].direction, f"output {self.output}")
        if self.kind != "response":
            return self
        load, force = driving_load(scene)
        if (direction := getattr(load, "direction", None)) is not None:
            sign *= _sign(self.force_direction, direction, "the force")
        factor = sign * (abs(force) if self.per_force else 1.0) * (abs(force) / force if self.timed else 1.0)
        forces = [np.where(np.isfinite(run.force), run.force, abs(force)) for run in self.runs]
        runs = (
            replace(r, displacement=factor * r.displacement, force=f) for r, f in zip(self.runs, forces, strict=True)
        )
        return replace(self, runs=tuple(runs), per_force=False, timed=False)

    def force_at_output(self, scene: Scene) -> bool:
        """Whether the one force of a scene acts where and along what the output observes."""
        loads = [*scene.loads.harmonic.values()]
        observed = outputs_of(scene)[self.output]
        where = [entry.model_dump(include={"group", "direction", "dofs", "vector"}) for entry in (observed, *loads)]
        return len(where) == 2 and where[0] == where[1]

    def check_position(self, scene: Scene, part: Part | None) -> None:
        """Refuse a position farther from the scene's output than a twentieth of the part; raises Refusal."""
        if self.position is None or part is None or isinstance(scene, MatrixScene):
            return
        group = outputs_of(scene)[self.output].group
        nodes = part.node_sets.get(group)
        if nodes is None:
            return
        distance = float(np.linalg.norm(part.points[nodes] - np.array(self.position), axis=1).min())
        if distance > 0.05 * float(np.ptp(part.points, axis=0).max()):
            raise Refusal(
                f"position: measured {1e3 * distance:.4g} mm from {group}, where the scene observes {self.output}: "
                "observe the measured place in [response.others], or correct position"
            )


def _sign(measured: tuple[float, float, float] | None, ours: tuple[float, float, float], subject: str) -> float:
    """1, or -1 for the opposite direction; raises Refusal for another one."""
    if measured is None:
        return 1.0
    cosine = float(np.dot(measured, ours))
    if abs(abs(cosine) - 1.0) > 1e-3:
        raise Refusal(
            f"direction: measured along {_describe(measured)}, {subject} of the scene is along {_describe(ours)}: "
            "give the output of that direction, or correct direction"
        )
    return float(np.sign(cosine))


def _describe(direction: tuple[float, float, float]) -> str:
    for axis, name in enumerate("xyz"):
        if abs(abs(direction[axis]) - 1.0) < 1e-6:
            return name if direction[axis] > 0 else f"-{name}"
    return str(tuple(round(c, 4) for c in direction))


def outputs_of(scene: Scene) -> dict[str, Any]:
    """The outputs of a scene by name, the first one under OUTPUT."""
    return {OUTPUT: scene.response, **getattr(scene.response, "others", {})}


def driving_load(scene: Scene) -> tuple[HarmonicLoad, complex]:
    """The one force that drives a scene in harmonic 1, and its F exp(i phase) [N]; raises Refusal otherwise."""
    loads = [load for load in scene.loads.harmonic.values() if load.harmonic == 1 and load.value]
    if len(loads) != 1 or len(scene.loads.harmonic) != 1 or getattr(scene, "motion", None):
        raise Refusal(
            "loads.harmonic: a response is compared where one force in harmonic 1 drives the scene, and nothing else"
        )
    return loads[0], complex(loads[0].value * np.exp(1j * loads[0].phase))


def merged(measured: Measurement) -> Measurement:
    """Runs that repeat each other as their mean with their scatter, where all of them have points."""
    named: dict[str, list[Run]] = {}
    for run in measured.runs:
        named.setdefault(run.name, []).append(run)
    return replace(measured, runs=tuple(_mean(measured.kind, runs) for runs in named.values()))


def _mean(kind: Kind, runs: list[Run]) -> Run:
    """The mean of runs at the points of the first: of backbones by amplitude, of responses by frequency."""
    first = runs[0]
    if len(runs) == 1 or kind == "modes":
        return first
    over = [run.frequency if kind == "response" else run.amplitude for run in runs]
    low, high = max(x.min() for x in over), min(x.max() for x in over)
    at = over[0][(over[0] >= low) & (over[0] <= high)]

    def of(name: str) -> np.ndarray:
        orders = [np.argsort(x) for x in over]
        return np.array([np.interp(at, x[o], getattr(r, name)[o]) for x, r, o in zip(over, runs, orders, strict=True)])

    def spread(values: np.ndarray) -> np.ndarray:
        return np.asarray(values.std(axis=0, ddof=1) / np.abs(values.mean(axis=0)))

    hertz, x, damping = of("frequency"), of("displacement"), of("damping")
    second = np.abs(x) if kind == "response" else damping
    errors = np.stack([spread(hertz), spread(second)], axis=1)
    hertz, x, force, damping = (values.mean(axis=0) for values in (hertz, x, of("force"), damping))
    return Run(first.name, first.control, hertz, x, force, damping, errors)


def prepared(measured: Measurement, scene: Scene, resonance: bool) -> Measurement:
    """A measurement as it is compared: in the directions of a scene, repeats as their mean, resonances where wanted."""
    measured = measured.on(scene)
    has_constant_response = any(run.control == "response" for run in measured.runs)
    if measured.kind == "response" and (resonance or has_constant_response):
        measured = resonances(measured)
    return merged(measured)


def resonances(measured: Measurement) -> Measurement:
    """Each run of a response as a point of a backbone; runs of one control become one, by amplitude.

    Raises  Refusal where a run has no force or no phase, or no resonance"""
    if not measured.phased or any(not np.isfinite(run.force).all() for run in measured.runs) or measured.per_force:
        raise Refusal("the resonance of a run needs its force and its phase in every row")
    by_control: dict[str, list[Run]] = {}
    for run in measured.runs:
        by_control.setdefault(run.control, []).append(resonance(run))
    return replace(measured, kind="backbone", runs=tuple(_joined(name, points) for name, points in by_control.items()))


def _joined(control: str, points: list[Run]) -> Run:
    """Points by amplitude as one run."""
    order = np.argsort([point.amplitude[0] for point in points])
    columns = ("frequency", "displacement", "force", "damping", "errors")
    arrays = (np.concatenate([getattr(points[i], column) for i in order]) for column in columns)
    return Run(f"constant {control}" if control else "resonances", control, *arrays)


def resonance(run: Run) -> Run:
    """The point of a run at its largest amplitude, at resonance where that is constant; its force is that of resonance.

    Raises  Refusal where no resonance is within the run"""
    omega, a = 2 * np.pi * run.frequency, run.amplitude
    stiffness, s = run.force / run.displacement, a / a.max() - 1
    bent = len(a) > 10 and a.max() > BENT * a.min()
    powers = np.stack([s**k for k in range(3 if bent else 1)], axis=1)
    none = np.zeros_like(powers)
    rows = np.vstack(
        [np.column_stack([-(omega**2), powers, none]), np.column_stack([0 * omega, none, powers * omega[:, None]])]
    )
    weight = np.tile(1 / np.abs(stiffness), 2)  # relative errors
    scale = np.abs(rows).max(axis=0)
    target = np.concatenate([stiffness.real, stiffness.imag])
    design = weight[:, None] * rows / scale
    solved, _, rank, _ = np.linalg.lstsq(design, weight * target, rcond=None)
    chosen = [0, 1, 1 + powers.shape[1]]
    mass, square, rate = (solved / scale)[chosen]
    if rank < design.shape[1] or not (square / mass > 0 and rate / mass > 0):
        raise Refusal(f"run {run.name}: no resonance of one mode is within it")
    natural = float(np.sqrt(square / mass))
    residual = weight * target - design @ solved
    covariance = (
        np.linalg.inv(design.T @ design)[np.ix_(chosen, chosen)]
        * (residual @ residual)
        / max(len(residual) - len(solved), 1)
    )
    slopes = np.array([[-0.5, 0.5, 0.0], [-0.5, -0.5, 1.0]]) / solved[chosen]  # of the logarithms of w_0 and zeta
    errors = np.sqrt(np.einsum("ij,jk,ik->i", slopes, covariance, slopes))
    order = np.argsort(omega)
    size = a.max() if bent else np.interp(natural, omega[order], a[order])  # held constant, as an acceleration perhaps
    hertz, top, damping = (np.array([v]) for v in (natural / (2 * np.pi), size, rate / mass / (2 * natural)))
    return Run(run.name, run.control, hertz, top.astype(complex), abs(rate) * natural * top, damping, errors[None])
