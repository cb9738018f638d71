"""The rough law beside boundary elements on a half space (tamaas): one sphere, and a random face from its height map.

The law's asperities neither merge nor sink with their neighbours, and all have one radius; the boundary elements have
none of these limits. The approach is that of the mean plane of the deformed face in both."""

import numpy as np
import pytest

from tests.helpers.rough_faces import gaussian
from tribodyn.geometry.asperities import identify
from tribodyn.hbm.contact import contact_law
from tribodyn.hbm.contact.bed_table import bed_springs
from tribodyn.hbm.contact.contact_law import ContactParameters

tm = pytest.importorskip("tamaas", reason="tamaas has no wheel for this platform: pip install tamaas")

YOUNG, POISSON = 192.31e9, 0.3
E_STAR = YOUNG / (2 * (1 - POISSON**2))


def half_space(side: float, n: int):
    """Half space of E* under a square (n, n) grid."""
    tm.set_log_level(tm.LogLevel.error)
    model = tm.ModelFactory.createModel(tm.model_type.basic_2d, [side, side], [n, n])
    model.E, model.nu = E_STAR, 0.0
    return model


def law_pressure(table: np.ndarray, radius: float, approach: np.ndarray) -> np.ndarray:
    """Pressure [Pa] of the law per pair at approaches (n,), each the deepest so far."""
    built = ContactParameters.of(
        ("t1", "t2", "n"), np.ones((1, 3)), table=table, friction=0.3, young=YOUNG, poisson=POISSON, radius=radius,
        deepest=float(max(approach.max(), table[:, 0].max())),
    )  # fmt: skip
    p = contact_law.complete("rough", built).packed().repeat(len(approach), axis=0)
    k, g, _, _ = bed_springs(p, approach)
    return (k * np.maximum(approach[:, None] - g, 0.0)).sum(axis=1)


@pytest.mark.parametrize("approach", [1e-7, 1e-6])
def test_one_sphere_carries_what_boundary_elements_find(approach):
    radius, n = 1.36493e-3, 64
    force = law_pressure(np.array([[0.0, 1.0]]), radius, np.array([approach]))[0]  # one asperity per m2, on 1 m2
    side = 3 * np.sqrt(radius * approach)
    model = half_space(side, n)
    tm.ModelFactory.registerNonPeriodic(model, "open")
    at = ((np.arange(n) + 0.5) / n - 0.5) * side
    sphere = -(at[:, None] ** 2 + at**2) / (2 * radius)
    solver = tm.PolonskyKeerRey(model, sphere, 1e-10)
    solver.setIntegralOperator("open")
    solver.solve(force / side**2)
    pressed = np.array(model.traction)
    sunk = np.zeros_like(pressed)
    model.operators["open"](pressed, sunk)
    touching = pressed > 0.05 * pressed.max()
    result = (sunk - sphere)[touching]
    assert np.ptp(result) < 1e-6 * approach
    assert result.mean() == pytest.approx(approach, rel=2e-4)
    assert pressed.max() == pytest.approx(1.5 * force / (np.pi * radius * approach), rel=2e-3)


def test_a_random_face_carries_what_boundary_elements_find_while_its_asperities_stay_apart():
    """Pressure against approach from 0.05 to 3 % of the area in touch; the law is too stiff first, then too soft."""
    n, step = 256, 1e-6
    face, _ = gaussian(n, step, 32e-6, 16e-6, 0.3e-6, 1)
    fit = identify(face)
    slope = np.sqrt(sum(np.mean((np.diff(face.z, axis=axis) / step) ** 2) for axis in (0, 1)))
    expected = E_STAR * slope * np.array([1e-4, 1e-3, 1e-2])
    z = np.ascontiguousarray(face.z - face.z.mean())
    approach, share = [], []
    for pressure in expected:
        model = half_space(n * step, n)
        tm.PolonskyKeerRey(model, z, 1e-7).solve(pressure)
        approach.append(fit.height.max() - np.array(model["gap"]).mean())
        share.append((np.array(model.traction) > 0).mean())
    law = law_pressure(fit.table(), fit.radius, np.array(approach))
    assert 2e-4 < share[0] < share[-1] < 0.03
    np.testing.assert_allclose(law / expected, [1.14, 1.17, 0.92], atol=0.02)
