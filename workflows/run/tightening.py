"""Bolts of a scene: what their shanks are, and how far they are turned so that each reaches its preload.

A locked bolt has the force N = P + k e. P is what its turning adds to the elongation of the clamped parts: it is found
so that N is the preload where the bolts act alone and the contact has settled.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from tribodyn.fem.bolts import Bolt
from tribodyn.fem.material import Material
from tribodyn.hbm import newton
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.workflows.run import bodies
from tribodyn.workflows.run.part_reduction import BOLTS
from tribodyn.workflows.scene.structure import StructureScene

REACHED = 1e-10  # relative error of a preload
TURNS = 40
LARGEST = 1e6  # load over preload from which on a bolt clamps nothing


def output(name: str) -> str:
    """Name of the elongation of a bolt among the outputs."""
    return f"{BOLTS}{name}"


def rods(scene: StructureScene, mesh: Any, node_sets: Mapping[str, np.ndarray]) -> dict[str, Bolt]:
    """The bolts with the stiffness of their shanks; that of a constant force has none.

    Raises  ValueError for unknown faces, an orthotropic shank, or a bolt that crosses nothing
    """
    found = {}
    for name, table in scene.bolts.items():
        rod = Bolt(name, table.first, table.second)
        stiffness = 0.0
        if table.state == "locked":
            stiffness = table.stiffness or 0.0
            if table.diameter is not None and table.material is not None:
                solid = bodies.solid(scene.materials[table.material])
                if not isinstance(solid, Material):
                    raise ValueError(f"bolts.{name}: its material is orthotropic; give an isotropic one or stiffness")
                stiffness = solid.E * np.pi * table.diameter**2 / 4 / rod.length(mesh, node_sets)
        found[name] = Bolt(name, table.first, table.second, stiffness)
    return found


def tightened(
    scene: StructureScene,
    stiffness: Mapping[str, float],
    balance_of: Callable[[Mapping[str, float]], HarmonicBalance],
    omega: float,
) -> dict[str, float]:
    """P of every bolt [N].

    stiffness : k of every bolt [N/m]; balance_of : the problem under bolt loads alone; omega : any frequency [rad/s]
    Raises  ValueError where the contact does not settle or a preload is not reached
    """
    wanted = {name: table.preload for name, table in scene.bolts.items()}
    loads = dict(wanted)
    locked = [name for name in wanted if stiffness[name] > 0]
    if not locked:
        return loads
    k = np.array([stiffness[name] for name in locked])
    target = np.array([wanted[name] for name in locked])
    slope = np.eye(len(locked))
    before: tuple[np.ndarray, np.ndarray] | None = None
    for _ in range(TURNS):
        balance = balance_of(loads)
        solved = newton.solve(balance, omega, balance.stuck(omega), newton.NewtonOptions(tolerance=1e-12))
        if not solved.converged:
            raise ValueError(f"bolts: tightening does not settle ({solved.outcome}); lower the preload or add friction")
        names = balance.compliance.output_names
        elongation = balance.outputs(solved.state)[[names.index(output(name)) for name in locked], 0]
        P = np.array([loads[name] for name in locked])
        force = P + k * elongation
        if np.abs(force - target).max() <= REACHED * target.max():
            return loads
        if before is not None:  # Broyden's update of d force / d P
            dP, dN = P - before[0], force - before[1]
            slope += np.outer(dN - slope @ dP, dP) / (dP @ dP)
        before = P, force
        P = P + np.linalg.solve(slope, target - force)
        if np.abs(P).max() > LARGEST * target.max():
            break
        loads |= dict(zip(locked, P.tolist(), strict=True))
    raise ValueError(f"bolts: the preload of {', '.join(locked)} is not reached; check what they clamp")
