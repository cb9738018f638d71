"""A third wear rule: one file beside a scene, found by its name, with its own numbers and its own memory."""

from pathlib import Path

import h5py
import numpy as np
import pytest

from tests.helpers import coarse_scenes
from tribodyn.workflows.errors import refine
from tribodyn.workflows.result import store
from tribodyn.workflows.run import checkpoint, pipeline, planning
from tribodyn.workflows.run.progress import Progress
from tribodyn.workflows.scene import scene_file

RULE = '''
"""Explicit steps whose depth grows by a ratio from step to step."""
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tribodyn.declarations import number
from tribodyn.hbm.wear.wear_rows import row_of
from tribodyn.hbm.wear.wear_rule import WearRule, WearStep
from tribodyn.hbm.wear.wear_problem import assess


@dataclass(frozen=True)
class Parameters:
    first_depth: float = number("m", role="accuracy", above=0.0)
    ratio: float = number("", default=1.0, above=0.0)


class Rule(WearRule):
    def __init__(self, problem, first_depth, ratio=1.0):
        super().__init__(problem)
        self.least_depth_of_step, self.ratio = first_depth, ratio

    @classmethod
    def build(cls, problem, settings):
        return cls(problem, **settings.numbers)

    @property
    def least_depth(self):
        return self.least_depth_of_step

    def step(self, state, rows):
        depth = float(rows[-1].memory["next_depth"]) if rows else self.least_depth_of_step
        cycles = depth / state.rate.max()
        memory = {"next_depth": np.asarray(self.ratio * depth)}
        row = row_of(self.problem, state, cycles, cycles * state.rate, cycles * state.work, memory=memory)
        return WearStep(row, lambda: assess(self.problem, state.depth + row.worn, state.cycles + cycles, state))
'''


def scene(folder: Path, *overrides: str) -> scene_file.SceneFile:
    (folder / "my_rule.py").write_text(RULE)
    text = (scene_file.CASES / "beam" / "beam.toml").read_text()
    base = ("wear.rule=my_rule.py", "wear.first_depth=2 um", "wear.ratio=2", "wear.at=800 Hz", "verdict.enabled=false")
    return scene_file.parse(text, "beam.toml", (*coarse_scenes.BEAM, *base, *overrides), folder)


def test_a_rule_beside_a_scene_wears_resumes_and_is_refined(tmp_path: Path) -> None:
    file = scene(tmp_path, "wear.max_steps=3")
    assert planning.plan(file).wear_steps is None
    full = pipeline.run(file, tmp_path / "whole", Progress()).wear
    np.testing.assert_allclose(full.worn.max(axis=1), [2e-6, 4e-6, 8e-6, 0.0], rtol=1e-12)
    pipeline.run(scene(tmp_path, "wear.max_steps=2"), tmp_path / "part", Progress())
    earlier = checkpoint.earlier(tmp_path / "part" / "result.h5", file)
    resumed = pipeline.run(file, tmp_path / "part", Progress(), earlier=earlier).wear
    np.testing.assert_array_equal(resumed.depth, full.depth)
    stored = store.load(tmp_path / "part").wear
    np.testing.assert_allclose(stored.memory["next_depth"], [4e-6, 8e-6, 16e-6, 16e-6])
    finer = refine.wear(file, 2.0).scene.wear
    assert finer.parameters == {"first_depth": 1e-6, "ratio": 2.0}


def test_a_result_of_an_older_layout_is_refused_in_a_sentence(tmp_path: Path) -> None:
    """As one of version 1.0, whose wear rules had an array without names for a memory."""
    with h5py.File(tmp_path / "result.h5", "w") as file:
        file.attrs["format"] = "tribodyn result 3"
    with pytest.raises(store.ResultError, match="is not a result file of this version of tribodyn"):
        checkpoint.earlier(tmp_path / "result.h5", scene(tmp_path))


def test_numbers_of_a_rule_are_checked_as_those_of_a_law(tmp_path: Path) -> None:
    with pytest.raises(scene_file.SceneError, match=r"wear.ratio.*above 0"):
        scene(tmp_path, "wear.ratio=0")
    with pytest.raises(scene_file.SceneError, match=r"wear\.rule: expected 'error_controlled', 'thesis' or"):
        scene(tmp_path, "wear.rule=newmark")
