"""A small scene made of matrices, with its files."""

from pathlib import Path

import numpy as np

from tests.helpers.verification_models import random_structure

SCENE = """
[scene]
title = "Matrices of another program"
[model]
file = "part.npz"
[contact]
dofs = [[0, 1, 2], [3, 4, 5]]
area = "10 mm2"
tangential_stiffness = "2 N/um"
normal_stiffness = "3 N/um"
friction = 0.4
[loads.static.press]
dofs = [2, 5]
value = "50 N"
[loads.harmonic.shaker]
dofs = [8]
value = "20 N"
[response]
dofs = [9]
frequency = ["35 Hz", "120 Hz"]
points = 30
[response.others.mid]
dofs = [6, 7]
[harmonics]
kept = [0, 1, 2, 3]
[wear]
coefficient = "2e3 um3/J"
step = "1 um"
max_steps = 4
"""


def matrix_folder(tmp_path: Path) -> Path:
    """A folder with a scene and its matrices, and with lists that a scene may name."""
    system = random_structure(2, n_extra=12).system
    np.savez(
        tmp_path / "part.npz", M=system.mass, K=system.stiffness, C=system.damping,
        touching=np.arange(6).reshape(2, 3), areas=np.full((2, 1), 5e-6), tip=np.eye(18)[9], half=[0.5, 1.0, 1.5],
        corners=np.array([[0.0, 0, 0], [1e-3, 0, 0]]),
    )  # fmt: skip
    (tmp_path / "own.toml").write_text(SCENE)
    return tmp_path
