"""A fingerprint of the matrices that a small beam is reduced to."""

import hashlib
from pathlib import Path

import numpy as np


def digest(folder: Path) -> str:
    """Of the reduced matrices of a small beam."""
    from tribodyn.workflows.run import modelling
    from tribodyn.workflows.run.progress import Progress
    from tribodyn.workflows.scene.scene_file import read

    small = (
        "harmonics.kept=[0, 1]", "geometry.n_patch=5", "geometry.n_length=4", "geometry.n_height=1",
        "reduction.modes=4", "wear=",
    )  # fmt: skip
    system = modelling.build(read("beam", small), Progress()).reduced.system
    two_results = np.ascontiguousarray(np.concatenate([np.asarray(system.stiffness), np.asarray(system.mass)]))
    return hashlib.sha256(two_results.tobytes()).hexdigest()
