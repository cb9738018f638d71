"""What a wear run returns: the contact and the response, wear step by wear step."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class WearHistory:
    """Evolution of a contact under wear; row i is the state solved at the start of wear step i.

    cycles : (n_row,) vibration cycles passed before the row's state
    cycles_in_step : (n_row,) cycles that the state stands for; 0 in the last row, where contact is lost
    depth : (n_row, n_pair) total wear depth of the pair, both surfaces together [m]
    energy : (n_row, n_pair) dissipated energy per cycle [J]
    preload : (n_row,) static normal force of the whole contact [N]
    normal_force : (n_row, n_pair) mean normal force over the cycle [N]
    status : (n_row, n_pair) bits over one cycle: 1 sticks, 2 slips, 4 separates
    omega : (n_row,) frequency of the cycle [rad/s]
    amplitude : (n_row,) vibration amplitude of the response output [m]
    displacement, force : (n_row, n_pair * n_component, n_coeff) Fourier coefficients at the contact [m], [N]
    response : (n_row, n_output, n_coeff) Fourier coefficients of the outputs [m]
    solves : (n_row,) harmonic balance solves spent on the row
    end : sentence that says why the run ended
    """

    cycles: np.ndarray
    cycles_in_step: np.ndarray
    depth: np.ndarray
    energy: np.ndarray
    preload: np.ndarray
    normal_force: np.ndarray
    status: np.ndarray
    omega: np.ndarray
    amplitude: np.ndarray
    displacement: np.ndarray
    force: np.ndarray
    response: np.ndarray
    solves: np.ndarray
    end: str
