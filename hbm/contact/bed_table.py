"""The bed of springs that stands for a rough face at its deepest approach.

For a deepest approach u_m every asperity is a Hertzian contact, and their sum p(u; u_m) is convex. By the method of
dimensionality reduction it is a bed of springs, N'' dg of them at each depth g: SPRINGS of them, dense just below u_m,
where slip begins, tabulated over u_m.
Source  Popov and Hess 2015; the bed of a whole rough face is ours"""

import math
from functools import lru_cache

import numba
import numpy as np

from tribodyn.hbm.contact.asperity import Asperity, heights, pressure

SPRINGS = 40  # of the bed
ROWS = 64  # depths at which the bed is tabulated, equidistant in the root of the deepest approach
FIRST = 1e-4  # depth of the first spring below the deepest approach, over the whole depth of the bed
WIDEST = 0.05  # largest distance of two springs, over the same
SLOPE_STEP = 0.2  # rows on either side between which slopes of the table are taken
AREA, TABULATED = 5, 13  # places in a packed row of the law


# depth of the springs below the deepest approach, over the depth of the bed: 0 < s_1 < ... < s_Q = 1
def _graded_depths() -> np.ndarray:
    """In geometric progression while their distance is below WIDEST, equidistant from there on."""
    for graded in range(SPRINGS - 1, 0, -1):  # the fewer graded ones, the finer the rest
        even = SPRINGS - graded
        low = np.geomspace(FIRST, 1 - even * WIDEST, graded) if even * WIDEST < 1 else None
        if low is not None and low[-1] - low[-2] <= WIDEST:
            return np.concatenate([[0.0], low, np.linspace(low[-1], 1.0, even + 1)[1:]])
    raise AssertionError


DEPTH = _graded_depths()


@lru_cache(maxsize=32)
def tabulate_bed(asperity: Asperity, flat: bytes, deepest: float) -> np.ndarray:
    """(ROWS + 1, 2, 1 + SPRINGS) depth of the bed [m] and its springs [N/m3], and their slopes over the row number."""
    table = heights(np.frombuffer(flat).reshape(-1, 2))

    def bed_row(row: float) -> np.ndarray:
        u_m = deepest * (row / ROWS) ** 2
        gap = table[:, 0]
        pressed = gap < u_m
        if not pressed.any():
            return np.zeros(1 + SPRINGS)
        offset, _ = asperity.flattened(u_m - gap[pressed])
        depth = u_m - float((gap[pressed] + offset).min())
        p = pressure(asperity, table, u_m - depth * DEPTH, u_m)
        slope = np.append(-np.diff(p) / (depth * np.diff(DEPTH)), 0.0)
        return np.concatenate([[depth], slope[:-1] - slope[1:]])

    result = np.zeros((ROWS + 1, 2, 1 + SPRINGS))
    for row in range(ROWS + 1):
        result[row, 0] = bed_row(row)
        low = max(row - SLOPE_STEP, 0.0)
        result[row, 1] = (bed_row(row + SLOPE_STEP) - bed_row(low)) / (row + SLOPE_STEP - low)
    return result


def bed_springs(p: np.ndarray, deepest: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Springs [N/m] and their approaches of touch [m], both (n_pair, SPRINGS), and d / d deepest of both.

    p : packed rows; deepest : (n_pair,) [m]; nothing where it is not above zero"""
    shape = (len(p), SPRINGS)
    k, g, dk, dg = (np.zeros(shape) for _ in range(4))
    _beds(p, deepest, k, g, dk, dg)
    return k, g, dk, dg


@numba.njit(cache=True)
def _beds(p, deepest, k, g, dk, dg):
    for i in range(p.shape[0]):
        look_up(p[i], deepest[i], k[i], g[i], dk[i], dg[i])


@numba.njit(cache=True)
def look_up(p, deepest, k, g, dk, dg):
    """The bed of one pair, cubic between the rows of its table and straight on beyond the last; see `bed_springs`."""
    area, top = p[AREA], p[TABULATED]
    if deepest <= 0.0:
        for q in range(SPRINGS):
            k[q], g[q], dk[q], dg[q] = 0.0, 0.0, 0.0, 1.0
        return
    at = ROWS * math.sqrt(deepest / top)
    rate = 0.5 * at / deepest  # d at / d deepest
    row = min(int(at), ROWS - 1)
    t = at - row
    if t <= 1.0:
        b0, b1 = (1 + 2 * t) * (1 - t) ** 2, t * t * (3 - 2 * t)
        m0, m1 = t * (1 - t) ** 2, t * t * (t - 1)
        db1 = 6 * t * (1 - t)
        dm0, dm1 = (1 - t) * (1 - 3 * t), t * (3 * t - 2)
        db0 = -db1
    else:
        b0, b1, m0, m1 = 0.0, 1.0, 0.0, t - 1.0
        db0, db1, dm0, dm1 = 0.0, 0.0, 0.0, 1.0
    width = 1 + SPRINGS
    o = TABULATED + 1 + row * 2 * width
    v0, s0, v1, s1 = o, o + width, o + 2 * width, o + 3 * width
    depth = b0 * p[v0] + b1 * p[v1] + m0 * p[s0] + m1 * p[s1]
    ddepth = rate * (db0 * p[v0] + db1 * p[v1] + dm0 * p[s0] + dm1 * p[s1])
    for q in range(SPRINGS):
        c = q + 1
        k[q] = area * (b0 * p[v0 + c] + b1 * p[v1 + c] + m0 * p[s0 + c] + m1 * p[s1 + c])
        dk[q] = area * rate * (db0 * p[v0 + c] + db1 * p[v1 + c] + dm0 * p[s0 + c] + dm1 * p[s1 + c])
        if k[q] < 0.0:
            k[q], dk[q] = 0.0, 0.0
        g[q] = deepest - depth * DEPTH[c]
        dg[q] = 1.0 - ddepth * DEPTH[c]
