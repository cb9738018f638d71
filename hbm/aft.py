"""Alternating frequency/time: march any contact law to its periodic cycle, with derivatives carried along."""

from __future__ import annotations

from types import ModuleType

import numba
import numpy as np

from hbm.harmonics import HarmonicBasis
from hbm.law import ContactCycle, ContactParameters

MAX_CYCLES = 32


class CycleNotPeriodic(RuntimeError):
    """The memory of a contact law did not repeat after MAX_CYCLES cycles."""


def march(
    law: ModuleType,
    x: np.ndarray,
    parameters: ContactParameters,
    memory: np.ndarray,
    basis: HarmonicBasis,
    jacobian: bool = True,
) -> ContactCycle:
    """March a contact law to its periodic cycle and transform the force to harmonics.

    x : (n_pair, n_component, n_coeff) relative displacement [m]
    memory : (n_pair, n_state) memory at the start of the first cycle
    Returns the cycle; its Jacobian is exact for the sampled cycle, away from transitions
    Raises  CycleNotPeriodic
    Source  Cameron and Griffin 1989 (AFT); derivatives of the recursion as in Siewert et al. 2010
    """
    n_pair, n_comp, n_coeff = x.shape
    force = np.zeros((n_pair, n_comp, basis.n_samples))
    jac = np.zeros((n_pair, n_comp * n_coeff, n_comp * n_coeff))
    status = np.zeros(n_pair, np.int64)
    late = _march(
        law.step, basis.to_time(x), parameters.packed(), memory, basis.synthesis, basis.analysis, force, jac, status
    )
    if late >= 0:
        raise CycleNotPeriodic(f"contact pair {late} did not settle to a periodic cycle within {MAX_CYCLES} cycles")
    return ContactCycle(basis.from_time(force), jac if jacobian else None, status)


def history(
    law: ModuleType, x: np.ndarray, parameters: ContactParameters, basis: HarmonicBasis, memory: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Periodic displacement and force over one period, for loops and checks.

    Returns (n_pair, n_component, n_samples) displacement [m] and force [N]
    """
    if memory is None:
        memory = np.zeros((parameters.n_pair, law.n_state(parameters.components)))
    n_pair, n_comp, n_coeff = x.shape
    force = np.zeros((n_pair, n_comp, basis.n_samples))
    jac = np.zeros((n_pair, n_comp * n_coeff, n_comp * n_coeff))
    samples = basis.to_time(x)
    status = np.zeros(n_pair, np.int64)
    _march(law.step, samples, parameters.packed(), memory, basis.synthesis, basis.analysis, force, jac, status)
    return samples, force


@numba.njit
def _march(step, x, p, memory, phi, weight, force, jac, status):
    """Return -1, or the first pair whose memory does not repeat. Not cached: `step` lives in another file."""
    n_pair, n_comp, n_time = x.shape
    n_coeff = phi.shape[1]
    n_state = memory.shape[1]
    m = n_comp * n_coeff
    f = np.zeros(n_comp)
    dfx = np.zeros((n_comp, n_comp))
    dfs = np.zeros((n_comp, n_state))
    dsx = np.zeros((n_state, n_comp))
    dss = np.zeros((n_state, n_state))
    for i in range(n_pair):
        s = memory[i].copy()
        ds = np.zeros((n_state, m))  # d s / d X, carried through every cycle
        settled = False
        last = False
        for _ in range(MAX_CYCLES):
            before = s.copy()
            if last:
                jac[i] = 0.0
                status[i] = 0
            for j in range(n_time):
                dfx[:] = 0.0
                dfs[:] = 0.0
                dsx[:] = 0.0
                dss[:] = 0.0
                bits = step(x[i, :, j], s, p[i], f, dfx, dfs, dsx, dss)
                if last:
                    status[i] |= bits
                    for c in range(n_comp):
                        force[i, c, j] = f[c]
                        for d in range(n_comp):
                            if dfx[c, d] != 0.0:
                                for a in range(n_coeff):
                                    wa = weight[j, a] * dfx[c, d]
                                    for b in range(n_coeff):
                                        jac[i, c * n_coeff + a, d * n_coeff + b] += wa * phi[j, b]
                        for r in range(n_state):
                            if dfs[c, r] != 0.0:
                                for a in range(n_coeff):
                                    wa = weight[j, a] * dfs[c, r]
                                    for b in range(m):
                                        jac[i, c * n_coeff + a, b] += wa * ds[r, b]
                ds = dss @ ds
                for r in range(n_state):
                    for d in range(n_comp):
                        if dsx[r, d] != 0.0:
                            for b in range(n_coeff):
                                ds[r, d * n_coeff + b] += dsx[r, d] * phi[j, b]
            if last:
                settled = True
                break
            scale = 0.0
            drift = 0.0
            for r in range(n_state):
                scale = max(scale, abs(s[r]), abs(before[r]))
                drift = max(drift, abs(s[r] - before[r]))
            last = n_state == 0 or drift <= 1e-14 * scale
        if not settled:
            return i
    return -1
