"""Prescribed static displacement: the thesis's rearranged equations give the same numbers; reaction and limits."""

from dataclasses import replace

import numpy as np
import pytest

from tests.helpers.held_bodies import N_PAIR, OMEGA, PLATFORM, problem, two_bodies
from tribodyn.hbm import newton
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.contact import contact_law
from tribodyn.reduction.model import ReducedModel
from tribodyn.reduction.prescribed import prescribe


def thesis(model: ReducedModel, balance: HarmonicBalance, height: float, force: float, start: np.ndarray):
    """Unknowns [F_k^0, X_u^0, X^1, ...] of the rearranged equations 5.8, by a dense Newton.

    model : without prescription; start : static X_u and all harmonics >= 1 (n, n_coeff)
    Returns F_k^0 (k,), X (n, n_coeff)"""
    M, C, K = (np.asarray(m) for m in (model.system.mass, model.system.damping, model.system.stiffness))
    B, n, m = model.interface.B, len(K), balance.basis.n_coeff
    k = PLATFORM
    u = np.setdiff1d(np.arange(n), k)
    Dkk, Dku, Duk, Duu = K[np.ix_(k, k)], K[np.ix_(k, u)], K[np.ix_(u, k)], K[np.ix_(u, u)]
    X_k = np.full(len(k), height)
    schur = Duk @ np.linalg.inv(Dkk)
    static = np.block([[np.eye(len(k)), -Dku], [schur, Duu - schur @ Dku]])  # 5.7, upper left
    size = n * m
    A, rhs = np.zeros((size, size)), np.zeros(size)
    A[:n, :n], rhs[: len(k)] = static, Dkk @ X_k
    for i, h in enumerate(balance.basis.dynamic):  # 5.9: real and imaginary parts of D^h
        w = h * OMEGA
        at = n + 2 * n * i
        real, imaginary = K - w**2 * M, w * C
        A[at : at + 2 * n, at : at + 2 * n] = np.block([[real, imaginary], [-imaginary, real]])
    rhs[n : 2 * n] = force * model.system.loads["shaker"]

    def coordinates(unknown):
        X = np.empty((n, m))
        X[k, 0], X[u, 0] = X_k, unknown[len(k) : n]
        X[:, 1:] = unknown[n:].reshape(m - 1, n).T
        return X

    spread = np.zeros((size, 3 * N_PAIR * m))  # B^T of the contact force in the rows of the unknowns, F_nl = 0 at k
    pick = np.zeros((3 * N_PAIR * m, size))
    for c in range(m):
        rows = np.arange(len(k), n) if c == 0 else n * c + np.arange(n)
        used = u if c == 0 else np.arange(n)
        spread[np.ix_(rows, np.arange(3 * N_PAIR) * m + c)] = B[:, used].T
        pick[np.ix_(np.arange(3 * N_PAIR) * m + c, rows)] = B[:, used]
    unknown = np.concatenate([np.zeros(len(k)), start[u, 0], start[:, 1:].T.ravel()])
    for _ in range(40):
        X = coordinates(unknown)
        cycle = balance.contact.cycle((B @ X).reshape(N_PAIR, 3, m), balance.basis, balance.memory)
        residual = A @ unknown - rhs + spread @ cycle.force.ravel()
        if np.linalg.norm(residual) < 1e-9 * np.linalg.norm(rhs):
            break
        size_j = 3 * m
        tangent = np.zeros((N_PAIR * size_j, N_PAIR * size_j))
        for p, block in enumerate(cycle.jacobian):
            tangent[p * size_j : (p + 1) * size_j, p * size_j : (p + 1) * size_j] = block
        unknown = unknown - np.linalg.solve(A + spread @ tangent @ pick, residual)
    else:
        raise AssertionError("the dense Newton of the thesis's equations did not converge")
    return unknown[: len(k)], coordinates(unknown)


def static_shape(model, balance, state):
    """Static coordinates (n,) of a solved state, from the system that harmonic 0 sees."""
    system, B = model.at_harmonic(0)
    height = balance.excitation.loads[0, "height"]
    return np.linalg.solve(system.stiffness, height * system.loads["height"] - B.T @ state.cycle.force[:, :, 0].ravel())


@pytest.mark.parametrize(("height", "force"), [(4e-5, 1.5), (4e-5, 12.0), (1.5e-4, 30.0)])
def test_equals_the_rearranged_equations_of_the_thesis(height, force):
    free = two_bodies()
    model = prescribe(free, PLATFORM, "height")
    balance = problem(model, height, force)
    solution = newton.solve_from_rest(balance, OMEGA, newton.NewtonOptions(tolerance=1e-12))
    assert solution.converged
    state = solution.state
    status = state.cycle.status
    if force > 10:
        assert (status & contact_law.SLIPS).any()
        assert (status & contact_law.SEPARATES).any()

    start = np.zeros((free.system.n_dof, balance.basis.n_coeff))
    start[:, 0] = static_shape(model, balance, state)
    s = 1j * OMEGA * np.asarray(balance.basis.harmonics)
    complex_force = balance.basis.to_complex(state.cycle.force.reshape(9, -1))
    for i, h in enumerate(balance.basis.harmonics[1:], start=1):
        system, B = model.at_harmonic(h)
        D = system.stiffness + s[i] * system.damping + s[i] ** 2 * system.mass
        f = (force * system.loads["shaker"] if h == 1 else 0.0) - B.T @ complex_force[:, i]
        q = np.linalg.solve(D, f)
        start[:, 2 * i - 1], start[:, 2 * i] = q.real, -q.imag
    start[np.setdiff1d(np.arange(24), PLATFORM)] *= 1 + 1e-3  # not the answer itself
    F_k, X = thesis(free, balance, height, force, start)

    x = (free.interface.B @ X).reshape(state.x.shape)
    np.testing.assert_allclose(x, state.x, atol=1e-9 * np.abs(state.x).max())
    np.testing.assert_allclose(model.reaction.force(height, state.cycle.force[:, :, 0]), F_k, rtol=1e-8)
    output = balance.outputs(state)[0]
    np.testing.assert_allclose(X[10], output, atol=1e-9 * np.abs(X[10]).max())


def test_reaction_is_the_preload_when_the_support_acts_about_the_height():
    model = prescribe(two_bodies(), PLATFORM, "height", support=4e5)
    for height, force in ((4e-5, 0.0), (8e-5, 10.0), (1.5e-4, 30.0)):
        balance = problem(model, height, force)
        solution = newton.solve_from_rest(balance, OMEGA)
        assert solution.converged
        fixed = model.reaction.force(height, solution.state.cycle.force[:, :, 0])
        assert balance.preload(solution.state) > 1.0
        assert fixed.sum() == pytest.approx(balance.preload(solution.state), rel=1e-9)


def test_no_interference_means_no_preload_and_lost_contact_the_open_response():
    model = prescribe(two_bodies(), PLATFORM, "height", support=4e5)
    balance = problem(model, 0.0, 0.0, gap=(0.0, 0.0, 0.0))
    solution = newton.solve_from_rest(balance, OMEGA)
    assert solution.converged
    assert balance.preload(solution.state) == pytest.approx(0.0, abs=1e-12)
    assert np.abs(model.reaction.force(0.0, solution.state.cycle.force[:, :, 0])).max() < 1e-9

    open_ = problem(model, 1e-5, 1.0, gap=(1.0, 1.0, 1.0))
    solution = newton.solve_from_rest(open_, OMEGA)
    assert solution.converged
    system = two_bodies().system
    D = system.stiffness + 1j * OMEGA * system.damping - OMEGA**2 * system.mass
    exact = np.linalg.solve(D, system.loads["shaker"].astype(complex))[10]
    result = open_.basis.to_complex(open_.outputs(solution.state)[0])[1]
    assert abs(result - exact) < 1e-8 * abs(exact)


def test_harmonics_above_zero_share_one_system():
    model = prescribe(two_bodies(), PLATFORM, "height")
    assert model.at_harmonic(1)[0] is model.at_harmonic(3)[0]
    assert len(problem(model, 1e-5, 1.0).compliance.groups) == 2


def test_other_static_loads_enter_the_reaction():
    """Against one dense static solve with the contact closed everywhere."""
    free = two_bodies()
    model = prescribe(free, PLATFORM[::-1], "height")
    K, u = free.system.stiffness, np.setdiff1d(np.arange(24), PLATFORM)
    k, B = 3e5, free.interface.B
    closed = K + k * B.T @ B
    q = np.zeros(24)
    q[PLATFORM] = 1e-4
    load = 2.0 * free.system.loads["shaker"]
    q[u] = np.linalg.solve(closed[np.ix_(u, u)], load[u] - closed[np.ix_(u, PLATFORM)] @ q[PLATFORM])
    force = (k * B @ q).reshape(N_PAIR, 3)
    expected = (K @ q)[PLATFORM]
    np.testing.assert_allclose(model.reaction.force(1e-4, force, {"shaker": 2.0}), expected, rtol=1e-9)
    system, _ = model.at_harmonic(0)
    pushed = 1e-4 * system.loads["height"] + 2.0 * system.loads["shaker"]
    static = np.linalg.solve(system.stiffness + k * B.T @ B, pushed)
    np.testing.assert_allclose(static, q, atol=1e-12)


def test_bad_choices_are_refused_in_one_sentence():
    model = two_bodies()
    with pytest.raises(ValueError, match="acts on contact nodes"):
        prescribe(model, np.array([2]), "height")
    with pytest.raises(ValueError, match="name of a load"):
        prescribe(model, PLATFORM, "shaker")
    with pytest.raises(ValueError, match="chooses no coordinate"):
        prescribe(model, np.array([], int), "height")
    with pytest.raises(ValueError, match="outside the 24 DOFs"):
        prescribe(model, np.array([30]), "height")
    loose = replace(model, system=replace(model.system, stiffness=np.diag(np.r_[np.zeros(12), np.ones(12)])))
    with pytest.raises(ValueError, match="can still move rigidly"):
        prescribe(loose, PLATFORM, "height")
