"""Oscillators with closed-form response curves, and two with friction, for the checks of continuations."""

import numpy as np
from scipy.optimize import brentq

from tests.helpers.verification_models import oscillator, random_structure, slab
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.contact.contact_law import ContactParameters
from tribodyn.hbm.contact.joint import Joint
from tribodyn.hbm.excitation import Excitation
from tribodyn.hbm.harmonics import HarmonicBasis


class Duffing:
    """x'' + 2 zeta x' + x + g x^3 = force cos(w t), half of the unit stiffness in the contact spring."""

    def __init__(self, zeta: float = 0.02, force: float = 0.3, cubic: float = 1.0):
        self.zeta, self.force, self.cubic = zeta, force, cubic

    def balance(self, harmonics: tuple[int, ...] = (1,), n_samples: int = 64, length: float = 1.0) -> HarmonicBalance:
        """`length` is the size of a metre in the unit that the model is written in."""
        model = oscillator(1.0, 0.5, self.zeta * np.sqrt(2.0), "n")
        parameters = ContactParameters.of(("n",), [[0.5]], cubic=self.cubic / length**2)
        excitation = Excitation.of(harmonic={1: {"force": self.force * length}})
        return HarmonicBalance.of(
            model, Joint("contact", "cubic_spring", parameters), HarmonicBasis(harmonics, n_samples), excitation, 5.0
        )

    def defect(self, omega: np.ndarray, amplitude: np.ndarray) -> np.ndarray:
        """Relative defect of the one-harmonic amplitude equation."""
        stiffness = 1 - omega**2 + 0.75 * self.cubic * amplitude**2
        return (stiffness**2 + (2 * self.zeta * omega) ** 2) * amplitude**2 / self.force**2 - 1

    def folds(self, low: float = 0.6, high: float = 4.9) -> np.ndarray:
        """Frequencies between two at which the cubic in the squared amplitude has a double root."""

        def discriminant(omega):
            a = (0.75 * self.cubic) ** 2
            b = 1.5 * self.cubic * (1 - omega**2)
            c = (1 - omega**2) ** 2 + (2 * self.zeta * omega) ** 2
            d = -(self.force**2)
            return 18 * a * b * c * d - 4 * b**3 * d + b * b * c * c - 4 * a * c**3 - 27 * a * a * d * d

        omega = np.linspace(low, high, 20001)  # two folds nearer than its points are not seen
        value = discriminant(omega)
        changes = np.flatnonzero(value[1:] * value[:-1] < 0)
        return np.array([brentq(discriminant, omega[i], omega[i + 1], xtol=1e-15, rtol=1e-14) for i in changes])


class Lifting:
    """A mass pressed on a unilateral spring: x'' + 2 zeta sqrt(k) x' + k x + max(kn x, 0) = press + force cos(w t)."""

    def __init__(self, zeta: float = 0.02, force: float = 0.3, press: float = 1.0, kn: float = 5.0):
        self.zeta, self.force, self.press, self.kn = zeta, force, press, kn

    def balance(
        self, harmonics: tuple[int, ...] = (0, 1), n_samples: int = 64, transitions: str = "sampled"
    ) -> HarmonicBalance:
        parameters = ContactParameters.of(("n",), [[self.kn]])
        excitation = Excitation.of({"normal": self.press}, {1: {"force": self.force}})
        basis = HarmonicBasis(harmonics, n_samples, transitions)
        return HarmonicBalance.of(
            oscillator(1.0, 1.0, self.zeta, "n"), Joint("contact", "unilateral", parameters), basis, excitation, 10.0
        )

    def _contact(self, mean: float, amplitude: float) -> tuple[float, float]:
        """Mean and first harmonic of max(kn (mean + amplitude cos), 0), in closed form."""
        ratio = mean / amplitude
        if ratio >= 1:
            return self.kn * mean, self.kn * amplitude
        closed = np.arccos(-ratio)  # half of the time in contact, as an angle
        average = self.kn / np.pi * (mean * closed + amplitude * np.sin(closed))
        first = self.kn / np.pi * (2 * mean * np.sin(closed) + amplitude * (closed + np.sin(closed) * np.cos(closed)))
        return average, first

    def omega(self, amplitude: float, side: int) -> float:
        """Frequency below (-1) or above (1) resonance at which one-harmonic balance has this amplitude."""
        mean = brentq(
            lambda m: m + self._contact(m, amplitude)[0] - self.press, -0.999 * amplitude, 2 * self.press, xtol=1e-15
        )
        k = 1 + self._contact(mean, amplitude)[1] / amplitude
        p = k - 2 * self.zeta**2
        root = p**2 - k**2 + (self.force / amplitude) ** 2
        return float(np.sqrt(p + side * np.sqrt(root)))


def rubbing_mass(
    harmonics: tuple[int, ...] = (0, 1), n_samples: int = 128, transitions: str = "sampled", zeta: float = 0.01
) -> HarmonicBalance:
    """A pressed mass on a Jenkins element that sticks far from its resonance and slips in it."""
    parameters = ContactParameters.of(("t1", "n"), [[3.0, 5.0]], friction=0.5)
    excitation = Excitation.of({"normal": 1.0}, {1: {"force": 0.3}})
    basis = HarmonicBasis(harmonics, n_samples, transitions)
    return HarmonicBalance.of(
        oscillator(1.0, 1.0, zeta), Joint("contact", "jenkins", parameters), basis, excitation, 5.0
    )


def rubbing_pairs(harmonics: tuple[int, ...] = (0, 1), n_samples: int = 64) -> HarmonicBalance:
    """Four pairs under a random structure."""
    parameters = ContactParameters.of(("t1", "t2", "n"), np.full((4, 3), 5e6), friction=0.4)
    excitation = Excitation.of({"static": 2000.0}, {1: {"shaker": 1500.0}})
    basis = HarmonicBasis(harmonics, n_samples)
    return HarmonicBalance.of(
        random_structure(4, seed=2), Joint("contact", "jenkins", parameters), basis, excitation, 2000.0
    )


def pressed_slab(law: str = "jenkins") -> HarmonicBalance:
    """Four pairs with friction that slide, rock and lift: six folds within the first resonance."""
    model = slab(2, 2, ratio=0.01)
    parameters = ContactParameters.of(("t1", "t2", "n"), model.interface.stiffness(4e6, 6e6), friction=0.3)
    excitation = Excitation.of({"press": 60.0}, {1: {"rock": 2.0, "shake": 2.0 / 3}})
    basis = HarmonicBasis((0, 1, 2), 128, "located")
    return HarmonicBalance.of(model, Joint("contact", law, parameters), basis, excitation, 8e3)
