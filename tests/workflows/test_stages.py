"""Every field of a scene declares the stage that reads it first; a change of it leaves earlier stages as they are."""

from collections.abc import Iterator
from typing import Any, get_args

import numpy as np
import pytest
import scipy.sparse as sp

from tests.helpers.matrix_scene import SCENE as MATRICES
from tests.helpers.structures import BLOCKS, STACK
from tests.helpers.wheel_scene import FLOW, WHEEL
from tribodyn.workflows.run import checkpoint, joints, modelling
from tribodyn.workflows.run.progress import Progress
from tribodyn.workflows.scene import scene_file
from tribodyn.workflows.scene.fields import (
    CONTACT,
    DRAW,
    LOADS,
    PARAMETERS,
    PART,
    REDUCTION,
    SOLVE,
    SceneStage,
    Table,
    stage_of,
)
from tribodyn.workflows.scene.matrix_scene import MatrixScene
from tribodyn.workflows.scene.scene_values import SceneValue, scene_values, values_through
from tribodyn.workflows.scene.wheel_scene import WheelScene

WEAR = '[wear]\ncoefficient = "2e3 um3/J"\nstep = "5 %"\n'
BACKBONE = "[backbone]\nmodal_amplitude = [1e-6, 1e-3]\n"
SPRING = '[springs.support]\ngroup = "a.x_max"\ndirection = "y"\nstiffness = "2 N/um"\n'
SCENES = {
    "blocks": BLOCKS + WEAR + BACKBONE,
    "bolted": STACK + SPRING,
    "wheel": WHEEL + FLOW + "[mistuning]\nfrequency = 0.01\n",
    "matrices": MATRICES,
}


def tables_in(annotation: Any) -> Iterator[type[Table]]:
    """The classes of tables in a type."""
    if isinstance(annotation, type) and issubclass(annotation, Table):
        yield annotation
    else:
        for part in get_args(annotation):
            yield from tables_in(part)


def fields_without_stage(table: type[Table], checked: set[type[Table]]) -> Iterator[str]:
    if table in checked:
        return
    checked.add(table)
    for name, field in table.model_fields.items():
        inner = list(tables_in(field.annotation))
        if not inner and name != PARAMETERS and stage_of(field) is None:
            yield f"{table.__name__}.{name}"
        for kind in inner:
            yield from fields_without_stage(kind, checked)


@pytest.mark.parametrize("kind", [WheelScene, MatrixScene])
def test_every_field_has_a_stage(kind: type[Table]) -> None:
    assert list(fields_without_stage(kind, set())) == []


def test_a_field_without_a_stage_is_seen() -> None:
    class Incomplete(Table):
        length: float = 0.0

    assert list(fields_without_stage(Incomplete, set())) == ["Incomplete.length"]


def with_value(table: Any, path: tuple[str, ...], value: object) -> Any:
    """A table of a scene, or a dict or list of tables, with another value at a path of keys; nothing is checked."""
    name, *inner = path
    if isinstance(table, dict):
        return {**table, name: with_value(table[name], tuple(inner), value) if inner else value}
    if isinstance(table, tuple):
        place = int(name)
        return (*table[:place], with_value(table[place], tuple(inner), value), *table[place + 1 :])
    if name not in type(table).model_fields:  # declared by a law or a part
        extra = table.model_extra
        changed: Any = table.model_copy(update={name: value} if extra else {PARAMETERS: {**table.numbers, name: value}})
        return changed
    updated = with_value(getattr(table, name), tuple(inner), value) if inner else value
    return table.model_copy(update={name: updated})


@pytest.mark.parametrize("scene", [*SCENES, "beam"])
def test_a_change_of_any_key_is_seen_by_its_stage_and_all_later_ones(scene: str) -> None:
    """What the cache and the resumption compare; the value is none that a scene could have."""
    file = scene_file.parse(SCENES[scene], "scene.toml") if scene in SCENES else scene_file.read(scene)
    base = values_through(file.scene, DRAW)
    for entry in scene_values(file.scene):
        changed = with_value(file.scene, entry.path, "another value")
        assert values_through(changed, entry.stage) == values_through(file.scene, entry.stage) | {
            entry.key: "another value"
        }
        if entry.stage > PART:
            earlier = SceneStage(entry.stage - 1)
            assert values_through(changed, earlier) == values_through(file.scene, earlier), entry.key
        resumable = entry.stage is DRAW or entry.is_resumable
        assert checkpoint.same_problem(file.scene, changed) == ("" if resumable else entry.key), entry.key
    assert len(base) == len(list(scene_values(file.scene)))


def arrays(value: Any) -> Iterator[np.ndarray]:
    """All numbers inside arrays, matrices, mappings and dataclasses."""
    if sp.issparse(value):
        yield value.toarray()
    elif isinstance(value, dict):
        for name in sorted(value, key=str):
            yield from arrays(value[name])
    elif isinstance(value, (list, tuple)):
        for item in value:
            yield from arrays(item)
    elif value is not None:
        yield np.asarray(value)


def outcomes(file: scene_file.SceneFile, last: SceneStage) -> dict[SceneStage, list[np.ndarray]]:
    """What each stage up to the last one makes of a scene, nothing of it from a cache."""
    scene = file.mesh_scene
    part = modelling.part_of(file, Progress())
    system, interface = part.system, part.interface
    matrices = (system.mass, system.stiffness, system.loads, system.outputs)
    built: dict[SceneStage, Any] = {PART: (*matrices, interface.B, interface.area, part.free)}
    if last > PART:
        part, _ = modelling.with_surfaces(file, part)
        model = modelling.plain_of(file, part)
        built[REDUCTION] = (model.system.mass, model.system.stiffness, model.system.loads, model.interface.B)
    if last > REDUCTION:
        parameters = [joint.parameters for joint in joints.make_joints(scene, model)]
        built[CONTACT] = [(p.stiffness, p.gap, dict(p.numbers), p.table) for p in parameters]
    if last > CONTACT:
        built[LOADS] = joints.excite(scene, None).loads
    return {stage: list(arrays(value)) for stage, value in built.items()}


# changes that belong together, of keys that no earlier stage may see: the stage whose predecessors are compared
CHANGES: list[tuple[str, SceneStage, tuple[str, ...]]] = [
    ("blocks", REDUCTION, ("reduction.modes=7",)),
    ("blocks", REDUCTION, ("reduction.modes=", "reduction.cutoff=30 kHz", "reduction.relative=true")),
    ("blocks", REDUCTION, ('reduction.method="residual_flexibility"',)),
    ("blocks", REDUCTION, ("reduction.interface_modes=6", "reduction.interface_keep=[]")),
    ("wheel", REDUCTION, ("wheel.engine_order=2", "wheel.coriolis=false", 'wheel.sweep="frequency"')),
    ("blocks", CONTACT, ("contacts.lap.friction=0.5", "contacts.lap.tangential_stiffness=90 N/um")),
    ("blocks", CONTACT, ("contacts.lap.normal_stiffness=90 N/um",)),
    ("blocks", CONTACT, ('contacts.lap.law="coulomb_planar"',)),
    ("blocks", CONTACT, ("contacts.lap.tangential_stiffness=", "contacts.lap.normal_stiffness=",
                         'contacts.lap.punch=["40 mm", "14 mm"]')),
    ("blocks", CONTACT, ("contacts.lap.temperature=10 K",
                         'contacts.lap.friction={over="temperature", at=["0 K", "20 K"], values=[0.5, 0.3]}')),
    ("blocks", LOADS, ("loads.static.press.pressure=2 MPa", "loads.harmonic.pull.value=3 N",
                       "loads.harmonic.pull.phase=1 rad", "loads.harmonic.pull.harmonic=2")),
    ("bolted", LOADS, ("bolts.m8.preload=7 kN", "loads.harmonic.shake.value=3 N")),
    ("blocks", SOLVE, (
        'response.frequency=["4 kHz", "8 kHz"]', "response.points=11", 'response.method="arc_length"',
        "response.stability=true", 'response.references=["1 kHz", "9 kHz"]',
        'response.sweep="down"', "harmonics.kept=[0, 1, 2]", "harmonics.samples=64", 'harmonics.transitions="sampled"',
        "damping.modal=2 %", 'damping.state="stuck"', "solver.tolerance=1e-7", "preload.frictionless=true",
        "wear.coefficient=1e3 um3/J", 'wear.step="3 %"', "wear.max_steps=7", "wear.split=0.3",
        'wear.rule="error_controlled"', "wear.tolerance=0.1", "wear.lost_below=0.1", 'wear.at="5 kHz"',
        "verdict.enabled=false", "verdict.in_time=true", "backbone.mode=1", "backbone.points=9", 'scene.title="other"',
        "pictures.plots=false", "pictures.wear_scale=3", "pictures.deformation_scale=3",
    )),
    ("blocks", SOLVE, ("damping.modal=", "damping.ratios=[0.01, 0.02]", "damping.modes=[0, 1]")),
    ("blocks", SOLVE, ("damping.modal=", "damping.mass=2 1/s", "damping.stiffness=1e-7 s")),
    ("wheel", SOLVE, ("mistuning.friction=0.1", "mistuning.families=1", "flow.mode=1", "damping.modal=1 %")),
]  # fmt: skip


@pytest.mark.parametrize(("scene", "stage", "changes"), CHANGES)
def test_earlier_stages_make_the_same_of_a_changed_scene(scene, stage, changes, monkeypatch, tmp_path):
    monkeypatch.setenv("TRIBODYN_CACHE", "off")
    files = [scene_file.parse(SCENES[scene], "scene.toml", set_, tmp_path) for set_ in ((), changes)]
    different = _different(*(list(scene_values(file.scene)) for file in files))
    assert min(entry.stage for entry in different) >= stage
    base, changed = (outcomes(file, SceneStage(min(stage - 1, LOADS))) for file in files)
    for earlier in base:
        assert len(base[earlier]) == len(changed[earlier])
        for first, second in zip(base[earlier], changed[earlier], strict=True):
            np.testing.assert_array_equal(first, second)


def _different(*scenes: list[SceneValue]) -> list[SceneValue]:
    values = [{entry.key: entry.value for entry in scene} for scene in scenes]
    return [e for scene in scenes for e in scene if values[0].get(e.key) != values[1].get(e.key)]
