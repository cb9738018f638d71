"""Alternating frequency/time: march any contact law to its periodic cycle, with derivatives carried along."""

from __future__ import annotations

from collections.abc import Callable
from types import ModuleType

import numba
import numpy as np

from tribodyn.hbm.contact import events, law as contact_law
from tribodyn.hbm.contact.compiled_law import pointer
from tribodyn.hbm.contact.events import CycleNotPeriodic
from tribodyn.hbm.contact.law import ContactCycle, ContactParameters
from tribodyn.hbm.harmonics import HarmonicBasis

PERIODIC_DRIFT = 1e-13  # of the memory over a cycle, relative to its largest size in the cycle: some hundred roundings
FIRST_CYCLES = 4  # marched before Newton is tried on the memory; most memories repeat after two
NEWTON_CYCLES = 30
MAX_CYCLES = 500
PLOT_SAMPLES = 1024  # that stand for located transitions where a force over time is asked for
POLISH_DRIFT = 1e-6  # relative drift below which Newton only polishes: one step more reaches PERIODIC_DRIFT
LEAST_CONTRACTION = 1e-10  # per cycle, of a memory that does not depend on its start: less is rounding

Turn = Callable[[np.ndarray, np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]]


def cycle(
    law: ModuleType,
    x: np.ndarray,
    parameters: ContactParameters,
    basis: HarmonicBasis,
    memory: np.ndarray | None = None,
    jacobian: bool = True,
) -> ContactCycle:
    """Periodic contact cycle of all pairs, by the law's own closed form where it has one, else by its steps.

    x : (n_pair, n_component, n_coeff) relative displacement [m]
    memory : (n_pair, n_state) memory at the start of the load path, zeros if None
    Raises  ValueError where the basis asks for located transitions and the law is one of samples alone
    """
    contact_law.require_order(law, parameters)
    if memory is None:
        memory = np.zeros((parameters.n_pair, law.n_state(parameters.components)))
    if basis.transitions == "located":
        if not contact_law.locates(law):
            name = contact_law.called(law)
            raise ValueError(f"contact law '{name}' does not locate its transitions: take transitions = 'sampled'")
        own = getattr(law, "located", None)
        arguments = x, parameters, memory, basis, jacobian
        return events.cycle(law, *arguments) if own is None else own(*arguments)
    if hasattr(law, "cycle"):
        return law.cycle(x, parameters, memory, basis, jacobian)
    return march(law, x, parameters, memory, basis, jacobian)


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
    phi = basis.synthesis if jacobian else basis.synthesis[:, :0]
    force, jac, status = _periodic(law, basis.to_time(x), parameters, memory, phi, basis.analysis)
    return ContactCycle(basis.from_time(force), jac if jacobian else None, status)


def by_kernel(
    kernel: Callable[..., None],
    x: np.ndarray,
    parameters: ContactParameters,
    memory: np.ndarray,
    basis: HarmonicBasis,
    jacobian: bool,
) -> ContactCycle:
    """The cycle of a law that knows its Jacobian in closed form between transitions.

    kernel : compiled, called with samples, packed parameters, memory, synthesis and both prefix sums of the basis; it
        fills force (n_pair, n_component, n_samples), Jacobian (no pairs where it is not wanted) and status
    Other arguments as for `march`
    """
    n_pair, n_comp, n_coeff = x.shape
    samples = basis.to_time(x)
    force, status = np.empty_like(samples), np.zeros(n_pair, np.int64)
    jac = np.zeros((n_pair if jacobian else 0, n_comp * n_coeff, n_comp * n_coeff))
    kernel(samples, parameters.packed(), memory, basis.synthesis, *basis.prefix_sums, force, jac, status)
    return ContactCycle(basis.from_time(force), jac if jacobian else None, status)


def history(
    law: ModuleType,
    x: np.ndarray,
    parameters: ContactParameters,
    basis: HarmonicBasis,
    memory: np.ndarray | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Periodic displacement and force over one period, for loops and checks.

    Where the basis locates transitions the cycle is marched on at least PLOT_SAMPLES samples, of which every n-th is
    given.
    Returns (n_pair, n_component, n_samples) displacement [m] and force [N]
    """
    if memory is None:
        memory = np.zeros((parameters.n_pair, law.n_state(parameters.components)))
    if hasattr(law, "history"):
        return law.history(x, parameters, memory, basis)
    every = 1 if basis.transitions == "sampled" else -(-PLOT_SAMPLES // basis.n_samples)
    fine = HarmonicBasis(basis.harmonics, every * basis.n_samples)
    samples = fine.to_time(x)
    force = _plain_march(law, samples, parameters.packed(), memory)
    if force is None:
        force = _periodic(law, samples, parameters, memory, fine.synthesis[:, :0], fine.analysis)[0]
    return samples[..., ::every], force[..., ::every]


def _plain_march(law: ModuleType, samples: np.ndarray, p: np.ndarray, memory: np.ndarray) -> np.ndarray | None:
    """Force at the samples of the periodic cycle where the memory repeats after a few cycles, None where it does not.

    Without derivatives there is little to compile, which would take longer than all the marching.
    """
    s, force = memory.copy(), np.zeros(samples.shape)
    for _ in range(FIRST_CYCLES):
        before, size = s.copy(), np.full(len(s), np.finfo(float).tiny)
        _follow(pointer(law.step), samples, p, s, size, force)
        if np.all(np.abs(s - before) <= PERIODIC_DRIFT * size[:, None]):
            return force
    return None


def _periodic(
    law: ModuleType,
    samples: np.ndarray,
    parameters: ContactParameters,
    memory: np.ndarray,
    phi: np.ndarray,
    weight: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Force at the samples, Jacobian of its coefficients and status of the periodic cycle."""
    p = parameters.packed()
    n_pair, n_comp, _ = samples.shape
    s, ds = settle(law, samples, p, memory, phi)
    force = np.zeros(samples.shape)
    jac = np.zeros((n_pair, n_comp * weight.shape[1], n_comp * phi.shape[1]))
    status = np.zeros(n_pair, np.int64)
    rows, columns = np.ascontiguousarray(weight.T), np.ascontiguousarray(phi)
    _record(pointer(law.step), samples, p, columns, rows, s, ds, force, jac, status)
    return force, jac, status


def settle(
    law: ModuleType, samples: np.ndarray, p: np.ndarray, memory: np.ndarray, phi: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Memory at the start of the periodic cycle, and its derivative.

    A Jenkins slider settles in one cycle. Planar friction contracts slowly where it slips little, so after a few cycles
    Newton's step for the period map, s = P(s), takes over. P never widens a distance, so its fixed points are a convex
    set. One that is isolated is the only one, and one on the rim of the set that still contracts is where marching ends
    too: these are taken. A pair that can just stick has a set shrunk to a point: P contracts with the square of the
    distance, which Newton cuts by a third a step until rounding hides the contraction. Otherwise the answer depends on
    the path, and the pair, which has come to stick, is marched on.

    samples : (n_pair, n_component, n_samples) displacement [m]; p : packed parameters; memory : (n_pair, n_state)
    phi : (n_samples, n_coeff) basis functions, no columns where no derivative is wanted
    Returns (n_pair, n_state), (n_pair, n_state, n_component * n_coeff)
    Raises  CycleNotPeriodic
    """
    phi = np.ascontiguousarray(phi)
    s = memory.copy()
    ds = np.zeros((*s.shape, samples.shape[1] * phi.shape[1]))
    if s.shape[1] == 0:
        return s, ds

    def turn(i: np.ndarray, s: np.ndarray, ds: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """One cycle of the pairs i: memory after it, its two derivatives, and the relative drift."""
        eye = np.broadcast_to(np.eye(s.shape[1]), (len(i), s.shape[1], s.shape[1]))
        after, slopes, size = s.copy(), np.concatenate([ds, eye], axis=2), np.full(len(i), np.finfo(float).tiny)
        _advance(pointer(law.step), samples[i], p[i], phi, after, slopes, size)
        return after, slopes[..., : ds.shape[2]], slopes[..., ds.shape[2] :], np.abs(after - s).max(axis=1) / size

    open_pairs = _repeat(turn, np.arange(len(s)), s, ds, FIRST_CYCLES)
    open_pairs = _newton(turn, open_pairs, s, ds)
    open_pairs = _repeat(turn, open_pairs, s, ds, MAX_CYCLES)
    if len(open_pairs) > 0:
        raise CycleNotPeriodic(
            f"contact pair {open_pairs[0]} did not settle to a periodic cycle within {MAX_CYCLES} cycles"
        )
    return s, ds


def _repeat(turn: Turn, i: np.ndarray, s: np.ndarray, ds: np.ndarray, n_cycles: int) -> np.ndarray:
    """March the pairs i until they are periodic; s and ds are changed in place. Returns the pairs that are not."""
    for _ in range(n_cycles):
        if len(i) == 0:
            break
        s[i], ds[i], _, drift = turn(i, s[i], ds[i])
        i = i[drift > PERIODIC_DRIFT]
    return i


def _newton(turn: Turn, i: np.ndarray, s: np.ndarray, ds: np.ndarray) -> np.ndarray:
    """Solve s = P(s) for the pairs i, and ds = P' ds + dP/dX; s and ds change where marching would end there too.

    Returns the pairs where it would not, or where Newton does not converge
    """
    rejected = []
    trial, trial_ds = s[i], ds[i]
    closing = np.zeros(len(i), bool)  # a step before was small and its cycle contracted
    for _ in range(NEWTON_CYCLES):
        if len(i) == 0:
            break
        after, after_ds, slope, drift = turn(i, trial, trial_ds)
        left, size, right = np.linalg.svd(np.eye(s.shape[1]) - slope)
        inverse = right.transpose(0, 2, 1) @ (left.transpose(0, 2, 1) / np.maximum(size, LEAST_CONTRACTION)[..., None])
        trial_ds = trial_ds + inverse @ (after_ds - trial_ds)
        isolated = size[:, -1] > LEAST_CONTRACTION
        done = (drift <= PERIODIC_DRIFT) | (closing & ~isolated & (drift < POLISH_DRIFT))
        good = done & (isolated | closing)
        s[i[good]], ds[i[good]] = trial[good], trial_ds[good]
        rejected.append(i[done & ~good])
        closing |= isolated & (drift < POLISH_DRIFT)
        trial = trial + (inverse @ (after - trial)[..., None])[..., 0]
        i, trial, trial_ds, closing = i[~done], trial[~done], trial_ds[~done], closing[~done]
    return np.concatenate([i, *rejected])


@numba.njit(cache=True)
def _follow(step, x, p, s, size, force):
    """One cycle of every pair: force at its samples, s to its value after it, `size` the largest |s| met."""
    n_pair, n_comp, n_time = x.shape
    n_state = s.shape[1]
    point, f = np.zeros(n_comp), np.zeros(n_comp)
    dfx, dfs = np.zeros((n_comp, n_comp)), np.zeros((n_comp, n_state))
    dsx, dss = np.zeros((n_state, n_comp)), np.zeros((n_state, n_state))
    for i in range(n_pair):
        for j in range(n_time):
            for c in range(n_comp):
                point[c] = x[i, c, j]
            step(point, s[i], p[i], f, dfx, dfs, dsx, dss)
            for c in range(n_comp):
                force[i, c, j] = f[c]
            for r in range(n_state):
                size[i] = max(size[i], abs(s[i, r]))


@numba.njit(cache=True)
def _advance(step, x, p, phi, s, ds, size):
    """One cycle of every pair: s and ds to their values after it, `size` the largest |s| met."""
    n_pair, n_comp, n_time = x.shape
    n_state = s.shape[1]
    point, f = np.zeros(n_comp), np.zeros(n_comp)
    dfx, dfs = np.zeros((n_comp, n_comp)), np.zeros((n_comp, n_state))
    dsx, dss = np.zeros((n_state, n_comp)), np.zeros((n_state, n_state))
    before = np.zeros((n_state, ds.shape[2]))
    for i in range(n_pair):
        for j in range(n_time):
            dsx[:] = 0.0
            dss[:] = 0.0
            for c in range(n_comp):
                point[c] = x[i, c, j]
            step(point, s[i], p[i], f, dfx, dfs, dsx, dss)
            for r in range(n_state):
                size[i] = max(size[i], abs(s[i, r]))
            _chain(dsx, dss, phi[j], ds[i], before)


@numba.njit(cache=True)
def _record(step, x, p, phi, weight, s, ds, force, jac, status):
    """The periodic cycle from memory s and its derivative ds: force samples, Jacobian, status bits."""
    n_pair, n_comp, n_time = x.shape
    n_coeff = phi.shape[1]
    n_state = s.shape[1]
    m = n_comp * n_coeff
    point, f = np.zeros(n_comp), np.zeros(n_comp)
    dfx, dfs = np.zeros((n_comp, n_comp)), np.zeros((n_comp, n_state))
    dsx, dss = np.zeros((n_state, n_comp)), np.zeros((n_state, n_state))
    before = np.zeros((n_state, m))
    slope = np.zeros((n_time, n_comp * m))  # d f / d X at each sample
    for i in range(n_pair):
        memory = s[i].copy()
        memory_ds = ds[i].copy()
        slope[:] = 0.0
        for j in range(n_time):
            dfx[:] = 0.0
            dfs[:] = 0.0
            dsx[:] = 0.0
            dss[:] = 0.0
            for c in range(n_comp):
                point[c] = x[i, c, j]
            status[i] |= step(point, memory, p[i], f, dfx, dfs, dsx, dss)
            for c in range(n_comp):
                force[i, c, j] = f[c]
                for d in range(n_comp):
                    if dfx[c, d] != 0.0:
                        for b in range(n_coeff):
                            slope[j, c * m + d * n_coeff + b] += dfx[c, d] * phi[j, b]
                for r in range(n_state):
                    if dfs[c, r] != 0.0:
                        for b in range(m):
                            slope[j, c * m + b] += dfs[c, r] * memory_ds[r, b]
            _chain(dsx, dss, phi[j], memory_ds, before)
        if m > 0:
            product = weight @ slope
            n = len(weight)  # element by element: an assignment of slices takes numba seconds to compile
            for c in range(n_comp):
                for a in range(n):
                    for b in range(m):
                        jac[i, c * n + a, b] = product[a, c * m + b]


@numba.njit(cache=True)
def _chain(dsx, dss, phi, ds, before):
    """ds <- dss ds + dsx phi, over the columns of ds; those beyond the coefficients carry dss alone."""
    n_state, n_comp = dsx.shape
    n_coeff = phi.size
    for r in range(n_state):
        for b in range(ds.shape[1]):
            before[r, b], ds[r, b] = ds[r, b], 0.0
    for r in range(n_state):
        for q in range(n_state):
            if dss[r, q] != 0.0:
                for b in range(ds.shape[1]):
                    ds[r, b] += dss[r, q] * before[q, b]
        for d in range(n_comp):
            if dsx[r, d] != 0.0:
                for b in range(n_coeff):
                    ds[r, d * n_coeff + b] += dsx[r, d] * phi[b]
