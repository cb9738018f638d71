"""Harmonic basis: which harmonics are kept, how many time samples, and the transforms both ways."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from tribodyn.refusal import Refusal


@dataclass(frozen=True)
class HarmonicBasis:
    """x(t) = x_0 + sum_h a_h cos(h w t) + b_h sin(h w t), coefficients on the last axis as [x_0, a_1, b_1, ...].

    harmonics : kept harmonics, any strictly increasing set; x_0 is there only where 0 is among them
    n_samples : equidistant time samples of one period; more than twice the highest harmonic, so that none is aliased
    transitions : contact forces are taken at the samples ("sampled"), or the instants of stick, slip, contact and
        separation are located and the forces between them integrated in closed form ("located")"""

    harmonics: tuple[int, ...]
    n_samples: int = 128
    transitions: str = "sampled"

    def __post_init__(self) -> None:
        if not self.harmonics or self.harmonics[0] < 0 or any(np.diff(self.harmonics) <= 0):
            raise Refusal(f"harmonics must be a strictly increasing set of integers >= 0, not {self.harmonics}")
        if self.harmonics == (0,):
            raise Refusal("harmonics (0,) alone describe no vibration: keep at least one harmonic >= 1")
        if self.n_samples <= 2 * self.harmonics[-1]:
            raise Refusal(
                f"{self.n_samples} time samples cannot carry harmonic {self.harmonics[-1]}: "
                f"take at least {2 * self.harmonics[-1] + 1}"
            )
        if self.transitions not in ("sampled", "located"):
            raise Refusal(f"transitions must be 'sampled' or 'located', not '{self.transitions}'")

    @cached_property
    def has_static(self) -> bool:
        """Whether harmonic 0 is kept."""
        return self.harmonics[0] == 0

    @cached_property
    def dynamic(self) -> tuple[int, ...]:
        """Kept harmonics >= 1."""
        return self.harmonics[1:] if self.has_static else self.harmonics

    @cached_property
    def n_coeff(self) -> int:
        """Number of real coefficients."""
        return 2 * len(self.dynamic) + self.has_static

    @cached_property
    def order(self) -> np.ndarray:
        """(n_coeff,) harmonic number of each coefficient."""
        return np.concatenate([np.zeros(int(self.has_static), int), np.repeat(self.dynamic, 2)]).astype(int)

    @cached_property
    def angle(self) -> np.ndarray:
        """(n_samples,) w t of the samples [rad]."""
        return 2 * np.pi * np.arange(self.n_samples) / self.n_samples

    @cached_property
    def synthesis(self) -> np.ndarray:
        """(n_samples, n_coeff) basis functions at the samples: samples = coefficients @ synthesis.T."""
        return self.functions(self.angle)

    @cached_property
    def analysis(self) -> np.ndarray:
        """(n_samples, n_coeff) quadrature weights of each coefficient: coefficients = samples @ analysis."""
        weight = np.where(self.order == 0, 1.0, 2.0) / self.n_samples
        return self.synthesis * weight

    @cached_property
    def rate(self) -> np.ndarray:
        """(n_coeff, n_coeff) matrix R of the derivative with respect to the angle: coefficients of x' = c @ R."""
        rate = np.zeros((self.n_coeff, self.n_coeff))
        for i, h in zip(range(int(self.has_static), self.n_coeff, 2), self.dynamic, strict=True):
            rate[i, i + 1] = -h  # (a cos)' = -h a sin
            rate[i + 1, i] = h  # (b sin)' = h b cos
        return rate

    @cached_property
    def prefix_sums(self) -> tuple[np.ndarray, np.ndarray]:
        """Sums over the first j samples of analysis x synthesis (n_samples + 1, n_coeff, n_coeff) and of analysis."""
        n, m = self.synthesis.shape
        product = np.zeros((n + 1, m, m))
        np.cumsum(self.analysis[:, :, None] * self.synthesis[:, None, :], axis=0, out=product[1:])
        single = np.zeros((n + 1, m))
        np.cumsum(self.analysis, axis=0, out=single[1:])
        return product, single

    def functions(self, angle: np.ndarray) -> np.ndarray:
        """(..., n_coeff) values of 1, cos, sin, cos 2, ... at angles w t [rad]."""
        angle = np.asarray(angle, float)
        columns = [np.ones_like(angle)] if self.has_static else []
        for h in self.dynamic:
            columns += [np.cos(h * angle), np.sin(h * angle)]
        return np.stack(columns, axis=-1)

    def to_time(self, coefficients: np.ndarray) -> np.ndarray:
        """(..., n_coeff) -> (..., n_samples) samples of one period."""
        flat = coefficients.reshape(-1, self.n_coeff) @ self.synthesis.T  # one product, not one per pair
        return flat.reshape(*coefficients.shape[:-1], self.n_samples)

    def from_time(self, samples: np.ndarray) -> np.ndarray:
        """(..., n_samples) samples of one period -> (..., n_coeff)."""
        return (samples.reshape(-1, self.n_samples) @ self.analysis).reshape(*samples.shape[:-1], self.n_coeff)

    def to_complex(self, coefficients: np.ndarray) -> np.ndarray:
        """(..., n_coeff) real -> (..., n_harmonic) complex amplitudes X_h = a - i b, with X_0 = x_0."""
        s = int(self.has_static)
        dynamic = coefficients[..., s::2] - 1j * coefficients[..., s + 1 :: 2]
        return np.concatenate([coefficients[..., :s].astype(complex), dynamic], axis=-1)

    def to_real(self, amplitudes: np.ndarray) -> np.ndarray:
        """(..., n_harmonic) complex amplitudes -> (..., n_coeff) real coefficients; inverse of `to_complex`."""
        s = int(self.has_static)
        out = np.empty((*amplitudes.shape[:-1], self.n_coeff))
        out[..., :s] = amplitudes[..., :s].real
        out[..., s::2] = amplitudes[..., s:].real
        out[..., s + 1 :: 2] = -amplitudes[..., s:].imag
        return out

    def real_matrices(self, matrices: np.ndarray) -> np.ndarray:
        """(..., n n_coeff, m n_coeff) on coefficients, of (n_harmonic, ..., n, m) on complex amplitudes."""
        *is_stack, n, m = matrices.shape[1:]
        s, out = int(self.has_static), np.zeros((*is_stack, n, self.n_coeff, m, self.n_coeff))
        a, b, dynamic = np.arange(s, self.n_coeff, 2), np.arange(s + 1, self.n_coeff, 2), matrices[s:]
        out[..., 0, :, 0] = matrices[0].real
        out[..., a, :, a] = out[..., b, :, b] = dynamic.real
        out[..., a, :, b], out[..., b, :, a] = dynamic.imag, -dynamic.imag
        return out.reshape(*is_stack, n * self.n_coeff, m * self.n_coeff)

    def transfer(self, coefficients: np.ndarray, to: HarmonicBasis) -> np.ndarray:
        """Coefficients (..., n_coeff) in another basis: harmonics that it lacks are dropped, new ones are zero."""
        out = np.zeros((*coefficients.shape[:-1], to.n_coeff))
        for h in set(self.harmonics) & set(to.harmonics):
            out[..., to.order == h] = coefficients[..., self.order == h]
        return out

    def shift(self, coefficients: np.ndarray, angle: float) -> np.ndarray:
        """Coefficients of x(t + angle / w)."""
        amplitudes = self.to_complex(coefficients)
        return self.to_real(amplitudes * np.exp(1j * np.asarray(self.harmonics) * angle))

    def work_per_cycle(self, force: np.ndarray, displacement: np.ndarray) -> np.ndarray:
        """Work of a force over one period, integral of f dx.

        force, displacement : (..., n_coeff) [N], [m]
        Returns (...) [J] = sum_h pi h (f_a x_b - f_b x_a)"""
        s = int(self.has_static)
        h = np.asarray(self.dynamic)
        fa, fb = force[..., s::2], force[..., s + 1 :: 2]
        xa, xb = displacement[..., s::2], displacement[..., s + 1 :: 2]
        return np.pi * np.sum(h * (fa * xb - fb * xa), axis=-1)


def amplitude(coefficients: np.ndarray, harmonics: tuple[int, ...]) -> np.ndarray:
    """Vibration amplitude of Fourier coefficients (..., n_coeff): half the range of the cycle (...) [same unit]."""
    fine = _fine(harmonics)
    if len(fine.dynamic) == 1:
        return np.asarray(np.sqrt(np.sum(coefficients[..., int(fine.has_static) :] ** 2, axis=-1)))
    return np.asarray(np.sum(coefficients * amplitude_slope(coefficients, harmonics), axis=-1))


def amplitude_slope(coefficients: np.ndarray, harmonics: tuple[int, ...]) -> np.ndarray:
    """Derivative (..., n_coeff) of `amplitude` by the coefficients: an extreme does not change with its instant."""
    fine = _fine(harmonics)
    if len(fine.dynamic) == 1:
        vibration = np.where(fine.order > 0, coefficients, 0.0)
        size = np.linalg.norm(vibration, axis=-1, keepdims=True)
        return np.divide(vibration, size, out=np.zeros_like(vibration), where=size > 0)
    highest, lowest = (fine.functions(_angle_of_maximum(sign * coefficients, fine)) for sign in (1.0, -1.0))
    return np.asarray((highest - lowest) / 2)


@lru_cache(maxsize=32)
def _fine(harmonics: tuple[int, ...]) -> HarmonicBasis:
    # samples of a cycle per highest harmonic, between which its extremes are located
    return HarmonicBasis(harmonics, 32 * harmonics[-1])


def _angle_of_maximum(coefficients: np.ndarray, fine: HarmonicBasis) -> np.ndarray:
    """w t (...) of the maximum of a cycle [rad]: the best sample after a Newton step from each, then located."""
    derivatives = [coefficients, coefficients @ fine.rate, coefficients @ fine.rate @ fine.rate]
    reach = np.pi / fine.n_samples

    def newton_step(slope: np.ndarray, curvature: np.ndarray) -> np.ndarray:
        step = np.divide(-slope, curvature, out=np.zeros_like(slope), where=curvature < 0)
        return np.clip(step, -reach, reach)

    value, slope, curvature = (fine.to_time(c) for c in derivatives)
    step = newton_step(slope, curvature)
    best = np.argmax(value + step * (slope + step * curvature / 2), axis=-1)
    angle = fine.angle[best] + np.take_along_axis(step, best[..., None], axis=-1)[..., 0]
    for _ in range(3):
        functions = fine.functions(angle)
        angle = angle + newton_step(*(np.sum(c * functions, axis=-1) for c in derivatives[1:]))
    return np.asarray(angle)
