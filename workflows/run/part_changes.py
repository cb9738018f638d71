"""Parts and models beside each other: their difference, whether they move evenly, and one scaled."""

from dataclasses import replace

import numpy as np

from tribodyn.fem.part import Part
from tribodyn.fem.system import SecondOrderSystem
from tribodyn.reduction.model import ReducedModel


def difference(upper: SecondOrderSystem, lower: SecondOrderSystem, factor: float = 1.0) -> SecondOrderSystem:
    """The difference of two systems times a factor."""
    moves = {
        kind: {name: factor * (v - getattr(lower, kind)[name]) for name, v in getattr(upper, kind).items()}
        for kind in ("loads", "outputs")
    }
    return SecondOrderSystem(
        factor * (upper.mass - lower.mass), factor * (upper.stiffness - lower.stiffness), None, **moves
    )


def moves_evenly(up: Part, base: Part, down: Part) -> bool:
    """Whether two parts to both sides of one have its mesh and its pairs, and all of it moves evenly."""
    if any(part.points.shape != base.points.shape or not np.array_equal(part.free, base.free) for part in (up, down)):
        return False
    names, parts = ("area", "gap", "frames", "B"), (up, base, down)
    shapes = ((part.points, *(getattr(part.interface, name) for name in names)) for part in parts)
    for above, middle, lower in zip(*shapes, strict=True):
        if not above.shape == middle.shape == lower.shape:
            return False
        if abs(above + lower - 2 * middle).max() > 0.1 * abs(above - lower).max() + 1e-12 * abs(middle).max():
            return False
    return True


def scaled(plain: ReducedModel, name: str, factor: float) -> ReducedModel:
    """The model with its stiffness or mass times a factor, as Young's modulus or the density of all of it make it."""
    matrix = {"young": "stiffness", "density": "mass"}[name]
    return plain.with_systems(lambda system, B: replace(system, **{matrix: factor * getattr(system, matrix)}))
