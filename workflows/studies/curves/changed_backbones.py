"""The backbone of a scene again with changes of it: finer harmonics, samples and meshes tell its error."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from time import process_time
from typing import Any

import numpy as np

from tribodyn.hbm.continuation.nonlinear_modes import Backbone
from tribodyn.hbm.threads import limited
from tribodyn.workflows.run import modelling
from tribodyn.workflows.run.failure import SolveFailed
from tribodyn.workflows.run.progress import Progress
from tribodyn.workflows.scene.scene_file import SceneFile
from tribodyn.workflows.studies.curves import backbones as modes

COMPARED = 9  # amplitudes at which two backbones are compared
LATE: Any = {"harmonics": True, "solver": True, "loads": {"static": {"__all__": {"value", "pressure"}}}}
"""What a scene may change without another part or reduction."""


@dataclass(frozen=True)
class Changed:
    """What a change of the scene does to its backbone.

    change : overrides, joined by ";"; modal_amplitude : (n,) [m kg^0.5]
    frequency, damping : (n,) differences there from the backbone of the scene, relative to it
    seconds : of the processor, with a model of its own where the change asks for one
    """

    change: str
    modal_amplitude: np.ndarray
    frequency: np.ndarray
    damping: np.ndarray
    seconds: float

    def record(self) -> dict[str, Any]:
        """For machines."""
        columns = {"modal_amplitude": self.modal_amplitude, "frequency": self.frequency, "damping": self.damping}
        return {"change": self.change, "seconds": self.seconds, "rows": modes.rows(columns)}


def changed_scenes(file: SceneFile, changes: Sequence[str]) -> dict[str, SceneFile]:
    """The scene with each of the changes, by their texts; raises SceneError for keys that it does not know."""
    return {text: file.changed(*(part.strip() for part in text.split(";") if part.strip())) for text in changes}


def follow(
    file: SceneFile,
    asked: modes.Way,
    model: modelling.Model,
    found: Backbone,
    others: Mapping[str, SceneFile],
    progress: Progress,
) -> list[Changed]:
    """Follow the backbone of a scene again with changes of it, one after the other, such as a finer mesh.

    model, found : of the scene itself; of the model is used what a change leaves as it is; others : `changed_scenes`
    Raises  ValueError for what cannot be; SolveFailed where a changed backbone is not found
    """
    done = []
    for text, other in others.items():
        clock = process_time()
        with limited(other.scene.solver.threads), progress.stage(text):
            if _early(other) == _early(file):
                balance = modelling.make_model(other.scene, model.part, model.reduced).balance
            else:
                balance = modelling.build(other, None, progress).balance
            there = modes.along(other, balance, asked, progress)
        if not there.converged.any():
            raise SolveFailed(f"the backbone with {text} {there.end}")
        ends = [f(b.modal_amplitude[b.converged]) for f in (min, max) for b in (found, there)]
        low, high = max(ends[:2]), min(ends[2:])
        if not low < high:
            raise SolveFailed(
                f"the backbone with {text} has no amplitude in common with that of the scene: {there.end}"
            )
        a = np.geomspace(low, high, COMPARED)
        a[[0, -1]] = low, high
        off = [t / o - 1 for t, o in zip(modes.at(there, a), modes.at(found, a), strict=True)]
        done.append(Changed(text, a, off[0], off[1], process_time() - clock))
    return done


def _early(file: SceneFile) -> str:
    """What part and reduction are made of: equal texts, equal models."""
    return json.dumps(file.scene.model_dump(mode="json", exclude=LATE), sort_keys=True)


def summed(changed: Sequence[Changed]) -> tuple[float, float]:
    """Largest sum of the differences of all changes, without their signs: of the frequency, of the damping."""
    sums = [np.sum([np.abs(getattr(one, name)) for one in changed], axis=0) for name in ("frequency", "damping")]
    return float(sums[0].max()), float(sums[1].max())
