"""Bolts of a scene: what their shanks are, and how far they are turned so that each reaches its preload.

A locked bolt has the force N = P + k e. P is what its turning adds to the elongation of the clamped parts: it is found
so that N is the preload where the bolts act alone and the contact has settled.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from tribodyn.fem.bolts import Bolt
from tribodyn.fem.material import Material
from tribodyn.hbm import newton
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.contact.joint import Joint
from tribodyn.hbm.excitation import Excitation
from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.reduction.model import ReducedModel
from tribodyn.refusal import Refusal
from tribodyn.workflows.run import scene_assembly
from tribodyn.workflows.run.part_reduction import BOLTS
from tribodyn.workflows.scene.schema import MeshScene


def output(name: str) -> str:
    """Name of the elongation of a bolt among the outputs."""
    return f"{BOLTS}{name}"


def rods(scene: MeshScene, mesh: Any, node_sets: Mapping[str, np.ndarray]) -> dict[str, Bolt]:
    """The bolts with the stiffness of their shanks; that of a constant force has none.

    Raises  ValueError for unknown faces, an orthotropic shank, or a bolt that crosses nothing
    """
    rods_by_name = {}
    for name, table in scene.bolts.items():
        rod = Bolt(name, table.first, table.second)
        stiffness = 0.0
        if table.state == "locked":
            stiffness = table.stiffness or 0.0
            if table.diameter is not None and table.material is not None:
                solid = scene_assembly.make_material(scene.materials[table.material])
                if not isinstance(solid, Material):
                    raise Refusal(f"bolts.{name}: its material is orthotropic; give an isotropic one or stiffness")
                stiffness = solid.E * np.pi * table.diameter**2 / 4 / rod.length(mesh, node_sets)
        rods_by_name[name] = Bolt(name, table.first, table.second, stiffness)
    return rods_by_name


@dataclass(frozen=True)
class BoltsAlone:
    """The model under the loads of its bolts alone, at any frequency omega [rad/s]."""

    reduced: ReducedModel
    joints: list[Joint]
    samples: int
    omega: float

    def elongation(self, loads: Mapping[str, float], bolts: Sequence[str]) -> np.ndarray:
        """Elongations of some bolts where the contact has settled under loads [N] of all of them [m].

        Raises  ValueError where the contact does not settle
        """
        excitation = Excitation({(0, name): complex(force) for name, force in loads.items()}, None)
        basis = HarmonicBasis((0, 1), self.samples)
        balance = HarmonicBalance.of(self.reduced, self.joints, basis, excitation, self.omega)
        solved = newton.solve(balance, self.omega, balance.stuck(self.omega), newton.NewtonOptions(tolerance=1e-12))
        if not solved.converged:
            raise Refusal(f"bolts: tightening does not settle ({solved.outcome}); lower the preload or add friction")
        names = balance.compliance.output_names
        return np.asarray(balance.outputs(solved.state)[[names.index(output(name)) for name in bolts], 0])


def tightened(
    scene: MeshScene,
    rods: Mapping[str, Bolt],
    alone: BoltsAlone,
    reached: float = 1e-10,
    turns: int = 40,
    largest: float = 1e6,
) -> dict[str, float]:
    """P of every bolt [N].

    rods : the bolts with their stiffness; reached : relative error of a preload; turns : at most
    largest : load over preload from which on a bolt clamps nothing
    Raises  ValueError where the contact does not settle or a preload is not reached
    """
    loads = {name: table.preload for name, table in scene.bolts.items()}
    locked = [name for name in loads if rods[name].stiffness > 0]
    if not locked:
        return loads
    k = np.array([rods[name].stiffness for name in locked])
    target = np.array([loads[name] for name in locked])
    slope = np.eye(len(locked))
    before: tuple[np.ndarray, np.ndarray] | None = None
    for _ in range(turns):
        P = np.array([loads[name] for name in locked])
        force = P + k * alone.elongation(loads, locked)
        if np.abs(force - target).max() <= reached * target.max():
            return loads
        if before is not None:  # Broyden's update of d force / d P
            dP, dN = P - before[0], force - before[1]
            slope += np.outer(dN - slope @ dP, dP) / (dP @ dP)
        before = P, force
        P = P + np.linalg.solve(slope, target - force)
        if np.abs(P).max() > largest * target.max():
            break
        loads |= dict(zip(locked, P.tolist(), strict=True))
    raise Refusal(f"bolts: the preload of {', '.join(locked)} is not reached; check what they clamp")
