"""Event-based cycle of any contact law: its transitions are found from its `step`.

A law is called twice at an angle: its step to this angle, and a second step to a point further along the motion. A jump
of the status or of the slopes (dfx, dfs, dsx, dss) of the second step is a transition: stick and slip, also where a
slider turns, lift and contact, another branch of a force. It is bracketed by bisection, and the period becomes segments
on which the law is smooth, each integrated by Gauss's rule. A rate-independent law that is smooth between transitions
is so integrated to rounding, whatever the number of time samples; a law that is itself a step of integration, as planar
friction while its path turns, is not. A stick between two slips of equal slopes that is
shorter than the distance of two nodes, some 0.1 rad of the highest harmonic, is not seen.

Forces are continuous at transitions, so an instant that moves adds nothing to the Jacobian but where a slider that
followed the motion of an open pair is caught: there the instant is the root of the normal force.
Source  our own; the derivative at a transition as in Leine and Nijmeijer 2004, chapter 7 (saltation)"""

import math
from types import ModuleType

import numba
import numpy as np

from tribodyn.hbm.contact.compiled_law import pointer
from tribodyn.hbm.contact.contact_law import SEPARATES, ContactCycle, ContactParameters
from tribodyn.hbm.contact.segment_integrals import POINTS, WEIGHTS
from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.refusal import SolverFailure


class CycleNotPeriodic(SolverFailure):
    """The memory of a contact law did not repeat after all cycles allowed."""


def cycle(
    law: ModuleType, x: np.ndarray, parameters: ContactParameters, memory: np.ndarray, basis: HarmonicBasis,
    jacobian: bool = True,
) -> ContactCycle:  # fmt: skip
    """The periodic cycle of all pairs; arguments as `hbm.contact.aft.march`. Raises CycleNotPeriodic."""
    (n_pair, n_comp, n_coeff), n_state = x.shape, memory.shape[1]
    hs, skip = np.asarray(basis.dynamic, np.int64), 0 if basis.has_static else 1
    normal = n_comp - 1 if parameters.components[-1] == "n" else -1
    width = n_comp * n_coeff if jacobian else 0
    force, status = np.zeros(x.shape), np.zeros(n_pair, np.int64)
    jac = np.zeros((n_pair, width, width))
    nodes = np.empty((56 * hs[-1] + 8 * _most_transitions(hs[-1]) + 8, 2))
    step, packed = pointer(law.step), parameters.packed()
    none = np.zeros((0, 0))
    for i in range(n_pair):
        pair_x, p = np.ascontiguousarray(x[i]), np.ascontiguousarray(packed[i])
        s, ds = memory[i].copy(), np.zeros((n_state, width))
        for turn in range(40):
            after, slopes = s.copy(), np.concatenate([ds, np.eye(n_state)], axis=1)
            n = _locate(step, pair_x, p, hs, skip, POINTS, WEIGHTS, after, nodes)
            if n_state and (jacobian or turn >= 4):
                _march(step, pair_x, p, hs, skip, nodes[:n], s.copy(), slopes, normal, none, none)
            newton = np.linalg.pinv(np.eye(n_state) - slopes[:, width:], rcond=1e-10)
            drift, size = np.abs(after - s).max(initial=0.0), max(np.abs(after).max(initial=0.0), 1e-300)
            is_periodic = drift <= 1e-10 * size
            newton = newton if is_periodic or turn >= 4 else np.eye(n_state)  # on a period map that contracts slowly
            ds = ds + newton @ (slopes[:, :width] - ds)
            if is_periodic:
                break
            s = s + newton @ (after - s)
        else:
            raise CycleNotPeriodic(f"contact pair {i} has no periodic cycle")
        ds = np.ascontiguousarray(ds)
        status[i] = _march(step, pair_x, p, hs, skip, nodes[:n], s, ds, normal, force[i], jac[i])
    return ContactCycle(force, jac if jacobian else None, status)


@numba.njit(cache=True)
def _most_transitions(top):
    """The most transitions that are located in a cycle; further ones are integrated over."""
    return 16 * top + 64


@numba.njit(cache=True)
def _functions(hs, skip, angle, phi, rate):
    """The basis functions and their derivatives at an angle."""
    if skip == 0:
        phi[0], rate[0] = 1.0, 0.0
    for q in range(hs.size):
        a, h = 1 - skip + 2 * q, float(hs[q])
        phi[a], phi[a + 1] = math.cos(h * angle), math.sin(h * angle)
        rate[a], rate[a + 1] = -h * phi[a + 1], h * phi[a]


@numba.njit(cache=True)
def _call_step(step, point, s, p, f, answer):
    """One step of the law; answer : dfx, dfs, dsx, dss one after the other, and the status."""
    n, k = point.size, s.size
    answer[:] = 0.0
    a, b, c = n * n, n * n + n * k, n * n + 2 * n * k
    dfx, dfs = answer[:a].reshape((n, n)), answer[a:b].reshape((n, k))
    dsx, dss = answer[b:c].reshape((k, n)), answer[c : c + k * k].reshape((k, k))
    answer[-1] = step(point, s, p, f, dfx, dfs, dsx, dss)


@numba.njit(cache=True)
def _step_to(step, x, p, hs, skip, angle, s, answer, ahead):
    """Step to an angle, s with it; answer : of the law there or, with ahead > 0 [rad], further along the tangent."""
    n_comp, n_coeff = x.shape
    work = np.zeros(2 * n_coeff + 3 * n_comp)
    phi, rate, point = work[:n_coeff], work[n_coeff : 2 * n_coeff], work[2 * n_coeff : 2 * n_coeff + n_comp]
    further, f = work[2 * n_coeff + n_comp : 2 * n_coeff + 2 * n_comp], work[2 * n_coeff + 2 * n_comp :]
    _functions(hs, skip, angle, phi, rate)
    for c in range(n_comp):
        for a in range(n_coeff):
            point[c] += x[c, a] * phi[a]
            further[c] += x[c, a] * (phi[a] + ahead * rate[a])
    _call_step(step, point, s, p, f, answer)
    if ahead > 0.0:
        _call_step(step, further, s.copy(), p, f, answer)


@numba.njit(cache=True)
def _jump(first, second, n_comp, n_state):
    """Difference of two answers of a law: 1 for another status, else the largest change over the largest slope."""
    if first[-1] != second[-1]:
        return 1.0
    edge, worst = n_comp * (n_comp + n_state), 0.0
    for low, high in ((0, edge), (edge, first.size - 1)):
        change, size = 0.0, 0.0
        for k in range(low, high):
            change = max(change, abs(first[k] - second[k]))
            size = max(size, abs(first[k]), abs(second[k]))
        if change > 0.0:
            worst = max(worst, change / size)
    return worst


@numba.njit(cache=True)
def _bisect(step, x, p, hs, skip, low, high, s, low_answer, high_answer, ahead):
    """Bisect for the transition between low and high; their answers change with them.

    Returns low and high; high is -1 where the law changes smoothly"""
    n_comp, n_state = x.shape[0], s.size
    size = _jump(low_answer, high_answer, n_comp, n_state)
    first, answer = low_answer.copy(), low_answer.copy()
    for k in range(60):
        if high - low <= (1e-7 if ahead else 1e-13):
            break
        middle = 0.5 * (low + high)
        _step_to(step, x, p, hs, skip, middle, s.copy(), answer, 1e-6 if ahead else 0.0)
        if _jump(first, answer, n_comp, n_state) < 0.25 * size:
            low, low_answer[:] = middle, answer
        else:
            high, high_answer[:] = middle, answer
        if k == 8 and _jump(low_answer, high_answer, n_comp, n_state) < 0.5 * size:
            return low, -1.0
    return low, high


@numba.njit(cache=True)
def _bracket(step, x, p, hs, skip, low, high, s, before, after):
    """Angles before and after a transition; the latter is -1 where the law changes smoothly.

    s : memory at `low`; before, after : answers just after low and high. Where a limit is crossed, the step ahead
    jumps early: there the step itself, from the memory at that angle, locates it to 1e-13 rad."""
    low_answer, high_answer, start = before.copy(), after.copy(), s.copy()
    size = _jump(before, after, x.shape[0], s.size)
    low, high = _bisect(step, x, p, hs, skip, low, high, s, low_answer, high_answer, True)
    if high < 0.0:
        return low, high
    far = min(high + 2e-6, 2 * math.pi)
    _step_to(step, x, p, hs, skip, low, start, low_answer, 0.0)
    _step_to(step, x, p, hs, skip, high, start.copy(), low_answer, 0.0)
    _step_to(step, x, p, hs, skip, far, start.copy(), high_answer, 0.0)
    if _jump(low_answer, high_answer, x.shape[0], s.size) <= 0.25 * size:
        return low, high
    low, high = _bisect(step, x, p, hs, skip, high, far, start, low_answer, high_answer, False)
    return low, min(low + 1e-9, 2 * math.pi)  # just behind it


@numba.njit(cache=True)
def _node(points, weights, start, stop, g):
    """Angle and weight of Gauss point g of a segment, or its end."""
    if g == points.size:
        return stop, 0.0
    return start + 0.5 * (stop - start) * (1.0 + points[g]), 0.5 * (stop - start) * weights[g]


@numba.njit(cache=True)
def _first_change(step, x, p, hs, skip, low, high, s, before, answer):
    """The first angle up to `high` at which a step along the tangent gives another answer; high where none does.

    Where the motion leaves a region for less than the time between two nodes and comes back, its tangent leaves it too.
    Such steps are shortened until they show where, or lead past."""
    angle, length = low, high - low
    while angle < high:
        length = min(length, high - angle)
        _step_to(step, x, p, hs, skip, angle, s.copy(), answer, length)
        if _jump(before, answer, x.shape[0], s.size) <= 0.3:
            angle, length = angle + length, 2.0 * length
        elif length > 1e-6:
            length = max(0.25 * length, 1e-6)
        else:
            return angle
    return high


@numba.njit(cache=True)
def _locate(step, x, p, hs, skip, points, weights, s, nodes):
    """March one cycle, s to its value after it; fills nodes (angle, weight) in order and returns their number."""
    n_comp, n_state = x.shape[0], s.size
    answer = np.empty(n_comp * n_comp + 2 * n_comp * n_state + n_state * n_state + 1)
    _step_to(step, x, p, hs, skip, 0.0, s.copy(), answer, 1e-6)
    current, previous, peak, memory = answer.copy(), answer.copy(), answer.copy(), s.copy()
    n, cells, remaining = 0, 8 * hs[-1], _most_transitions(hs[-1])
    start = at = 0.0  # of the segment, and of the memory, which is just past its beginning
    for cell in range(cells):
        end = 2 * math.pi * (cell + 1) / cells
        while start < end:
            high, trial, before, stop = -1.0, s.copy(), at, end
            previous[:] = current
            for g in range(points.size + 1):
                angle, weight = _node(points, weights, start, end, g)
                angle = max(angle, at)
                memory[:] = trial
                _step_to(step, x, p, hs, skip, angle, trial, answer, 1e-6)
                far, peak[:] = angle, answer
                can_change = remaining > 0 and angle > before + 1e-8
                if can_change and _jump(previous, answer, n_comp, n_state) <= 0.3:
                    far = _first_change(step, x, p, hs, skip, before, angle, memory, previous, peak)
                if can_change and (far < angle or _jump(previous, answer, n_comp, n_state) > 0.3):
                    stop, high = _bracket(step, x, p, hs, skip, before, far, memory, previous, peak)
                    if high > 0.0:
                        break
                nodes[n + g, 0], nodes[n + g, 1], before = angle, weight, angle
                previous[:] = answer
            if high < 0.0:
                n += points.size + 1
                s[:], current[:], start, at = trial, previous, end, end
                break
            remaining -= 1
            if stop > start:  # the segment before the transition
                for g in range(points.size + 1):
                    angle, weight = _node(points, weights, start, stop, g)
                    nodes[n, 0], nodes[n, 1] = max(angle, at), weight
                    _step_to(step, x, p, hs, skip, nodes[n, 0], s, current, 0.0)
                    n += 1
            nodes[n, 0], nodes[n, 1] = high, 0.0
            _step_to(step, x, p, hs, skip, high, s, current, 1e-6)
            n += 1
            start, at = stop, high
    return n


@numba.njit(cache=True)
def _march(step, x, p, hs, skip, nodes, s, ds, normal, force, jac):
    """One cycle over the nodes: s and ds, its derivative by the columns, to their values after it; returns the status.

    force, jac : coefficients and their derivative are added to them, where they have a size; normal : component, or -1
    """
    n_comp, n_coeff = x.shape
    n_state, wide = s.size, ds.shape[1]
    m = n_comp * n_coeff
    phi, rate = np.empty(n_coeff), np.empty(n_coeff)
    answer = np.zeros(n_comp * n_comp + n_state * (2 * n_comp + n_state) + 1)
    point, speed, f = np.zeros(n_comp), np.zeros(n_comp), np.zeros(n_comp)
    follows, before, row = np.zeros(n_state), np.zeros((n_state, wide)), np.zeros(m)
    status, last = 0, 0
    e = n_comp * n_comp
    o = e + n_comp * n_state
    for j in range(len(nodes)):
        angle, weight = nodes[j]
        _functions(hs, skip, angle, phi, rate)
        point[:], speed[:] = 0.0, 0.0
        for c in range(n_comp):
            for a in range(n_coeff):
                point[c] += x[c, a] * phi[a]
                speed[c] += x[c, a] * rate[a]
        _call_step(step, point, s, p, f, answer)
        now = int(answer[-1])
        closing = 0.0
        if normal >= 0 and wide >= m and last & SEPARATES and not now & SEPARATES:
            for d in range(n_comp):
                closing += answer[normal * n_comp + d] * speed[d]
        if closing > 0.0:
            for r in range(n_state):
                for d in range(n_comp):
                    for b in range(n_coeff):
                        ds[r, d * n_coeff + b] -= follows[r] * answer[normal * n_comp + d] * phi[b] / closing
        last = now
        if weight > 1e-6:  # a shorter one is a limit that is just touched, as by a pair that has shaken down
            status |= now
        if weight > 0.0 and force.size > 0:
            for c in range(n_comp):
                row[:] = 0.0
                if jac.size > 0:
                    for d in range(n_comp):
                        for b in range(n_coeff):
                            row[d * n_coeff + b] = answer[c * n_comp + d] * phi[b]
                    for r in range(n_state):
                        for b in range(m):
                            row[b] += answer[e + c * n_state + r] * ds[r, b]
                for a in range(n_coeff):
                    part = weight * phi[a] / (2 * math.pi if a == 0 and skip == 0 else math.pi)
                    force[c, a] += part * f[c]
                    if jac.size > 0:
                        for b in range(m):
                            jac[c * n_coeff + a, b] += part * row[b]
        for r in range(n_state):
            follows[r] = 0.0
            for d in range(n_comp):
                follows[r] += answer[o + r * n_comp + d] * speed[d]
            for b in range(wide):
                before[r, b], ds[r, b] = ds[r, b], 0.0
        for r in range(n_state):
            for q in range(n_state):
                slope = answer[o + n_state * n_comp + r * n_state + q]
                if slope != 0.0:
                    for b in range(wide):
                        ds[r, b] += slope * before[q, b]
            if wide >= m:
                for d in range(n_comp):
                    for b in range(n_coeff):
                        ds[r, d * n_coeff + b] += answer[o + r * n_comp + d] * phi[b]
    return status
