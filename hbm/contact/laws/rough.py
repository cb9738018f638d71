"""Rough contact by statistics of asperities: elastic to yield, elastic-plastic beyond, partial slip, Coulomb's limit.

A table says how many asperities per area stand at which gap, all of one radius. At an approach u (closing, from the
first possible touch) an asperity of gap z is pressed in by d = u - z:

- d <= 1.9 d_y: Hertz, F = 4/3 E* R^1/2 d^3/2
- beyond, while d grows: elastic-plastic (Ghaednia et al. 2019, eq. 25 ff. in the form of Porter and Brake 2023); what
  that form jumps by at 1.9 d_y, some 0.5 %, is taken off, fading with d / d_y, so that F is continuous (ours)
- below the deepest d_m so far: Hertz again, of the flattened radius and from the plastic depth (Brake 2015)

So for a deepest approach u_m every asperity is a Hertzian contact, and their sum p(u; u_m) is convex. By the method of
dimensionality reduction such a contact is a bed of springs, N'' dg of them at each depth g, each with a unilateral
normal spring, a tangential one 2 (1 - nu) / (2 - nu) times as stiff, and Coulomb's limit: this has the partial slip of
Cattaneo and Mindlin for any history of load (Jaeger 1995; Popov and Hess 2015). The bed has SPRINGS springs, dense just
below u_m, where slip begins; they are Jenkins elements. In a periodic cycle u_m is the deepest of the cycle and its
past, and the Jacobian knows how the bed moves with it.
Wear opens the gap: the mean planes part, the asperities keep the shape that the preload has given them.
Source  Greenwood and Williamson 1966; Porter and Brake, MSSP 192 (2023) 110210; the bed of a whole rough face is ours
"""

from dataclasses import dataclass
from functools import partial

import numba
import numpy as np

from tribodyn.declarations import number
from tribodyn.hbm.contact import bed_cycle, bed_table
from tribodyn.hbm.contact.asperity import asperity, tangential_ratio
from tribodyn.hbm.contact.bed_table import ROWS, SPRINGS, TABULATED, bed_springs, look_up, tabulate_bed
from tribodyn.hbm.contact.compiled_law import stamp_with
from tribodyn.hbm.contact.contact_law import SEPARATES, SLIPS, STICKS, ContactParameters
from tribodyn.refusal import Refusal

COMPONENTS = (("t1", "t2", "n"), ("t1", "n"), ("t2", "n"))
STIFFNESS_FROM_NUMBERS = True  # its springs follow from its own numbers
TABLE = ("gap in m", "asperities per m2 and per m of gap, or per m2 where there is one row")

FRICTION, POISSON = 4, 7  # places in a packed row


@dataclass(frozen=True)
class Parameters:
    """The law's own numbers."""

    friction: float = number("", role="friction", low=0.0, usual=(0.0, 1.5))
    """Coulomb coefficient."""
    area: float = number("m2", role="area", default=1.0, above=0.0)
    """Area that a pair stands for; a scene gives each pair its own."""
    young: float = number("Pa", above=0.0)
    """Young's modulus of both bodies."""
    poisson: float = number("", low=0.0, high=0.5)
    """Poisson's ratio of both bodies."""
    radius: float = number("m", role="asperity_radius", above=0.0)
    """Effective radius of the asperities: half the radius of two alike."""
    yield_stress: float = number("Pa", default=0.0, low=0.0)
    """Yield stress; 0 for asperities that never yield."""
    tangent_modulus: float = number("Pa", default=0.0, low=0.0)
    """Slope of stress over strain beyond yield."""
    pressure: float = number("Pa", default=1e7, above=0.0)
    """Mean pressure at which the springs of the stuck contact are taken until the preload is known."""
    deepest: float = number("m", default=0.0, low=0.0)
    """Deepest approach that is tabulated; the largest gap of the table by default."""


def tabulate(parameters: ContactParameters) -> np.ndarray:
    """(n_pair, ...) what every packed row ends with: deepest tabulated approach [m], then the table of its bed."""
    if parameters.table is None:
        raise Refusal("contact law 'rough' needs its table of asperities: columns " + " and ".join(TABLE))
    given = np.ascontiguousarray(parameters.table, float)
    if given.ndim != 2 or given.shape[1] != 2 or not np.isfinite(given).all() or (given < 0).any() or not given.any():
        raise Refusal(f"contact law 'rough': expected two columns without negatives, {' and '.join(TABLE)}")
    if (np.diff(given[:, 0]) <= 0).any():
        raise Refusal("contact law 'rough': the gaps in its table must rise from row to row")
    n = parameters.numbers
    material = np.stack([n[name] for name in ("young", "poisson", "radius", "yield_stress", "tangent_modulus")], axis=1)
    top = np.where(n["deepest"] > 0, n["deepest"], given[:, 0].max())
    if not (top > 0).all():
        raise Refusal("contact law 'rough': give deepest, where all asperities of the table stand at one height")
    rows = np.empty((parameters.n_pair, 1 + (ROWS + 1) * 2 * (1 + SPRINGS)))
    for i in range(parameters.n_pair):
        rows[i, 0] = top[i]
        rows[i, 1:] = tabulate_bed(asperity(tuple(material[i].tolist())), given.tobytes(), float(top[i])).ravel()
    return rows


def springs(parameters: ContactParameters) -> np.ndarray:
    """(n_pair, n_component) tangents [N/m] of the contact stuck at its nominal pressure."""
    packed, n = parameters.packed(), parameters.numbers
    low, high = np.zeros(parameters.n_pair), packed[:, TABULATED].copy()
    for _ in range(60):
        middle = 0.5 * (low + high)
        kn, g, _, _ = bed_springs(packed, middle)
        is_lower = (kn * (middle[:, None] - g)).sum(axis=1) < n["pressure"] * n["area"]
        low, high = np.where(is_lower, middle, low), np.where(is_lower, high, middle)
    stiff = bed_springs(packed, low)[0].sum(axis=1)
    ratio = tangential_ratio(n["poisson"])
    return np.stack([stiff if c == "n" else ratio * stiff for c in parameters.components], axis=1)


def n_state(components: tuple[str, ...]) -> int:
    """The deepest approach [m], then the slider positions of all springs, direction by direction [m]."""
    return 1 + SPRINGS * (len(components) - 1)


def memory_at_rest(x: np.ndarray, parameters: ContactParameters) -> np.ndarray:
    """Memory (n_pair, n_state) of a contact without shear at the displacement x (n_pair, n_component) [m]."""
    deepest = np.maximum(x[:, -1] - parameters.gap, 0.0)
    return np.concatenate([deepest[:, None], np.repeat(x[:, :-1], SPRINGS, axis=1)], axis=1)


@numba.njit(cache=True)
def step(x, s, p, f, dfx, dfs, dsx, dss):
    """Advance one pair by one sample; writes force, memory and their derivatives, returns the status bits."""
    n = x.size - 1
    k, g, dk, dg = np.empty(SPRINGS), np.empty(SPRINGS), np.empty(SPRINGS), np.empty(SPRINGS)
    approach = x[n] - p[3]
    grows = approach > s[0]
    if grows:
        s[0] = approach
        dsx[0, n] = 1.0
    else:
        dss[0, 0] = 1.0
    look_up(p, s[0], k, g, dk, dg)
    ratio, mu = 2 * (1 - p[POISSON]) / (2 - p[POISSON]), p[FRICTION]
    bits = 0
    for c in range(n + 1):
        f[c] = 0.0
    by_deepest = np.zeros(n + 1)  # d f / d deepest
    for q in range(SPRINGS):
        N = k[q] * (approach - g[q])
        if N <= 0.0:
            for c in range(n):
                r = 1 + c * SPRINGS + q
                s[r] = x[c]
                dsx[r, c] = 1.0
            continue
        f[n] += N
        dfx[n, n] += k[q]
        dN = dk[q] * (approach - g[q]) - k[q] * dg[q]
        by_deepest[n] += dN
        for c in range(n):
            r = 1 + c * SPRINGS + q
            T = ratio * k[q] * (x[c] - s[r])
            if abs(T) <= mu * N:
                f[c] += T
                dfx[c, c] += ratio * k[q]
                dfs[c, r] = -ratio * k[q]
                by_deepest[c] += ratio * dk[q] * (x[c] - s[r])
                dss[r, r] = 1.0
                bits |= STICKS
            else:
                side = mu if T > 0.0 else -mu
                f[c] += side * N
                dfx[c, n] += side * k[q]
                by_deepest[c] += side * dN
                s[r] = x[c] - side / ratio * (approach - g[q])
                dsx[r, c] = 1.0
                dsx[r, n] = -side / ratio * (1.0 - dg[q] if grows else 1.0)
                if not grows:
                    dss[r, 0] = side / ratio * dg[q]
                bits |= SLIPS
    for c in range(n + 1):
        if grows:
            dfx[c, n] += by_deepest[c]
        else:
            dfs[c, 0] = by_deepest[c]
    return bits if f[n] > 0.0 else SEPARATES


slider_positions = bed_cycle.slider_positions
sampled_cycle = partial(bed_cycle.cycle, located=False)
event_based_cycle = partial(bed_cycle.cycle, located=True)  # transitions of every spring, and the deepest approach
stamp_with(globals(), bed_table)
