"""The damping matrix of a scene, and how much of it modes with the contact closed have."""

from dataclasses import replace

import numpy as np

from tribodyn.fem.system import SecondOrderSystem
from tribodyn.reduction.linear import linear_modes, stuck_stiffness
from tribodyn.reduction.linear_damping import modal_damping, rayleigh, rayleigh_of_ratios
from tribodyn.reduction.model import ReducedModel
from tribodyn.workflows.run import joints
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


def check_damping(scene: Scene, reduced: ReducedModel, share: float = 0.9) -> list[str]:
    """A remark on a damping ratio that modes with the contact closed do not have.

    Bodies that the contact alone holds have modes as rigid bodies without it, and these have no damping
    share : of the ratio in the lowest stuck mode, up to which it is remarked"""
    damping, system = scene.damping, reduced.system
    if damping.modal is None or damping.state == "stuck" or not reduced.has_one_system or system.damping is None:
        return []
    count = min(14, system.n_dof)  # two bodies that nothing holds have twelve
    stuck, shapes = linear_modes(reduced, joints.contact_stiffness(scene, reduced), count)
    is_rigid = stuck < 1e-3 * stuck[-1]
    lowest = int(is_rigid.sum())
    free, _ = linear_modes(reduced, None, count)
    shape, ratio = shapes[:, lowest], np.min(damping.modal)
    loss = float((shape.conj() @ system.damping @ shape).real) / (4 * np.pi * stuck[lowest])
    if (free < 1e-3 * stuck[-1]).sum() <= lowest or loss > share * ratio:
        return []
    return [
        f"damping.modal damps the modes without contact, where bodies are loose: with the contact closed the mode at "
        f'{stuck[lowest]:.4g} Hz has {100 * loss:.2g} % instead of {100 * ratio:.2g} %: give damping.state = "stuck"'
    ]
