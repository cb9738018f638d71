"""Hertz contact of two bodies whose meshes do not match, from mesh files and a scene to the pressure."""

from pathlib import Path

import numpy as np
import pytest

from tribodyn.geometry import blocks
from tribodyn.hbm import newton
from tribodyn.workflows.run import modelling
from tribodyn.workflows.run.progress import Progress
from tribodyn.workflows.scene import scene_file

E_1, NU_1, E_2, NU_2 = 70e9, 0.33, 210e9, 0.3
MODULUS = 1 / ((1 - NU_1**2) / E_1 + (1 - NU_2**2) / E_2)
RADIUS, HALF = 50e-3, 1e-3  # of the upper body, and of the contact that the load is to make [m]
THICK = 1e-3

SCENE = f"""
[scene]
title = "Hertz"
[materials.soft]
young = {E_1}
poisson = {NU_1}
density = 2700.0
[materials.stiff]
young = {E_2}
poisson = {NU_2}
density = 7800.0
[bodies.upper]
mesh = "upper.msh"
material = "soft"
fixed_axes = {{ side = "y", middle = "x" }}
[bodies.lower]
mesh = "lower.msh"
material = "stiff"
fixed_axes = {{ side = "y", middle = "x", back = "z" }}
[contacts.hertz]
first = "upper.patch"
second = "lower.patch"
t1 = "x"
components = ["n"]
law = "unilateral"
normal_stiffness = 3e10
[loads.static.press]
group = "upper.back"
direction = "-z"
value = LOAD
[loads.harmonic.shake]
group = "upper.back"
direction = "z"
value = 1.0
[response]
group = "upper.back"
direction = "z"
frequency = ["100 Hz", "200 Hz"]
points = 3
[reduction]
modes = 2
"""


def graded(start: float, first: float, end: float, growth: float = 1.7) -> np.ndarray:
    """Positions from start to end whose distances grow from about `first`."""
    x = [start]
    while x[-1] < end:
        x.append(x[-1] + first * growth ** (len(x) - 1))
    return start + (np.array(x) - start) * (end - start) / (x[-1] - start)


def write(path: Path, n: int, reach: float, size: float, up: bool, point: bool) -> None:
    """Half a cylinder or a quarter of a sphere over z = 0, or a flat body below, n elements over the patch."""
    nearby = np.linspace(0, reach, n + 1)
    far, height = graded(reach, nearby[1], size), graded(0, nearby[1], size)
    height = height if up else -height[::-1]
    patch, back = ("w-", "w+") if up else ("w+", "w-")

    def curved(p: np.ndarray) -> np.ndarray:
        distant = p[:, 0] ** 2 + point * p[:, 1] ** 2
        return np.column_stack([p[:, :2], p[:, 2] + up * distant / (2 * RADIUS) * (1 - p[:, 2] / size)])

    across = (nearby, far) if point else (np.array([0, THICK]),)
    parts = []
    for u in (nearby, far):
        for v in across:
            touches = u is nearby and v is across[0]
            sides = {patch: "patch" if touches else "rest", back: "back"}
            sides |= {"u-": "middle"} if u is nearby else {}
            sides |= {"v-": "side"} if v is across[0] else {}
            sides |= {} if point else {"v+": "side"}
            parts.append(blocks.Block(u, v, height, path.stem, sides, curved))
    blocks.write(path, blocks.body(parts))


def pressed(folder: Path, load: float, n: tuple[int, int], size: float, point: bool) -> tuple[np.ndarray, ...]:
    """Place (n_pair, 3) [m], force [N] and area [m2] of the pairs under a load [N]."""
    write(folder / "upper.msh", n[0], 1.6 * HALF, size, True, point)
    write(folder / "lower.msh", n[1], 1.8 * HALF, size, False, point)
    file = scene_file.parse(SCENE.replace("LOAD", repr(load)), "hertz.toml", (), folder)
    balance = modelling.build(file, Progress()).balance.with_load(0.0)
    omega = 2 * np.pi * 100
    solution = newton.solve(balance, omega, balance.stuck(omega))
    assert solution.converged
    force, interface = solution.state.cycle.force[:, 0, 0], balance.model.interface
    assert force.sum() == pytest.approx(load, rel=2e-4)  # pairs are tilted by up to 0.02
    return interface.points, force, interface.area


def test_a_cylinder_on_a_flat_body_of_another_mesh_is_hertz(tmp_path: Path) -> None:
    """Half-width a = sqrt(4 P R / (pi E*)) and pressure p_0 sqrt(1 - x^2 / a^2) within 2 %, P per length."""
    per_length = np.pi * MODULUS * HALF**2 / (4 * RADIUS)
    points, force, area = pressed(tmp_path, per_length * THICK / 2, (8, 7), 30 * HALF, False)
    x, peak = points[:, 0] / HALF, 2 * per_length / (np.pi * HALF)
    assert np.sqrt(4 * (force @ x**2) / force.sum()) == pytest.approx(1.0, abs=0.02)
    inside = x < 0.9
    assert inside.sum() > 15
    assert (force / area)[inside] / peak == pytest.approx(np.sqrt(1 - x[inside] ** 2), abs=0.02)


@pytest.mark.slow
def test_a_sphere_on_a_flat_body_of_another_mesh_is_hertz(tmp_path: Path) -> None:
    """Radius a^3 = 3 P R / (4 E*) and peak pressure 3 P / (2 pi a^2) within 2 %."""
    load = 4 * MODULUS * HALF**3 / (3 * RADIUS)
    points, force, area = pressed(tmp_path, load / 4, (5, 4), 12 * HALF, True)
    r, peak = np.hypot(points[:, 0], points[:, 1]) / HALF, 3 * load / (2 * np.pi * HALF**2)
    assert np.sqrt(5 / 2 * (force @ r**2) / force.sum()) == pytest.approx(1.0, abs=0.02)
    assert (force / area)[r.argmin()] == pytest.approx(peak, rel=0.02)
