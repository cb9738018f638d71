"""A small scene made of matrices, with its files."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

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


def masses(rng: np.random.Generator, contact: Callable[..., dict[str, Any]]) -> dict[str, Any]:
    """Matrices of masses, each on struts to the one before; one to four of them rub on the ground, along x and y."""
    n = int(rng.integers(1, 21))
    stiffness = np.zeros((3 * n, 3 * n))
    for i in range(n):
        ends = (np.arange(n) == i).astype(float) - (np.arange(n) == i - 1)
        struts = np.kron(ends, np.linalg.qr(rng.normal(size=(3, 3)))[0])
        stiffness += struts.T * 10 ** rng.uniform(5.5, 6.5, 3) @ struts
    pairs = [3 * int(i) for i in rng.choice(n, min(n, int(rng.integers(1, 5))), replace=False)]
    law = {key: value for key, value in contact(rng, 3e6, False).items() if key not in ("t1", "vertices_only")}
    shaken = {"dofs": [3 * int(rng.integers(n))]}
    return {
        "model": {"file": "part.npz"},
        "matrices": {"M": np.diag(np.repeat(rng.uniform(0.2, 2.0, n), 3)), "K": stiffness},
        "contact": {"dofs": [[i, i + 1, i + 2] for i in pairs], "area": 1e-4, **law},
        "loads": {
            "static": {"press": {"dofs": [i + 2 for i in pairs], "value": float(10 ** rng.uniform(2, 4))}},
            "harmonic": {"shake": shaken | {"value": 1.0}},
        },
        "response": dict(shaken),
    }
