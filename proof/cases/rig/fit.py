"""Documented fits of the fretting rig: ./tribodyn prove rig fit.

1. Joint springs to the published open and stuck frequencies. The thesis relaxed the same joints, by how much it does
   not say. Springs that act at one joint are tied where the frequencies cannot tell them apart.
2. Section of the column, which is not published, together with the springs at its base: the two open modes at 230 and
   300 Hz are the column rocking along and across the beam. Minutes, as every other section is another mesh.
3. Platform height to the published preload, for the faces of the scene.
4. Modal damping to the energies of table 5.3, all five forces.
5. Wear coefficient to the published life and friction work. Both go with its inverse, so that one wear run tells it.
   The published coefficient, measured as slope of volume over work, stays in the scene.
What is found stands in scenes/rig.toml, marked "fit"; nothing is written there by a fit."""

from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache

import numpy as np
from threadpoolctl import threadpool_limits

from proof.cases.rig.joints import Joints, joints_of
from proof.cases.rig.model import TIED, Rig, check
from proof.cases.rig.published import LIFE_MEASURED, OPEN, PRELOAD, STUCK, TABLE_5_3, WORK
from proof.cases.rig.wear import RigWear, wear_down
from tests.helpers.fits import fit_by_differences as identify
from tribodyn.refusal import Refusal
from tribodyn.workflows.run import model_cache
from tribodyn.workflows.scene.scene_file import SceneFile, read_scene
from tribodyn.workflows.studies.fits.identification import FitParameter, Identification, MeasuredNumber

RIGID = 1e11  # stiffness beyond which no published frequency changes by one in a thousand [N/m]
MICROMETRE = 1e-6
SECTIONS = 3  # models kept, some 0.2 GB each: a section and its two neighbours for the derivatives
FREQUENCIES = tuple(
    MeasuredNumber(f"{state}, {kind}", value, "Hz")
    for state, modes in (("open", OPEN), ("stuck", STUCK))
    for kind, value in modes
)


def stiffnesses(values: Mapping[str, float]) -> dict[str, float]:
    """Stiffness of each spring of the scene from the tied ones [N/m]."""
    return {name: values[tied] for tied, names in TIED.items() for name in names}


def rigid() -> dict[str, float]:
    """Joints that do not give way, as the model is before the fit."""
    return stiffnesses(dict.fromkeys(TIED, RIGID))


def fit_joints(joints: Joints) -> Identification:
    """Joint springs to the published frequencies; "before" is the rig with rigid joints."""
    parameters = [FitParameter(name, 1e8, RIGID, (1e9 if name.startswith("base") else RIGID,), "N/m") for name in TIED]
    before = dict.fromkeys(TIED, RIGID)
    return identify(parameters, FREQUENCIES, lambda values: joints.frequencies(stiffnesses(values)), before)


def fit_column(scene: str, overrides: Sequence[str] = ()) -> Identification:
    """Section of the column and springs at its base to the published frequencies, from a square section."""

    @lru_cache(maxsize=SECTIONS)
    def joints(length: float, depth: float) -> Joints:
        section = (f"geometry.column_length={length!r} m", f"geometry.column_depth={depth!r} m")
        return joints_of(read_scene(scene, (*overrides, *section)))

    def predict(values: Mapping[str, float]) -> np.ndarray:
        length, depth = (round(values[name] / MICROMETRE) * MICROMETRE for name in ("column_length", "column_depth"))
        return joints(length, depth).frequencies(stiffnesses({**values, "seat": RIGID}))

    springs = [FitParameter(name, 1e8, RIGID, (1e9,), "N/m") for name in ("base_vertical", "base_sliding")]
    section = [FitParameter(name, 0.085, 0.13, (0.1,), "m") for name in ("column_length", "column_depth")]
    return identify([*springs, *section], FREQUENCIES, predict)


def fit_height(rig: Rig) -> Identification:
    """Platform height to the published preload."""
    parameter = FitParameter("platform", 5e-6, 50e-6, (rig.height,), "m")
    with model_cache.memory_cache():
        return identify(
            [parameter],
            [MeasuredNumber("preload", PRELOAD, "N")],
            lambda values: np.array([rig.with_height(values["platform"]).at_rest().preload]),
        )


def fit_damping(rig: Rig) -> Identification:
    """Modal damping to the published energies per cycle."""
    measured = [MeasuredNumber(f"energy at {force:.0f} N", energy, "J") for force, (energy, _) in TABLE_5_3.items()]

    def energies(values: Mapping[str, float]) -> np.ndarray:
        damped = rig.with_damping(values["modal damping"])
        return np.array([max(damped.with_force(force).cycle().energy, 1e-9) for force in TABLE_5_3])

    with model_cache.memory_cache():
        return identify([FitParameter("modal damping", 0.005, 0.06, (0.01, 0.03), "-")], measured, energies)


def fit_coefficient(run: RigWear, coefficient: float) -> Identification:
    """Wear coefficient to the published life and friction work; `run` was done with `coefficient` [m3/J].

    Raises  ValueError where the run did not end with the preload lost"""
    if not run.lost:
        raise Refusal(f"a wear coefficient needs a run that loses its preload, but this one: {run.end}")
    final = np.array([run.history.cycles[-1], run.spent[-1]])
    measured = [MeasuredNumber("cycles to loss", LIFE_MEASURED), MeasuredNumber("work to loss", WORK, "J")]
    parameter = FitParameter("coefficient", coefficient / 10, 10 * coefficient, (coefficient,), "m3/J")
    return identify([parameter], measured, lambda values: final * coefficient / values["coefficient"])


def run(
    scene: str, overrides: Sequence[str], column: bool, wear: bool, tell: Callable[[str], None]
) -> dict[str, Identification]:
    """Every fit by its name: to joints, height and damping, and on demand of the column and by a whole wear run.

    tell : called with a sentence on what is under way"""
    fits = {}
    file = read_scene(scene, overrides)
    check(file)
    with threadpool_limits(1):
        if column:
            tell("section of the column: a mesh and a reduction for every section tried")
            title = "Section of the column and springs at its base to published frequencies"
            fits[title] = fit_column(scene, overrides)
        tell("joint springs")
        fits["Joint springs to published frequencies, before: rigid joints"] = fit_joints(joints_of(file))
        rig = Rig.of(file)
        tell("platform height and damping")
        fits["Platform height to the preload, with the springs of the scene"] = fit_height(rig)
        fits["Modal damping to the energies of table 5.3, with the springs of the scene"] = fit_damping(rig)
        if wear:
            fits["Wear coefficient to the published life and work; not used"] = _coefficient(rig, file, tell)
    return fits


def _coefficient(rig: Rig, file: SceneFile, tell: Callable[[str], None]) -> Identification:
    wear = file.mesh_scene.wear
    assert wear is not None
    return fit_coefficient(wear_down(rig, 0.0, tell), wear.numbers["coefficient"])


def as_text(fits: Mapping[str, Identification]) -> str:
    """All reports."""
    return "\n\n".join(f"{title}\n{identification.report()}" for title, identification in fits.items())
