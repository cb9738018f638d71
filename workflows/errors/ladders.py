"""The parameters of a scene that trade speed for accuracy: each a list of overrides from coarse to fine."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from tribodyn.hbm.contact import law
from tribodyn.workflows.scene.scene_file import SceneFile
from tribodyn.workflows.scene.schema import PartScene, Scene

TOPS = (1, 3, 5, 7, 9, 13)  # highest harmonic kept
WORN_TOP = 5  # more harmonics take minutes to wear
SAMPLES = (32, 64, 256)
NEWTON = (1e-4, 1e-6, 1e-8)
KRYLOV = (0.5, 0.1, 1e-6)
POINTS = (20, 40, 80, 160, 320, 640)
ARCS = (0.25, 0.1, 0.04, 0.016)  # longest arc and turn of the tangent in one step
CUTOFFS = (0.25, 0.5, 1, 2)  # over that of the scene
RANKS = (3, 6, 12, 24)
WEAR_STEPS = (0.1, 0.05)  # of delta_max
WEAR_TOLERANCES = (0.3, 0.1, 0.03, 0.01, 0.003)
TEXTS = ("base", "unworn")  # keys of a study that are lists of texts
EXACT = float("nan")  # size of a setting that leaves no error


@dataclass(frozen=True)
class Setting:
    """One position of a parameter: overrides of the scene, and how fine it is: its error falls with a power of size.

    refined : whether the peak is refined, or is the highest point of the curve, as a run states it
    """

    size: float
    overrides: tuple[str, ...]
    refined: bool = True

    @property
    def label(self) -> str:
        """The overrides without their sections."""
        if not self.overrides:
            return "refined peak"
        parts = [text.partition("=") for text in self.overrides]
        return ", ".join(f"{key.rpartition('.')[2]}={value}" for key, _, value in parts)


@dataclass(frozen=True)
class Parameter:
    """A parameter of a scene.

    settings : from coarse to the finest, which is the last
    tunable : whether finer is closer to the truth, so that a wanted accuracy may choose it; else it is another model
    worn_up_to : size up to which depth and life are measured too
    """

    name: str
    settings: tuple[Setting, ...]
    tunable: bool = True
    worn_up_to: float = math.inf

    def wears(self, setting: Setting) -> bool:
        """Whether depth and life of a setting are measured."""
        return self.worn_up_to > 0 and not setting.size > self.worn_up_to


@dataclass(frozen=True)
class Ladder:
    """Grids or meshes of a convergence study.

    base : overrides; life_up_to : size up to which the contact is worn
    placements : overrides that put the nodes elsewhere; every setting up to size `placed_up_to` is measured with each
    """

    name: str
    settings: tuple[Setting, ...]
    base: tuple[str, ...]
    life_up_to: float
    placements: tuple[tuple[str, ...], ...] = ()
    placed_up_to: float = 0.0


@dataclass(frozen=True)
class Study:
    """How a scene is studied.

    base : overrides that make its trade affordable
    parameters : that only its geometry has, or with settings of its own
    ladders : grids and meshes of its convergence study
    unworn : parameters whose depth and life are not measured, because that takes too long
    """

    base: tuple[str, ...] = ()
    parameters: tuple[Parameter, ...] = ()
    ladders: tuple[Ladder, ...] = ()
    unworn: tuple[str, ...] = ()


def study_path(file: SceneFile) -> Path:
    """Where the study of a scene lies: beside it."""
    return file.folder / f"{file.name}.study.toml"


def study_of(file: SceneFile) -> Study:
    """The study of a scene, an empty one where there is none; raises ValueError for a file that is no study."""
    path = study_path(file)
    if not path.is_file():
        return Study()
    try:
        return _study(tomllib.loads(path.read_text(encoding="utf-8")))
    except ValueError as trouble:
        raise ValueError(f"{path}: {trouble}") from None
    except (TypeError, AttributeError):
        raise ValueError(f"{path} is no study: write its tables as those in workflows/cases") from None


def _study(table: dict[str, Any]) -> Study:
    unknown = set(table) - {"parameters", "converge", *TEXTS}
    if unknown:
        raise ValueError(f"a study has no {', '.join(sorted(unknown))}, but parameters, converge, {', '.join(TEXTS)}")
    parameters = tuple(
        Parameter(parameter, _settings(given), worn_up_to=float(given.get("worn_up_to", math.inf)))
        for parameter, given in table.get("parameters", {}).items()
    )
    ladders = tuple(
        Ladder(
            ladder,
            _settings(given),
            tuple(given.get("base", ())),
            float(given.get("life_up_to", 0)),
            tuple(tuple(texts) for texts in given.get("placements", ())),
            float(given.get("placed_up_to", 0)),
        )
        for ladder, given in table.get("converge", {}).items()
    )
    said = {name: tuple(table.get(name, ())) for name in TEXTS}
    return Study(parameters=parameters, ladders=ladders, **said)


def _settings(table: dict[str, Any]) -> tuple[Setting, ...]:
    sizes, texts = table.get("sizes", ()), table.get("set", ())
    if not sizes or len(sizes) != len(texts) or not all(isinstance(one, list) for one in texts):
        raise ValueError(
            'every parameter and ladder needs sizes = [1, 2] and as many set = [["section.key=value"], []]'
        )
    return tuple(Setting(float(size), tuple(one)) for size, one in zip(sizes, texts, strict=True))


def parameters_of(file: SceneFile, study: Study) -> tuple[Parameter, ...]:
    """The parameters that a scene has: those of its study, then those that any scene may have and the study has not."""
    own = {parameter.name: parameter.settings for parameter in study.parameters}
    found = (*study.parameters, *(one for one in _of_any(file, own) if one.name not in own))
    return tuple(replace(one, worn_up_to=0.0) if one.name in study.unworn else one for one in found)


def _of_any(file: SceneFile, own: dict[str, tuple[Setting, ...]]) -> list[Parameter]:
    scene = file.scene
    found: list[Parameter] = []
    if isinstance(scene, PartScene):
        found += _of_a_part(scene)
    found += [*_of_harmonics(scene)]
    found.append(_numbers("newton", "solver.tolerance", NEWTON))
    found.append(_numbers("krylov", "solver.krylov", KRYLOV))
    finer: list[tuple[float, tuple[str, ...]]] = []
    if scene.response.method == "natural":
        finer = [(n, (f"response.points={n}",)) for n in POINTS]
    if scene.response.method == "arc_length":
        finer = [(1 / a, tuple(f"response.options.{key}={a:g}" for key in ("step", "max_step", "angle"))) for a in ARCS]
    if finer:  # wear finds its own peak
        settings = tuple(Setting(size, texts, refined=False) for size, texts in finer)
        found.append(Parameter("points", (*settings, Setting(EXACT, ())), worn_up_to=0))
    if scene.wear is not None and scene.wear.max_steps > 0:
        rule = 'wear.rule="error_controlled"'
        controlled = tuple(Setting(1 / t, (rule, f"wear.tolerance={t:g}")) for t in WEAR_TOLERANCES)
        thesis = tuple(Setting(1 / s, ('wear.rule="thesis"', f"wear.step={s:g}")) for s in WEAR_STEPS)
        found.append(Parameter("wear", controlled))
        finest = Setting(EXACT, own.get("wear", controlled)[-1].overrides)
        found.append(Parameter("wear_thesis", (*thesis, finest), tunable=False))
    return found


def chosen(known: Sequence[Parameter], names: Sequence[str]) -> tuple[Parameter, ...]:
    """Parameters by name, all where none is named; raises ValueError for one that the scene does not have."""
    missing = [name for name in names if name not in {parameter.name for parameter in known}]
    if missing:
        names_known = ", ".join(parameter.name for parameter in known)
        raise ValueError(f"--setting {missing[0]}: the scene has the parameters {names_known}")
    return tuple(parameter for parameter in known if not names or parameter.name in names)


def _of_a_part(scene: PartScene) -> list[Parameter]:
    found = []
    if scene.contact.plane is None and not scene.surfaces:
        corners = Setting(1.0, ("contact.vertices_only=true",))
        found.append(Parameter("nodes", (corners, Setting(EXACT, ("contact.vertices_only=false",))), tunable=False))
    modes = scene.reduction.modes
    if modes:
        counts = sorted({0, modes // 3, modes, 3 * modes})
        found.append(Parameter("modes", tuple(Setting(n, (f"reduction.modes={n}",)) for n in counts)))
    if scene.reduction.cutoff:
        cutoffs = [factor * scene.reduction.cutoff for factor in CUTOFFS]
        found.append(Parameter("modes", tuple(Setting(c, (f"reduction.cutoff={c:g}",)) for c in cutoffs)))
    if scene.wheel is not None:
        return found
    ranks = tuple(Setting(n, (f"reduction.interface_modes={n}",)) for n in RANKS)
    found.append(Parameter("interface_rank", (*ranks, Setting(EXACT, ("reduction.interface_modes=",)))))
    return found


def _of_harmonics(scene: Scene) -> list[Parameter]:
    needed = {load.harmonic for load in scene.loads.harmonic.values()} | set(scene.harmonics.kept[:1]) & {0}
    tops = [top for top in TOPS if top >= max(needed)]
    first = 0 if 0 in needed or scene.harmonics.automatic else 1
    more = ("harmonics.samples=128",) if scene.harmonics.samples < 128 else ()
    kept = tuple(Setting(top, (f"harmonics.kept={list(range(first, top + 1))}", *more)) for top in tops)
    found = [Parameter("harmonics", kept, worn_up_to=WORN_TOP)] if len(kept) > 1 else []
    if all(hasattr(law.load(contact.law_name), "located") for contact in scene.joints.values()):
        top = max(scene.harmonics.kept, default=1)
        sampled = tuple(
            Setting(n, (f"harmonics.samples={n}", 'harmonics.transitions="sampled"')) for n in SAMPLES if n > 2 * top
        )
        located = ("harmonics.samples=128", 'harmonics.transitions="located"')
        found.append(Parameter("samples", (*sampled, Setting(EXACT, located))))
    one = scene.joints.get("contact")
    if one is not None and one.components == ("t1", "t2", "n") and one.law == "jenkins":
        common = ["harmonics.samples=256", 'harmonics.transitions="sampled"']
        if scene.wear is not None:  # the error-controlled rule solves for depth and knows no planar slider
            common += ['wear.rule="thesis"', f"wear.step={WEAR_STEPS[0]:g}"]
        names = ("jenkins", "coulomb_planar")  # directions that know nothing of each other, or one planar slider
        laws = tuple(Setting(EXACT, (f'contact.law="{name}"', *common)) for name in names)
        found.append(Parameter("friction", laws, tunable=False))
    return found


def _numbers(name: str, key: str, values: tuple[float, ...]) -> Parameter:
    return Parameter(name, tuple(Setting(1 / value, (f"{key}={value:g}",)) for value in values))
