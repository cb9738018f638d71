"""The Jacobian of a harmonic balance, and how Newton's directions are solved for."""

from collections.abc import Callable
from functools import cached_property

import numpy as np
import scipy.linalg as sla

from tribodyn.hbm.contact.contact_law import ContactCycle
from tribodyn.hbm.krylov import gmres
from tribodyn.hbm.linear import pair_slopes
from tribodyn.hbm.linear.linear_side import LinearSide

NEARLY_ALL = 0.03  # share of the flexibility that products may leave out and still find Newton's directions alone
INNER, INNER_PRODUCTS = 0.05, 60  # residual and products of a direction within a direction, where they leave out more
Remainder = Callable[[np.ndarray], np.ndarray] | None
"""(n_contact, n_coeff) departures g [N] -> contact displacement [m]."""


class Linearisation:
    """I - G dg/dx, with dg/dx block diagonal over pairs and zero where a pair stays stuck and closed.

    active : pairs with a derivative; rows : their contact rows"""

    def __init__(
        self, point: LinearSide, stiffness: np.ndarray, x: np.ndarray, cycle: ContactCycle, remainder: Remainder = None
    ):
        """G, the stuck springs (n_contact,) [N/m], the contact cycle at x with its derivative, what `nearly` lacks."""
        jac = cycle.jacobian
        if jac is None:
            raise ValueError("linearise needs a state evaluated with its contact derivative")
        n_pair, n_comp, n_coeff = x.shape
        self.active, self._dg = pair_slopes.departures(jac, stiffness.reshape(n_pair, n_comp))
        self.rows = (self.active[:, None] * n_comp + np.arange(n_comp)).ravel()
        self._shape, self._n_pair = (n_pair * n_comp, n_coeff), n_pair
        self._point, self._remainder = point, remainder
        self._product = self._point.jacobian_product(self.rows)

    def departure_slope(self, direction: np.ndarray) -> np.ndarray:
        """dg/dx . direction: (n_contact, n_coeff)."""
        return self._in_all_rows(self.g_slope(direction[self.rows]))

    def _in_all_rows(self, active: np.ndarray) -> np.ndarray:
        """(n_contact, n_coeff) of what vanishes but on the rows of active pairs."""
        out = np.zeros(self._shape)
        out[self.rows] = active
        return out

    def g_slope(self, active_direction: np.ndarray) -> np.ndarray:
        """dg/dx . direction on the rows of active pairs, both (n_active_rows, n_coeff)."""
        force: np.ndarray = pair_slopes.times(self._dg, active_direction)
        return force

    def product(self, d: np.ndarray) -> np.ndarray:
        """(I - G dg/dx) d on the rows of active pairs, d (n_active_rows, n_coeff)."""
        slope = self.g_slope(d)
        displacement = self._product(slope)
        return d - (
            displacement
            if self._remainder is None
            else displacement + self._remainder(self._in_all_rows(slope))[self.rows]
        )

    def precondition(self, d: np.ndarray) -> np.ndarray:
        """An approximate solution of (I - G dg/dx) p = d on the rows of active pairs, by blocks or coarse part of G."""
        if self._block_inverse is not None:
            full, n = self._in_all_rows(d), len(self._block_inverse)
            solved: np.ndarray = np.matmul(self._block_inverse, full.reshape(n, -1, 1)).reshape(self._shape)
            return solved[self.rows]
        if self._coarse_factors is None:
            return d
        direction: np.ndarray = pair_slopes.preconditioned(d, self._dg, *self._coarse_factors)
        return direction

    @cached_property
    def _block_inverse(self) -> np.ndarray | None:
        """Inverses of the diagonal blocks of I - G dg/dx; None where there are none or one is singular."""
        g = self._point.blocks
        if g is None:
            return None
        n, m = len(g), g.shape[1]
        pairs, width = self._n_pair, self._dg.shape[1]
        slope = np.zeros((pairs, width, width))
        slope[self.active] = self._dg
        of_block = slope.reshape(n, pairs // n, width, width)
        columns = g.reshape(n, m, pairs // n, width).transpose(0, 2, 1, 3)
        through = np.matmul(columns, of_block).transpose(0, 2, 1, 3)
        try:
            return np.linalg.inv(np.eye(m) - through.reshape(n, m, m))
        except np.linalg.LinAlgError:
            return None

    @cached_property
    def _coarse_factors(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray] | None:
        """U, A and the factors of I - A U^T D U; None where there is no coarse part or it is singular."""
        if self.coarse is None:
            return None
        u, a, matrix = self.coarse
        lower_upper, pivots, zero = sla.lapack.dgetrf(matrix)
        return (u, a, lower_upper.T, pivots) if zero == 0 else None

    @cached_property
    def coarse(self) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
        """U (n_active_rows, r) and A, I - A U^T D U (r n_coeff, r n_coeff), where G ~ U A U^T; None where r = 0.

        With D = dg/dx the inverse of I - U A U^T D is I + U (I - A U^T D U)^-1 A U^T D (Woodbury)."""
        u, a = self._point.coarse_part(self.rows)
        r, m = u.shape[1], self._shape[1]
        if r == 0:
            return None
        inside = pair_slopes.projected(self._dg, u.astype(np.float32), m)
        return u, a, np.eye(r * m) - a @ inside

    def spread(self, d: np.ndarray, rhs: np.ndarray) -> np.ndarray:
        """The solution of (I - G dg/dx) d = rhs in all rows (n_contact, n_coeff) from that in the active rows."""
        if len(self.rows) == self._shape[0]:
            return d
        g = self._in_all_rows(self.g_slope(d))
        full = rhs + self._point.nearly(g) + (0.0 if self._remainder is None else self._remainder(g))
        full[self.rows] = d
        return full

    def solve(self, rhs: np.ndarray, tolerance: float, max_products: int = 200) -> tuple[np.ndarray, int, float]:
        """Solve (I - G dg/dx) d = rhs for rhs (n_contact, n_coeff).

        Returns d, products spent, relative residual reached"""
        if len(self.active) == 0:
            return rhs.copy(), 0, 0.0
        shape = (len(self.rows), self._shape[1])

        def nearly(b: np.ndarray, target: float, limit: int) -> tuple[np.ndarray, int, float]:
            return gmres(
                lambda v: self.product(v.reshape(shape)).ravel(),
                b,
                target,
                limit,
                lambda v: self.precondition(v.reshape(shape)).ravel(),
            )

        def exactly(v: np.ndarray) -> np.ndarray:
            return v - self._point.apply(self._in_all_rows(self.g_slope(v.reshape(shape))))[self.rows].ravel()

        b = rhs[self.rows].ravel()
        if self._point.left_out <= NEARLY_ALL:
            d, spent, reached = nearly(b, tolerance, max_products)
        else:
            # products that leave much out find a direction for one that leaves nothing out
            d, spent, reached = gmres(
                exactly, b, tolerance, max_products, lambda v: nearly(v, INNER, INNER_PRODUCTS)[0]
            )
        return self.spread(d.reshape(shape), rhs), spent, reached

    def solve_refined(self, rhs: np.ndarray, tolerance: float) -> np.ndarray:
        """As `solve`, but its products are of single precision: refined with the exact one to the tolerance."""
        d, _, _ = self.solve(rhs, max(tolerance, 1e-6))
        size = float(np.linalg.norm(rhs))
        for _ in range(4):
            residual = rhs - d + self._point.apply(self.departure_slope(d))
            error = float(np.linalg.norm(residual))
            if error <= tolerance * size:
                break
            d = d + self.solve(residual, max(tolerance * size / error, 1e-6))[0]
        return d

    def dense(self) -> np.ndarray:
        """The Jacobian as a matrix (n_contact * n_coeff, same); for checks and as fallback.

        G couples no harmonics, and a sine is a cosine turned: one product for each active row finds all its columns."""
        n, m = self._shape
        full = np.eye(n * m)
        if len(self.active) == 0:
            return full
        n_comp, s = n // self._n_pair, m % 2  # the constant, where it is kept, comes first
        columns = full.reshape(n, m, self._n_pair, n_comp * m)
        slope = self._dg.reshape(-1, m, n_comp * m)
        unit = np.zeros(m)
        unit[:s] = unit[s::2] = 1.0
        for row, pushed in zip(self.rows, slope, strict=True):
            g = np.zeros(self._shape)
            g[row] = unit
            displacement = self._point.apply(g)[..., None]
            # a unit of sine moves by -sine and cosine
            cosine, sine = displacement[:, s::2], displacement[:, s + 1 :: 2]
            block = columns[:, :, row // n_comp]
            block[:, :s] -= displacement[:, :s] * pushed[:s]
            block[:, s::2] -= cosine * pushed[s::2] - sine * pushed[s + 1 :: 2]
            block[:, s + 1 :: 2] -= sine * pushed[s::2] + cosine * pushed[s + 1 :: 2]
        return full
