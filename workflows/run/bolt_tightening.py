"""Bolts of a scene: what their shanks are, and how far they are turned so that each reaches its preload.

A locked bolt has the force N = P + k e. P is what its turning adds to the elongation of the clamped parts: it is found
so that N is the preload where the bolts act alone and the contact has settled."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tribodyn.fem.bolts import Bolt
from tribodyn.fem.load_vectors import Heating, Load, Sum
from tribodyn.fem.material import Material
from tribodyn.fem.mortar import MORTAR
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

    Raises  ValueError for unknown faces, an orthotropic shank, or a bolt that crosses nothing"""
    rods_by_name = {}
    for name, table in scene.bolts.items():
        rod = Bolt(name, table.first, table.second, axis=table.axis)
        if table.state == "locked":
            solid = None if table.material is None else scene_assembly.make_material(scene.materials[table.material])
            if solid is not None and not isinstance(solid, Material):
                raise Refusal(f"bolts.{name}: its material is orthotropic; give an isotropic one or stiffness")
            stiffness = table.stiffness or 0.0
            if table.diameter is not None and solid is not None:
                stiffness = solid.E * np.pi * table.diameter**2 / 4 / rod.length(mesh, node_sets)
            rod = replace(rod, stiffness=stiffness, expansion=None if solid is None else solid.expansion)
        rods_by_name[name] = rod
    return rods_by_name


def heated(load: Load, shanks: Mapping[str, Bolt], mesh: Any, node_sets: Mapping[str, np.ndarray]) -> Load:
    """A load, with what it does to the shanks of bolts where it heats."""
    if not isinstance(load, Heating):
        return load
    temperature = load.temperature(mesh)
    forces = [(shank, shank.thermal_force(mesh, node_sets, temperature)) for shank in shanks.values()]
    return Sum(((load, 1.0), *forces))


def leaning(scene: MeshScene, shanks: Mapping[str, Bolt], mesh: Any, node_sets: Mapping[str, np.ndarray]) -> list[str]:
    """A sentence on each bolt whose shank stands askew on its faces, with the shear that it puts into the joint."""
    angles = {name: shank.lean(mesh, node_sets) for name, shank in shanks.items()}
    return [
        f"bolts.{name} leans by {np.degrees(angle):.3g} degrees against the faces that it presses on, so that it "
        f"shears the joint by {np.sin(angle) * scene.bolts[name].preload:.3g} N, and friction below "
        f"{np.tan(angle):.3g} slides: give bolts.{name}.axis, or faces that lie opposite each other"
        for name, angle in angles.items()
        if angle > MORTAR.separated
    ]


@dataclass(frozen=True)
class BoltsAlone:
    """The model under the loads of its bolts alone, at any frequency omega [rad/s]."""

    reduced: ReducedModel
    joints: list[Joint]
    samples: int
    omega: float

    def balance(self, loads: Mapping[str, float], previous: HarmonicBalance | None = None) -> HarmonicBalance:
        """The balance under loads [N] of all bolts, which shares its linear side with a previous one."""
        excitation = Excitation({(0, name): complex(force) for name, force in loads.items()}, None)
        basis = HarmonicBasis((0, 1), self.samples)
        return HarmonicBalance.of(self.reduced, self.joints, basis, excitation, self.omega, previous=previous)

    def elongation(self, balance: HarmonicBalance, bolts: Sequence[str]) -> np.ndarray:
        """Elongations of some bolts where the contact has settled [m].

        Raises  ValueError where the contact does not settle"""
        solved = newton.solve(balance, self.omega, balance.stuck(self.omega), newton.NewtonOptions(tolerance=1e-12))
        if not solved.converged:
            raise Refusal(f"bolts: tightening does not settle ({solved.outcome}); lower the preload or add friction")
        names = balance.compliance.output_names
        return np.asarray(balance.outputs(solved.state)[[names.index(output(name)) for name in bolts], 0])


def tightened(
    scene: MeshScene, rods: Mapping[str, Bolt], alone: BoltsAlone, remarks: Sequence[str] = (),
    reached: float = 1e-10, turns: int = 40, largest: float = 1e6,
) -> dict[str, float]:  # fmt: skip
    """P of every bolt [N].

    rods : the bolts with their stiffness; remarks : on them, see `leaning`
    reached : relative error of a preload; turns : at most
    largest : load over preload from which on a bolt clamps nothing
    Raises  ValueError where the contact does not settle or a preload is not reached"""
    loads = {name: table.preload for name, table in scene.bolts.items()}
    locked = [name for name in loads if rods[name].stiffness > 0]
    if not locked:
        return loads
    k = np.array([rods[name].stiffness for name in locked])
    target = np.array([loads[name] for name in locked])
    slope = np.eye(len(locked))
    before: tuple[np.ndarray, np.ndarray] | None = None
    balance: HarmonicBalance | None = None
    for _ in range(turns):
        P = np.array([loads[name] for name in locked])
        balance = alone.balance(loads, balance)
        force = P + k * alone.elongation(balance, locked)
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
    cause = "; ".join(remarks) or "check what they clamp"
    raise Refusal(f"bolts: the preload of {', '.join(locked)} is not reached; {cause}")
