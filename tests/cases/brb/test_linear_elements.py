"""The published frequencies of the beam apart are those of linear elements with reduced integration.

Run with `pytest -m slow tests/cases/brb/test_linear_elements.py`; it prints the table of the beam's page.
"""

from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np
import pytest
from scipy.sparse import identity, kron

import tribodyn as td
from tribodyn.fem import elasticity
from tribodyn.fem.elements import connectivity, coordinates, scatter

HOURGLASS = 0.005  # of the shear modulus
SIGNS = np.array(list(product((-1, 1), repeat=3)), float)
MODES = np.array([SIGNS[:, 1] * SIGNS[:, 2], SIGNS[:, 0] * SIGNS[:, 2], SIGNS[:, 0] * SIGNS[:, 1], SIGNS.prod(axis=1)])


def slopes(at: np.ndarray) -> np.ndarray:
    """(3, 8) derivatives of the trilinear functions at a point of [-1, 1]^3."""
    v = 1 + SIGNS * at
    return np.array([SIGNS[:, i] * v[:, (i + 1) % 3] * v[:, (i + 2) % 3] for i in range(3)]) / 8


def linear_reduced(mesh: Any, material: Any, order: int | None) -> tuple[Any, Any]:
    """Mass, lumped, and stiffness of eight linear elements on the nodes of each 27-node one.

    Source  Flanagan and Belytschko, IJNME 17 (1981) 679: mean gradient, hourglass vectors
    """
    reference = np.asarray(mesh.elem().doflocs).reshape(27, 3)
    corners = [np.array(at) / 2 + (1 + SIGNS) / 4 for at in product((0, 1), repeat=3)]
    own = [[int(np.abs(reference - corner).max(axis=1).argmin()) for corner in eight] for eight in corners]
    cells = np.concatenate([connectivity(mesh)[:, eight] for eight in own])
    x = coordinates(mesh)[cells]
    lam, mu, _ = (values[0] for values in elasticity.per_element(mesh, material))
    rho = elasticity.densities(mesh, material)[0]
    weighted, volume = np.zeros((len(x), 3, 8)), np.zeros(len(x))
    for corner in SIGNS:
        dN = slopes(corner / np.sqrt(3))
        J = dN @ x
        det = np.abs(np.linalg.det(J))
        weighted += det[:, None, None] * np.linalg.solve(J, np.broadcast_to(dN, weighted.shape))
        volume += det
    mean = weighted / volume[:, None, None]
    stiffness = elasticity.stiffness_blocks(mean[:, None], volume[:, None], *(np.full(len(x), m) for m in (lam, mu)))
    shape = (MODES[None] - np.einsum("hI,eIi,eiJ->ehJ", MODES, x, mean)) / 8
    against = 8 * HOURGLASS * mu * volume * (mean**2).sum(axis=(1, 2))
    stiffness += np.einsum("e,ehI,ehJ->eIJ", against, shape, shape)[..., None, None] * np.eye(3)
    mass = np.eye(8)[None, :, :, None, None] * (rho * volume / 8)[:, None, None, None, None]
    n = len(coordinates(mesh))
    return kron(scatter(cells, n, mass), identity(3), format="csr"), scatter(cells, n, elasticity.symmetric(stiffness))


PUBLISHED = np.array([70.323, 151.26, 609.25])  # five elements through the lap, ten across the beam


@pytest.mark.slow
@pytest.mark.parametrize(("through", "across", "within"), [(4, 4, 0.025), (6, 10, 0.02)])
def test_linear_reduced_elements_have_the_published_frequencies(
    through: int, across: int, within: float, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    """Each row is printed: elements, DOFs, frequencies, and how far they are from the published ones."""
    monkeypatch.setattr(elasticity, "_assemble", linear_reduced)
    counts = [f"bodies.{h}.{k}" for h in ("lower", "upper") for k in (f"n_lap={through // 2}", f"n_side={across // 2}")]
    hertz = np.array(td.inspect("brb", modes=10, overrides=counts).record()["frequencies_hz"])
    found = hertz[7:10]
    with capsys.disabled():
        print(f"\n{through} through the lap, {across} across: {found.round(2)} Hz, {100 * (found / PUBLISHED - 1)} %")
    assert max(hertz[:7]) < 0.1
    np.testing.assert_allclose(found, PUBLISHED, rtol=within)
