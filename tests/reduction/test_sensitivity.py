"""Reduced matrices follow the full ones as models do that are reduced anew."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.sparse import csr_matrix, diags_array

from tests.helpers.verification_models import interface
from tribodyn.fem.system import SecondOrderSystem
from tribodyn.reduction.craig_bampton import craig_bampton
from tribodyn.reduction.sensitivity import Sensitivity

N, OMEGA, STEP = 40, 0.35, 1e-4


def chain(soft: float, heavy: float) -> SecondOrderSystem:
    """A chain of masses on the ground whose second half is softer and heavier; loads and outputs on slaves too."""
    stiffness = np.where(np.arange(N + 1) < N // 2, 1.0, soft)
    mass = np.where(np.arange(N) < N // 2, 1.0, heavy)
    K = diags_array(
        [stiffness[:-1] + stiffness[1:], -stiffness[1:-1], -stiffness[1:-1]], offsets=[0, 1, -1], shape=(N, N)
    )
    spread = np.linspace(1, 2, N)
    return SecondOrderSystem(
        csr_matrix(diags_array(mass)), csr_matrix(K), None, {"weight": mass * spread}, {"mean": spread / N}
    )


@pytest.mark.parametrize("key", ["soft", "heavy", "both"])
def test_the_reduced_model_follows_as_one_that_is_reduced_anew(key: str) -> None:
    """Compared by what needs no common coordinates: motion of contact and output under contact forces and the load."""
    base = {"soft": 0.7, "heavy": 1.6}
    rows = np.zeros((3, N))
    rows[range(3), [5, 18, 31]] = 1.0
    faces = interface(rows, ("t1", "t2", "n"))
    changed = {name: 1.0 if key in (name, "both") else 0.0 for name in base}

    def system(share: float) -> SecondOrderSystem:
        return chain(**{name: value * (1 + share * changed[name]) for name, value in base.items()})

    def reduced(share: float):
        return craig_bampton(system(share), faces, n_modes=6)

    def motions(model) -> np.ndarray:
        s, B = model.system, np.asarray(model.interface.B)
        pushes = np.column_stack([B.T, s.loads["weight"]])
        shifted = np.linalg.solve(s.stiffness - OMEGA**2 * s.mass, pushes)
        return np.vstack([B, s.outputs["mean"]]) @ shifted

    model = reduced(0.0)
    following = Sensitivity(system(0.0), model, model.origin.basis)
    way = following.towards(_less(system(STEP), system(0.0)))

    def difference(at) -> np.ndarray:
        return (8 * (at(1) - at(-1)) - (at(2) - at(-2))) / 12

    repeated = difference(lambda share: motions(reduced(STEP * share)))
    result = difference(lambda share: motions(following.model_at([(way, share)])))
    assert np.abs(result - repeated).max() < 1e-6 * np.abs(repeated).max()
    fixed = difference(lambda share: motions(_projected(system(STEP * share), model)))
    assert np.abs(fixed - repeated).max() > 1e-3 * np.abs(repeated).max()  # shapes that stay would not do


def _less(minuend: SecondOrderSystem, subtrahend: SecondOrderSystem) -> SecondOrderSystem:
    loads, outputs = (
        {n: v - getattr(subtrahend, k)[n] for n, v in getattr(minuend, k).items()} for k in ("loads", "outputs")
    )
    return SecondOrderSystem(
        minuend.mass - subtrahend.mass, minuend.stiffness - subtrahend.stiffness, None, loads, outputs
    )


def _projected(system: SecondOrderSystem, model):
    T, base = model.origin.basis, model.system
    changed = replace(
        base, mass=T.T @ (system.mass @ T), stiffness=T.T @ (system.stiffness @ T),
        loads={"weight": T.T @ system.loads["weight"]},
    )  # fmt: skip
    return replace(model, system=changed)
