"""Steel faces of asperities for the tests of the rough laws, and motions of their pairs."""

import numpy as np

from tribodyn.hbm.harmonics import HarmonicBasis

YOUNG, POISSON, RADIUS, MU = 192.31e9, 0.3, 1.36493e-3, 0.3
E_STAR, G = YOUNG / (2 * (1 - POISSON**2)), YOUNG / (2 * (1 + POISSON))
STEEL = {"young": YOUNG, "poisson": POISSON, "radius": RADIUS, "yield_stress": 331.7e6, "tangent_modulus": 620e6}
ALL = ("t1", "t2", "n")
HEIGHTS = np.linspace(0, 28e-6, 101)
FACE = np.column_stack([HEIGHTS, 1.4e6 * np.exp(-0.5 * ((HEIGHTS - 14e-6) / 4e-6) ** 2) / (4e-6 * np.sqrt(2 * np.pi))])


def moving(n_pair: int, n_comp: int, basis: HarmonicBasis, seed: int) -> np.ndarray:
    """Displacements that deepen the contact, slip in part, and nearly open it."""
    rng = np.random.default_rng(seed)
    x = rng.normal(size=(n_pair, n_comp, basis.n_coeff)) * 10 ** rng.uniform(-9, -6.3, (n_pair, 1, 1))
    x[:, -1, 0] = rng.uniform(6e-6, 9e-6, n_pair)
    return x
