"""Alternating frequency/time: march any contact law to its periodic cycle, with its derivatives."""

from dataclasses import replace
from types import ModuleType

import numba
import numpy as np

from tribodyn.hbm.contact import contact_law, event_cycle
from tribodyn.hbm.contact.compiled_law import pointer
from tribodyn.hbm.contact.contact_law import ContactCycle, ContactParameters
from tribodyn.hbm.contact.event_cycle import CycleNotPeriodic
from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.refusal import Refusal

PERIODIC_DRIFT = 1e-13  # of the memory over a cycle, relative to its largest size in the cycle: some hundred roundings
FIRST_CYCLES = 4  # marched before Newton is tried on the memory, a power of two; most memories repeat after two
NEWTON_CYCLES = 30
MAX_CYCLES = 500
PLOT_SAMPLES = 1024  # that stand for located transitions where a force over time is asked for
POLISH_DRIFT = 1e-6  # relative drift below which Newton only polishes: one step more reaches PERIODIC_DRIFT
LEAST_CONTRACTION = 1e-10  # per cycle, of a memory that does not depend on its start: less is rounding


def cycle(
    law: ModuleType, x: np.ndarray, parameters: ContactParameters, basis: HarmonicBasis,
    memory: np.ndarray | None = None, jacobian: bool = True, omega: float = 0.0,
) -> ContactCycle:  # fmt: skip
    """Periodic contact cycle of all pairs: by a cycle that the law offers, else by its steps.

    x : (n_pair, n_component, n_coeff) relative displacement [m]
    memory : (n_pair, n_state) memory at the start of the load path, zeros if None; omega : for laws with velocities
    Raises  Refusal where the basis has located transitions and the law has samples only, or omega is not known"""
    contact_law.require_order(law, parameters)
    if memory is None:
        memory = np.zeros((parameters.n_pair, law.n_state(parameters.components)))
    if basis.transitions == "located":
        if not contact_law.is_event_based(law):
            name = contact_law.name_of(law)
            raise Refusal(f"contact law '{name}' does not locate its transitions: take transitions = 'sampled'")
        closed_form = getattr(law, "event_based_cycle", None)
        arguments = x, parameters, memory, basis, jacobian
        return event_cycle.cycle(law, *arguments) if closed_form is None else closed_form(*arguments)
    if hasattr(law, "sampled_cycle"):
        return law.sampled_cycle(x, parameters, memory, basis, jacobian)
    moving, timed = with_velocity(law, x, parameters, basis, omega)
    marched = march(law, moving, timed, memory, basis, jacobian)
    if moving is x:
        return marched
    (n_pair, n, n_coeff), slope = x.shape, marched.jacobian
    if slope is not None:  # by x, and by the velocity omega d x / d (omega t)
        slope = slope.reshape(n_pair, 2 * n, n_coeff, 2 * n, n_coeff)[:, :n]
        slope = slope[:, :, :, :n] + omega * slope[:, :, :, n:] @ basis.rate.T
        slope = slope.reshape(n_pair, n * n_coeff, n * n_coeff)
    return ContactCycle(marched.force[:, :n], slope, marched.status)


def with_velocity(
    law: ModuleType, x: np.ndarray, parameters: ContactParameters, basis: HarmonicBasis, omega: float
) -> tuple[np.ndarray, ContactParameters]:
    """Displacements with the velocities behind them, and parameters that end with the time between two samples.

    Both as they are for a law that needs neither"""
    if not contact_law.needs_velocity(law):
        return x, parameters
    if omega == 0.0:
        raise Refusal(f"contact law '{contact_law.name_of(law)}' needs velocities: it has no nonlinear modes")
    times = np.full((parameters.n_pair, 1), 2 * np.pi / (omega * basis.n_samples))
    return np.concatenate([x, omega * x @ basis.rate], axis=1), replace(parameters, tabulation=times)


def march(
    law: ModuleType, x: np.ndarray, parameters: ContactParameters, memory: np.ndarray, basis: HarmonicBasis,
    jacobian: bool = True,
) -> ContactCycle:  # fmt: skip
    """March a contact law to its periodic cycle and transform the force to harmonics.

    x : (n_pair, n_component, n_coeff) relative displacement [m]
    memory : (n_pair, n_state) memory at the start of the first cycle
    Returns the cycle; its Jacobian is exact for the sampled cycle, away from transitions
    Raises  CycleNotPeriodic
    Source  Cameron and Griffin 1989 (AFT); derivatives of the recursion as in Siewert et al. 2010"""
    phi = basis.synthesis if jacobian else basis.synthesis[:, :0]
    force, jac, status = _periodic(law, basis.to_time(x), parameters, memory, phi, basis.analysis)
    return ContactCycle(basis.from_time(force), jac if jacobian else None, status)


def history(
    law: ModuleType, x: np.ndarray, parameters: ContactParameters, basis: HarmonicBasis,
    memory: np.ndarray | None = None, omega: float = 0.0,
) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
    """Periodic displacement and force over one period, for loops and checks.

    For a basis with located transitions the cycle is marched on at least PLOT_SAMPLES samples; every n-th is returned.
    Returns (n_pair, n_component, n_samples) displacement [m] and force [N]"""
    if memory is None:
        memory = np.zeros((parameters.n_pair, law.n_state(parameters.components)))
    stride = 1 if basis.transitions == "sampled" else -(-PLOT_SAMPLES // basis.n_samples)
    fine = HarmonicBasis(basis.harmonics, stride * basis.n_samples)
    moving, parameters = with_velocity(law, x, parameters, fine, omega)
    samples, n = fine.to_time(moving), x.shape[1]
    force = _plain_march(law, samples, parameters.packed(), memory)
    if force is None:
        force = _periodic(law, samples, parameters, memory, fine.synthesis[:, :0], fine.analysis)[0]
    return samples[:, :n, ::stride], force[:, :n, ::stride]


def _plain_march(law: ModuleType, samples: np.ndarray, p: np.ndarray, memory: np.ndarray) -> np.ndarray | None:
    """Force at the samples of the periodic cycle where the memory repeats after a few cycles, None where it does not.

    Without derivatives little is compiled; compiling more would take longer than the march."""
    force, phi = np.zeros(samples.shape), np.zeros((samples.shape[2], 0))
    no_slope, none = np.zeros((0, samples.shape[1], 0)), np.zeros((memory.shape[1], 0))
    for i, s in enumerate(memory.copy()):
        for _ in range(FIRST_CYCLES):
            if turn(pointer(law.step), samples[i], p[i], phi, s, none, no_slope, force[i])[1] <= PERIODIC_DRIFT:
                break
        else:
            return None
    return force


def _periodic(
    law: ModuleType, samples: np.ndarray, parameters: ContactParameters, memory: np.ndarray, phi: np.ndarray,
    weight: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:  # fmt: skip
    """Force at the samples, Jacobian of its coefficients and status of the periodic cycle."""
    n_pair, n_comp, _ = samples.shape
    force, status = np.zeros(samples.shape), np.zeros(n_pair, np.int64)
    jac = np.zeros((n_pair, n_comp * weight.shape[1], n_comp * phi.shape[1]))
    rows, columns = np.ascontiguousarray(weight.T), np.ascontiguousarray(phi)
    lost = _cycles(pointer(law.step), samples, parameters.packed(), memory, columns, rows, force, jac, status)
    if lost >= 0:
        raise CycleNotPeriodic(f"contact pair {lost} has no periodic cycle within {MAX_CYCLES} cycles")
    return force, jac, status


@numba.njit(cache=True)
def _cycles(step, x, p, memory, phi, rows, force, jac, status):
    """The periodic cycle of every pair: force samples, Jacobian of the force coefficients, status bits.

    x, force : (n_pair, n_component, n_time); rows : (n_coeff, n_time) analysis of the basis; memory : at the start
    phi : (n_time, n_coeff) basis functions, no columns where no derivative is wanted
    Returns the first pair whose memory does not repeat, -1 if all do"""
    n_pair, n_comp, n_time = x.shape
    n_state, m = memory.shape[1], n_comp * phi.shape[1]
    no_slope, no_force = np.zeros((0, n_comp, m + n_state)), np.zeros((n_comp, 0))
    for i in range(n_pair):
        s, ds = memory[i].copy(), np.zeros((n_state, m))
        marched = settle(step, x[i], p[i], phi, s, ds) if n_state > 0 else 0
        if marched < 0:
            return i
        start, slopes = s.copy(), unit(n_state, m)
        slope = np.zeros((n_time, n_comp, m + n_state))
        status[i] = turn(step, x[i], p[i], phi, start, slopes, slope, force[i])[0]
        if m == 0:
            continue
        if marched > 0 and undrifted(slopes, slopes, ds) <= LEAST_CONTRACTION:  # its memory depends on its path
            s[:], ds[:] = memory[i], 0.0
            for _ in range(marched):
                turn(step, x[i], p[i], phi, s, ds, no_slope, no_force)
        product = rows @ slope.reshape(n_time, n_comp * (m + n_state))
        for a in range(len(rows)):
            for c in range(n_comp):
                part = product[a, c * (m + n_state) : (c + 1) * (m + n_state)]
                for b in range(m):
                    jac[i, c * len(rows) + a, b] = part[b]
                    for r in range(n_state):
                        jac[i, c * len(rows) + a, b] += part[m + r] * ds[r, b]
    return -1


@numba.njit(cache=True)
def settle(step, x, p, phi, s, ds):
    """Memory s (n_state,) of one pair at the start of its periodic cycle, from that at the start of the load path.

    A Jenkins slider settles in one cycle. Planar friction contracts slowly where it slips little, so after a few
    cycles, and after each doubling of them, Newton's step for the period map, s = P(s), takes over. P never widens a
    distance, so its fixed points are a convex set. One that is isolated is the only one, and one on the rim of the set
    that still contracts is where marching ends too: these are taken. A pair that can just stick has a set shrunk to a
    point: P contracts with the square of the distance, which Newton cuts by a third a step until rounding hides the
    contraction. Otherwise the answer depends on the path, and the pair, which has come to stick, is marched on.

    ds : (n_state, n_component * n_coeff) its derivative, filled where its cycle does not give it
    Returns the cycles marched, 0 where ds is filled, -1 where the memory does not repeat"""
    (n_state, m), n_comp = ds.shape, len(x)
    no_slope, no_force, none = np.zeros((0, n_comp, n_state)), np.zeros((n_comp, 0)), np.zeros((n_state, 0))
    shift, correction = np.zeros((n_state, 1)), np.zeros((n_state, 1))
    for count in range(1, MAX_CYCLES):
        if turn(step, x, p, phi, s, none, no_slope, no_force)[1] <= PERIODIC_DRIFT:
            return count
        if count < FIRST_CYCLES or count & (count - 1):
            continue
        best, least = s.copy(), np.inf
        trial, firm, closing = s.copy(), s.copy(), False  # closing : a step before, at firm, was small and contracted
        for newton in range(NEWTON_CYCLES):
            following, slopes = trial.copy(), unit(n_state, 0)
            drift = turn(step, x, p, phi[:, :0].copy(), following, slopes, no_slope, no_force)[1]
            is_last = newton == NEWTON_CYCLES - 1
            if 2 * newton > NEWTON_CYCLES and drift > least and not is_last:  # to and fro across a kink: half-way back
                trial = 0.5 * (trial + best)
                continue
            best[:], least = trial, drift
            shift[:, 0] = following - trial
            isolated = undrifted(slopes, shift, correction) > LEAST_CONTRACTION
            if drift <= PERIODIC_DRIFT or (closing and (is_last or not isolated) and drift < POLISH_DRIFT):
                if not (isolated or closing):
                    break
                s[:] = trial
                if isolated:
                    return count
                slopes = unit(n_state, m)
                turn(step, x, p, phi, firm, slopes, no_slope, no_force)
                undrifted(slopes, slopes, ds)
                return 0
            if isolated and drift < POLISH_DRIFT:
                closing = True
                firm[:] = trial
            trial += correction[:, 0]
    return -1


@numba.njit(cache=True)
def unit(n, m):
    """(n, m + n) zeros and behind them the unit matrix."""
    out = np.zeros((n, m + n))
    for r in range(n):
        out[r, m + r] = 1.0
    return out


@numba.njit(cache=True)
def undrifted(slopes, shift, out):
    """Fill out with (1 - M)^-1 moved, M the last columns of slopes; its columns are the first of moved.

    Singular values of 1 - M are raised to LEAST_CONTRACTION. Returns the least of them"""
    n = len(slopes)
    matrix = np.eye(n)
    for r in range(n):
        for q in range(n):
            matrix[r, q] -= slopes[r, slopes.shape[1] - n + q]
    columns, size, rows = np.linalg.svd(matrix)
    for b in range(out.shape[1]):
        for r in range(n):
            out[r, b] = 0.0
        for i in range(n):
            share = 0.0
            for r in range(n):
                share += columns[r, i] * shift[r, b]
            for r in range(n):
                out[r, b] += rows[i, r] * share / max(size[i], LEAST_CONTRACTION)
    return size[n - 1]


@numba.njit(cache=True)
def turn(step, x, p, phi, s, ds, slope, force):
    """One cycle of one pair: s and ds to their values after it.

    ds : (n_state, n) its first columns those of the coefficients of x, those beyond carried along; or no columns
    slope : (n_time, n_component, n) derivative of the force, force : (n_component, n_time); filled where they have
        samples
    Returns status bits and how far s is from where it began, over the largest |s| met"""
    n_comp, n_state, n_column = len(x), len(s), ds.shape[1]
    n_coeff = phi.shape[1] if n_column > 0 else 0
    point, f, before = np.zeros(n_comp), np.zeros(n_comp), np.zeros((n_state, n_column))
    dfx, dfs = np.zeros((n_comp, n_comp)), np.zeros((n_comp, n_state))
    dsx, dss = np.zeros((n_state, n_comp)), np.zeros((n_state, n_state))
    begin, bits, size, drift = s.copy(), 0, np.finfo(np.float64).tiny, 0.0
    for j in range(x.shape[1]):
        if n_column > 0:
            dfx[:] = 0.0
            dfs[:] = 0.0
            dsx[:] = 0.0
            dss[:] = 0.0
        for c in range(n_comp):
            point[c] = x[c, j]
        bits |= step(point, s, p, f, dfx, dfs, dsx, dss)
        for r in range(n_state):
            size = max(size, abs(s[r]))
        for c in range(n_comp):
            if force.shape[1] > 0:
                force[c, j] = f[c]
            if len(slope) > 0:
                for d in range(n_comp):
                    if dfx[c, d] != 0.0:
                        for b in range(n_coeff):
                            slope[j, c, d * n_coeff + b] += dfx[c, d] * phi[j, b]
                for r in range(n_state):
                    if dfs[c, r] != 0.0:
                        for b in range(n_column):
                            slope[j, c, b] += dfs[c, r] * ds[r, b]
        if n_column > 0:
            _chain(dsx, dss, phi[j], ds, before)
    for r in range(n_state):
        drift = max(drift, abs(s[r] - begin[r]) / size)
    return bits, drift


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
