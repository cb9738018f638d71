"""One pair of asperities, elastic to yield and elastic-plastic beyond, and the pressure of many of them.

Source  Hertz 1882; Ghaednia et al. 2019 in the form of Porter and Brake, MSSP 192 (2023) 110210; Brake 2015"""

from dataclasses import dataclass

import numpy as np

HEIGHTS = 1000  # at which the density of gaps is summed, at least
YIELD = 1.9  # d / d_y up to which an asperity is elastic


@dataclass(frozen=True)
class Asperity:
    """One pair of asperities. E : E*; R : effective radius [m]; young, nu, yield_stress, tangent : of the material."""

    E: float
    R: float
    young: float
    nu: float
    yield_stress: float
    tangent: float

    @property
    def onset(self) -> float:
        """Approach at which it begins to yield, 1.9 d_y [m]."""
        return YIELD * self._d_y if self.yield_stress else np.inf

    @property
    def _C(self) -> float:
        return 1.295 * float(np.exp(0.736 * self.nu))

    @property
    def _d_y(self) -> float:
        return 4 * self.R * (np.pi * self._C * self.yield_stress / (4 * self.E)) ** 2

    def hertz(self, d: np.ndarray) -> np.ndarray:
        """Elastic force [N] at approaches d >= 0 [m]."""
        return 4 / 3 * self.E * np.sqrt(self.R) * d**1.5

    def loading(self, d: np.ndarray) -> np.ndarray:
        """Force [N] at approaches d >= 0 [m] that were never exceeded."""
        elastic = self.hertz(d)
        if not self.yield_stress:
            return elastic
        w = np.maximum(d / self._d_y, YIELD)
        jump = self._plastic(np.array(YIELD)) - self.hertz(np.array(self.onset))
        return np.where(d > self.onset, self._plastic(w) - jump * np.exp(YIELD - w), elastic)

    def _plastic(self, w: np.ndarray) -> np.ndarray:
        d, C, S = w * self._d_y, self._C, self.yield_stress
        elastic, hardening = self.hertz(d), self.tangent / self.young
        a_e = np.sqrt(self.R * d)
        B = 0.14 * np.exp(23 * S / (2 * self.E))
        a_p = self.R * np.pi * C * S / (2 * self.E) * np.sqrt(w * (w / YIELD) ** B)
        if hardening > np.finfo(float).eps:
            root = np.sqrt(self.young / S)
            upsilon = -2 * root * hardening ** (1 - (d - self._d_y) / (4 * self.R))
            upsilon = upsilon / ((4 - 3 * np.exp(-2 * root * hardening)) * (1 - hardening))
        else:
            upsilon = np.zeros_like(d)
        a = a_e + (a_p - a_e) * np.exp(upsilon)
        hardness = 2.84 - 0.92 * (1 - np.cos(np.pi * a / (2 * self.R)))
        F_c = 4 / 3 * (self.R / self.E) ** 2 * (C * np.pi * S / 2) ** 3
        plastic = np.exp(-0.25 * w ** (5 / 12)) * w**1.5 + 4 * hardness / C * (1 - np.exp(-(w ** (5 / 9)) / 25)) * w
        return F_c * plastic + (elastic - F_c * plastic) * (1 - np.exp(-3.3 * hardening))

    def flattened(self, d_m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Plastic depth [m] and root of the radius [m^0.5] of the Hertzian contact below the deepest approach d_m."""
        d_m = np.maximum(d_m, 1e-100)  # whose force is still above zero
        share = self.loading(d_m) / self.hertz(d_m)
        share = np.where(d_m > self.onset, share, 1.0)
        root = np.sqrt(self.R) / np.sqrt(share)  # F_m / (4/3 E* (share d_m)^3/2)
        return d_m * (1 - share), root


def asperity(numbers: tuple[float, ...]) -> Asperity:
    """The asperity of (young, poisson, radius, yield stress, tangent modulus)."""
    young, nu, radius, yield_stress, tangent = numbers
    return Asperity(young / (2 * (1 - nu**2)), radius, young, nu, yield_stress, tangent)


def pressure(asperity: Asperity, table: np.ndarray, u: np.ndarray, deepest: float) -> np.ndarray:
    """Pressure p(u; u_m) [Pa] at approaches u (n,), the deepest so far being u_m; table : (k, 2) gaps and counts."""
    gap, count = table.T
    pressed = gap < deepest
    offset, root = asperity.flattened(deepest - gap[pressed])
    d = np.maximum(u[:, None] - gap[pressed] - offset, 0.0)
    return (4 / 3 * asperity.E * root * d**1.5) @ count[pressed]


def heights(table: np.ndarray) -> np.ndarray:
    """(k, 2) gaps [m] and asperities per m2 at them, from a density that is linear between the rows of a table."""
    if len(table) == 1:
        return table
    gap, density = table.T
    parts = -(-HEIGHTS // (len(gap) - 1))
    fine = np.interp(np.arange(parts * (len(gap) - 1) + 1) / parts, np.arange(len(gap)), gap)
    width = np.gradient(np.concatenate([[2 * fine[0] - fine[1]], fine, [2 * fine[-1] - fine[-2]]]))[1:-1]
    width[[0, -1]] /= 2
    return np.column_stack([fine, width * np.interp(fine, gap, density)])


def tangential_ratio(nu: np.ndarray) -> np.ndarray:
    """Tangential over normal stiffness of a stuck asperity (Mindlin 1949)."""
    return 2 * (1 - nu) / (2 - nu)
