"""What a continuation returns: solution points, and for each an outcome that is a sentence."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

CONVERGED = "converged"


@dataclass(frozen=True)
class Branch:
    """Points of a response curve in the order they were found.

    omega : (n_point,) excitation frequency [rad/s]
    output_names : names of the observed outputs
    response : (n_point, n_output, n_coeff) Fourier coefficients of the outputs [m]
    contact : (n_point, n_pair * n_component, n_coeff) relative displacement [m]
    energy : (n_point,) dissipated energy per cycle, all pairs [J]
    outcome : for each point "converged" or a sentence that says what went wrong
    newton_steps : (n_point,) Newton steps spent
    end : sentence that says where and why the branch ends
    """

    omega: np.ndarray
    output_names: tuple[str, ...]
    response: np.ndarray
    contact: np.ndarray
    energy: np.ndarray
    outcome: tuple[str, ...]
    newton_steps: np.ndarray
    end: str

    @property
    def frequency(self) -> np.ndarray:
        """(n_point,) excitation frequency [Hz]."""
        return self.omega / (2 * np.pi)

    def amplitude(self, output: str, has_static: bool = True) -> np.ndarray:
        """(n_point,) vibration amplitude of an output, see `amplitude` [m]."""
        return amplitude(self.response[:, self.output_names.index(output)], has_static)


def amplitude(coefficients: np.ndarray, has_static: bool = True) -> np.ndarray:
    """Vibration amplitude of Fourier coefficients: square root of the sum over harmonics of a_h^2 + b_h^2.

    coefficients : (..., n_coeff), [x_0, a_1, b_1, ...], without x_0 where has_static is False
    Returns (...) [same unit]; for one harmonic it is the peak value, for several sqrt(2) times the r.m.s.
    """
    dynamic = coefficients[..., 1:] if has_static else coefficients
    return np.sqrt(np.sum(dynamic**2, axis=-1))
