"""Static loads of structures that nothing holds: whether they are in equilibrium."""

from __future__ import annotations

import numpy as np

from tribodyn.fem.assembly import Assembly
from tribodyn.fem.part import Part


def unbalanced_load(force: np.ndarray, part: Part, motions: np.ndarray) -> str:
    """A sentence on static loads that push rigid motions of a structure, with their resultant.

    force : (n_free,) of all static loads [N]; motions : (n_free, r) the rigid motions that it pushes
    """
    moved = np.linalg.norm(part.field(motions), axis=(1, 2))
    moves = moved > 1e-6 * moved.max()
    names = [""]
    if isinstance(part.mesh, Assembly):
        names = [body.name for body in part.mesh.bodies if body.name and moves[part.node_sets[body.name]].any()]
    centre = part.points[moves].mean(axis=0)
    arm = part.points - centre
    shifts = np.broadcast_to(np.eye(3)[:, None, :], (3, len(arm), 3))
    turns = np.stack([np.cross(axis, arm) for axis in np.eye(3)])
    full = np.concatenate([shifts, turns]) * moves[:, None]
    for node, turn in part.mesh.points.values() if isinstance(part.mesh, Assembly) else ():
        full[:3, turn], full[3:, turn] = 0.0, np.eye(3) * moves[node]
    resultant = full.reshape(6, -1)[:, part.free] @ force
    size, reach = float(np.abs(force).sum()), float(np.abs(arm).max())
    where = _vector(1e3 * centre, 1e-6 * reach)
    it, what = "them" if len(names) > 1 else "it", " and ".join(filter(None, names)) or "the structure"
    return (
        f"nothing holds {what}, and the static loads on {it} are not in equilibrium: their resultant is "
        f"{_vector(resultant[:3], 1e-9 * size)} N with {_vector(resultant[3:], 1e-9 * size * reach)} N m about "
        f"{where} mm: balance them, clamp {it} or add a spring"
    )


def _vector(values: np.ndarray, least: float) -> str:
    """A vector in words; what is not above `least` is rounding."""
    return f"({', '.join(f'{v if abs(v) > least else 0.0:.4g}' for v in values)})"
