"""Dimensions of the leaf seal from its published frequency ratios: ./tribodyn prove leaf fit.

Published are ten normalised frequencies of the leaf alone, on its pin springs, and on springs with every contact stuck
(Tamatam 2021, table 6.2), but no dimension. Radius and thickness set the scale and stay as the scene has them; angle,
height, patch width, place of the pins, spring and contact stiffness and the frequency that counts as one are fitted.
The published columns contradict each other a little: a spring cannot lower a frequency, yet mode 4 falls from 1.71 to
1.53 when springs are added, and soft springs that lift the leaf at 0.19 cannot raise mode 3 from 1.00 to 1.35. All 28
numbers count alike; what remains is what the table allows. It allows several leaves: searches that start elsewhere end
elsewhere, with errors that the numbers do not tell apart. The scene's own leaf is one of them, and is kept as long as
none fits better by more than that."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares
from threadpoolctl import threadpool_limits

from proof.joint_springs import JointSprings, joint_springs
from tribodyn.workflows.scene.scene_file import read_scene
from tribodyn.workflows.scene.schema import MeshScene

PUBLISHED = {
    "leaf alone": (0.00, 0.00, 1.00, 1.71, 2.44, 3.96, 4.78, 5.73, 6.00, 7.11),
    "with springs": (0.01, 0.19, 1.35, 1.53, 2.43, 3.96, 4.78, 5.73, 6.00, 7.11),
    "springs and stuck contact": (1.17, 1.54, 1.59, 2.29, 2.73, 4.15, 4.95, 5.81, 6.11, 7.24),
}
FLOOR = 0.02  # ratios below it count by their absolute error: 0.01 is known to its first digit only
SHAPE = {  # lower bound, start, upper bound, scale of change
    "angle": (0.3, 2.0, 2.3, 0.5),
    "height / radius": (0.1, 0.9, 1.3, 0.3),
    "patch_height / height": (0.04, 0.12, 0.2, 0.05),
    "pin_height / height": (-0.3, 0.15, 0.3, 0.2),
    "pin_width / height": (0.01, 0.03, 0.1, 0.03),
}
PIN_COLUMNS = (1, 2, 3)
LENGTHS = ("radius", "height", "thickness", "patch_height", "pin_height", "pin_width", "bow")
DIFFERENCE = 3e-3  # relative step of the derivatives: frequencies are smooth to 1e-6


Dimensions = dict[str, float]
"""Parameters of the part leaf_seal, SI units."""


def columns(leaf: JointSprings, spring: float, contact: float) -> np.ndarray:
    """Ten frequencies [Hz] alone, on springs, and on springs with stuck contact: (3, 10).

    spring : of each pin [N/m]; contact : of both patches together [N/m]"""
    stuck = leaf.model.interface.stiffness(0.0, contact)
    none, all_ = ({name: value for name in leaf.springs} for value in (0.0, spring))
    return np.array([leaf.modes(*state)[0] for state in ((none,), (all_,), (all_, stuck))])


@dataclass(frozen=True)
class Fit:
    """A fitted leaf.

    parameters : of the part; spring : of each pin [N/m]; contact : of both patches together [N/m]
    unit : the frequency that counts as one [Hz]; columns : (3, 10) [Hz], as the rows of PUBLISHED"""

    parameters: Dimensions
    spring: float
    contact: float
    unit: float
    columns: np.ndarray

    @property
    def errors(self) -> np.ndarray:
        """(3, 10) relative errors of the ratios, absolute over FLOOR for the smallest."""
        return relative_errors(self.columns / self.unit)

    @property
    def rms(self) -> float:
        """Root mean square of the errors of the 28 ratios that are not zero by definition."""
        return float(np.sqrt(np.mean(self.errors[COUNTED] ** 2)))

    def line(self) -> str:
        """Error and shape in one line."""
        p = self.parameters
        return f"{100 * self.rms:.2f} % r.m.s. with angle {p['angle']:.3f} rad, height {1e3 * p['height']:.1f} mm"

    def table(self) -> str:
        """Published and fitted ratios side by side."""
        lines = [f"{'mode':4}" + "".join(f"  {name:^26}" for name in PUBLISHED)]
        lines.append(f"{'':4}" + "  published   ours  error   " * len(PUBLISHED))
        ours = self.columns / self.unit
        for mode in range(10):
            cells = [
                f"  {ratios[mode]:9.2f} {ours[row, mode]:6.2f} {_error(ratios[mode], ours[row, mode]):>7}   "
                for row, ratios in enumerate(PUBLISHED.values())
            ]
            lines.append(f"{mode + 1:4d}" + "".join(cells))
        return "\n".join(line.rstrip() for line in lines)

    def toml(self) -> str:
        """Lines for the scene."""
        p = self.parameters
        lengths = {name: p[name] for name in ("height", "patch_height", "pin_height", "pin_width")}
        return "\n".join(
            [
                f'angle = "{p["angle"]:.3f} rad"',
                *(f'{name} = "{1e3 * value:.4g} mm"' for name, value in lengths.items()),
                f"pin_column = {p['pin_column']:.0f}",
                f'normal_stiffness = "{1e-6 * self.contact:.4g} N/um"',
                f'stiffness = "{1e-3 * self.spring:.4g} N/mm"',
            ]
        )


def _error(published: float, ours: float) -> str:
    return "" if published == 0.0 else f"{100 * (ours / published - 1):+.1f} %"


_RATIOS = np.array(list(PUBLISHED.values()))
COUNTED = _RATIOS > 0.0


def relative_errors(ratios: np.ndarray) -> np.ndarray:
    """(3, 10) errors of ratios against the published ones."""
    return (ratios - _RATIOS) / np.maximum(_RATIOS, FLOOR)


def reduced_leaf(parameters: Dimensions) -> JointSprings:
    """The leaf of the scene with other dimensions, by the same chain as a run of the scene."""
    units = {"angle": "rad", **dict.fromkeys(LENGTHS, "m")}
    rows = [f"geometry.{name}={value!r} {units[name]}" for name, value in parameters.items() if name in units]
    rows.append(f"geometry.pin_column={int(parameters['pin_column'])}")
    return joint_springs(read_scene("leaf_seal_thesis", rows))


def dimensions(scene: MeshScene) -> Dimensions:
    """The leaf of a scene."""
    return dict(scene.geometry.parameters)


def of_scene(scene: MeshScene) -> Fit:
    """The leaf as a scene has it, beside the published ratios; its unit is the best one."""
    parameters = dimensions(scene)
    spring = next(iter(scene.springs.values())).stiffness
    contact = scene.contact.normal_stiffness or 0.0
    result = columns(reduced_leaf(parameters), spring, contact)
    unit = least_squares(lambda u: _counted(result / u[0]), [result[0, 2]], x_scale=result[0, 2]).x[0]
    return Fit(parameters, spring, contact, float(unit), result)


def stiffnesses(leaf: JointSprings, mass: float) -> tuple[float, float, float, np.ndarray]:
    """Unit frequency [Hz], spring and contact stiffness [N/m] that suit a leaf best, and the (28,) errors left."""
    single = columns(leaf, 0.0, 0.0)[0]
    unit = np.exp(np.mean(np.log(single[2:] / _RATIOS[0, 2:])))
    turn = (2 * np.pi * unit) ** 2 * mass

    def errors(logarithms: np.ndarray) -> np.ndarray:
        item, spring, contact = np.exp(logarithms)
        return _counted(columns(leaf, spring, contact) / item)

    start = np.log([unit, _RATIOS[1, 1] ** 2 * turn / 2, _RATIOS[2, 0] * _RATIOS[2, 1] * turn])
    result = least_squares(errors, start, x_scale=0.1, max_nfev=12)
    item, spring, contact = np.exp(result.x)
    return float(item), float(spring), float(contact), result.fun


def _counted(ratios: np.ndarray) -> np.ndarray:
    return relative_errors(ratios)[COUNTED]


def doubt(first: Fit, second: Fit) -> float:
    """Standard error of the difference of the errors of two leaves, by leaving out one number at a time (jackknife)."""
    squares = np.stack([fitted.errors[COUNTED] ** 2 for fitted in (first, second)])
    n = squares.shape[1]
    without = np.diff(np.sqrt((squares.sum(axis=1, keepdims=True) - squares) / (n - 1)), axis=0)
    return float(np.sqrt((n - 1) * np.mean((without - without.mean()) ** 2)))


def chosen(base: Fit, alternatives: Sequence[Fit]) -> Fit:
    """The scene's own leaf, or the best of the others where it fits better by more than two standard errors."""
    best = min(alternatives, key=lambda item: item.rms)
    return best if base.rms - best.rms > 2 * doubt(base, best) else base


def fit(scene: MeshScene, pin_column: int, start: Sequence[float] | None = None, max_steps: int = 20) -> Fit:
    """Fit the shape of the leaf by least squares over all ratios; the same numbers at every run.

    start : in the order of SHAPE, whose starts are taken where None
    Every shape gets its own best unit and stiffnesses, so that only the shape is searched for."""
    first = dimensions(scene)
    lower, typical, upper, scale = (np.array(column) for column in zip(*SHAPE.values(), strict=True))
    begin = typical if start is None else np.clip(start, lower, upper)

    def parameters(shape: np.ndarray) -> Dimensions:
        angle, height, patch, pin, seat = (float(value) for value in shape)
        height *= first["radius"]
        changed = {"angle": angle, "height": height, "patch_height": patch * height, "pin_height": pin * height}
        return {**first, **changed, "pin_width": seat * height, "pin_column": pin_column, "bow": 0.0}

    def solved(shape: np.ndarray) -> tuple[Dimensions, JointSprings, tuple[float, float, float, np.ndarray]]:
        p = parameters(shape)
        leaf = reduced_leaf(p)
        volume = p["angle"] * p["radius"] * p["height"] * p["thickness"]
        return p, leaf, stiffnesses(leaf, scene.material.density * volume)

    result = least_squares(
        lambda shape: solved(shape)[2][3], begin, bounds=(lower, upper), x_scale=scale, diff_step=DIFFERENCE,
        max_nfev=max_steps, ftol=1e-4,
    )  # fmt: skip
    p, leaf, (unit, spring, contact, _) = solved(result.x)
    return Fit(p, spring, contact, unit, columns(leaf, spring, contact))


def shape_of(p: Dimensions) -> tuple[float, ...]:
    """A leaf in the order of SHAPE."""
    parts = (p[name] / p["height"] for name in ("patch_height", "pin_height", "pin_width"))
    return p["angle"], p["height"] / p["radius"], *parts


def search(tell: Callable[[str], None]) -> Fit:
    """Fit from the scene's own leaf, and afresh for every column the pins may stand in; what is chosen.

    tell : called with a sentence on every fit"""
    scene = read_scene("leaf_seal_thesis").mesh_scene
    with threadpool_limits(1):
        first = dimensions(scene)
        base = fit(scene, int(first["pin_column"]), shape_of(first))
        tell(f"from the scene's own leaf: {base.line()}")
        remaining = []
        for column in PIN_COLUMNS:
            remaining.append(fit(scene, column))
            tell(f"afresh, pins in column {column}: {remaining[-1].line()}")
        result, best = chosen(base, remaining), min(remaining, key=lambda item: item.rms)
        verdict = "is kept" if result is base else "gives way"
        tell(
            f"the best of these is {100 * (base.rms - best.rms):.2f} points better than the scene's own, which "
            f"{verdict}: the standard error of that is {100 * doubt(base, best):.2f} points (jackknife)"
        )
    return result


def as_text(result: Fit) -> str:
    """For people."""
    return "\n".join(
        [
            result.table(),
            f"error {100 * result.rms:.2f} % r.m.s.; 1.00 is {result.unit:.4g} Hz",
            f"contact of both patches over spring of one pin: {result.contact / result.spring:.3g}",
            result.toml(),
        ]
    )
