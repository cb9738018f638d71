"""The damping matrix of a scene."""

from dataclasses import replace

import numpy as np

from tribodyn.fem.system import SecondOrderSystem
from tribodyn.reduction.linear import stuck_stiffness
from tribodyn.reduction.linear_damping import modal_damping, rayleigh, rayleigh_of_ratios
from tribodyn.workflows.scene.schema import Scene


def damping_matrix(scene: Scene, springs: np.ndarray, system: SecondOrderSystem, B: np.ndarray) -> np.ndarray | None:
    """Damping matrix (n, n) [N s/m] of a system with its contact map and springs, None where the scene has none."""
    damping = scene.damping
    if damping.state == "stuck":
        system = replace(system, stiffness=stuck_stiffness(system.stiffness, B, springs))
    if damping.modal is not None:
        return modal_damping(system, damping.modal)
    if damping.ratios is not None and damping.modes is not None:
        return rayleigh(system, *rayleigh_of_ratios(system, damping.modes, damping.ratios))
    if damping.mass is not None or damping.stiffness is not None:
        return rayleigh(system, damping.mass or 0.0, damping.stiffness or 0.0)
    return None
