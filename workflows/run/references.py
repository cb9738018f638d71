"""Linear references of a nonlinear response: the contact absent, and the contact closed and stuck."""

from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg as sla

from tribodyn.fem.factor import SINGULAR, softest_residual
from tribodyn.fem.modes import dense_modes
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.harmonics import amplitude
from tribodyn.hbm.linear.resonances import linear_resonances
from tribodyn.reduction.linear import stuck_stiffness
from tribodyn.workflows.result.result import References
from tribodyn.workflows.scene.schema import MeshScene, Scene


@dataclass(frozen=True)
class LinearOptions:
    """How linear amplitudes are computed.

    points : frequencies of a curve; between : beside the resonances themselves, to find the largest amplitude
    speeds : of an operating line at which they are computed, linear between
    modes : that are summed; block : frequencies solved at once
    rigid : of the square of the mean frequency, below which an eigenvalue is that of a motion as a rigid body"""

    points: int = 401
    between: int = 41
    speeds: int = 9
    modes: int = 100
    block: int = 32
    rigid: float = 1e-6


LINEAR = LinearOptions()


def linear_references(balance: HarmonicBalance, output: str, start: float, stop: float) -> References:
    """Amplitudes of an output, free and stuck, between two frequencies [rad/s], under the loads of the balance."""
    omega = np.linspace(start, stop, LINEAR.points)
    stuck = _on_line(balance, balance.contact.stiffness, output, omega)
    return References(omega, _on_line(balance, None, output, omega), stuck)


def highest_linear(balance: HarmonicBalance, output: str, start: float, stop: float) -> float:
    """Largest amplitude of an output between two frequencies [rad/s], free or stuck [m]; infinite if unconstrained."""
    if balance.model.follows_frequency:  # at each of its speeds: more than on the line itself
        speeds = [balance.model.at_frequency(float(omega)) for omega in np.linspace(start, stop, LINEAR.speeds)]
        return max(highest_linear(replace(balance, model=model_there), output, start, stop) for model_there in speeds)
    states = (None, balance.contact.stiffness)
    resonances = np.concatenate([linear_resonances(balance, springs, LINEAR.modes) for springs in states])
    if (resonances < np.sqrt(LINEAR.rigid) * (start + stop) / 2).any():
        return np.inf  # between free and stuck a part can have any resonance
    omega = np.unique(np.clip(np.concatenate([np.linspace(start, stop, LINEAR.between), resonances]), start, stop))
    return float(max(_amplitudes(balance, springs, output, omega).max() for springs in states))


def delta_max(scene: Scene, approach: np.ndarray, area: np.ndarray) -> float:
    """The depth that wear steps are a share of: largest approach of the pairs without their contact [m].

    approach : (n_pair,) as `free_deflection`; area : (n_pair,) [m2]
    Of a wheel: mean over the area of the displacement of one face, half the approach of two (Tamatam 2021, 4.3.1)"""
    if isinstance(scene, MeshScene) and scene.wheel is not None:
        return float(0.5 * approach @ area / area.sum())
    return float(approach.max())


def _on_line(balance: HarmonicBalance, springs: np.ndarray | None, output: str, omega: np.ndarray) -> np.ndarray:
    """As `_amplitudes`, where the speed of a wheel goes with the frequency at that speed."""
    if not balance.model.follows_frequency:
        return _amplitudes(balance, springs, output, omega)
    speeds, amplitudes = np.linspace(omega[0], omega[-1], LINEAR.speeds), np.zeros(len(omega))
    for speed in speeds:
        weight = np.maximum(1 - np.abs(omega - speed) / (speeds[1] - speeds[0]), 0.0)
        is_near = weight > 0
        balance_there = replace(balance, model=balance.model.at_frequency(float(speed)))
        amplitudes[is_near] += weight[is_near] * _amplitudes(balance_there, springs, output, omega[is_near])
    return amplitudes


def _amplitudes(balance: HarmonicBalance, springs: np.ndarray | None, output: str, omega: np.ndarray) -> np.ndarray:
    """Amplitude by the lowest modes and the static remainder of the others; off by (h w / w_omitted)^2 of that.

    Of a part that can move rigidly the remainder is that of K + s M, s the mean (h w)^2, which has none.
    springs : (n_pair, n_component) stuck contact [N/m], through which a moving body 2 pulls, or None for no contact"""
    basis = balance.basis
    base = None if balance.excitation.base is None else basis.to_complex(balance.excitation.base)
    amplitudes = np.zeros((len(omega), len(basis.harmonics)), complex)
    for position, h in enumerate(basis.harmonics):
        if not h:
            continue  # an amplitude is that of the vibration
        system, B = balance.model.at_harmonic(h)
        force = balance.excitation.force(h, system.loads, system.n_dof)
        if springs is not None and base is not None:
            force = force + B.conj().T @ (springs.ravel() * base[:, position])
        force = balance.load_factor * force
        if not force.any():
            continue
        stiffness = system.stiffness if springs is None else stuck_stiffness(system.stiffness, B, springs)
        lam, phi, _ = dense_modes(stiffness, system.mass, min(LINEAR.modes, system.n_dof))
        shift = float((h * omega.mean()) ** 2)
        # a free body that turns is even driven outwards: its lam is below zero
        shift = 0.0 if lam[0] > LINEAR.rigid * shift else max(shift, -2 * lam[0])
        factor = sla.cho_factor(stiffness + shift * system.mass if shift else stiffness)
        rate = system.velocity_matrix
        damping = np.zeros((len(lam),) * 2) if rate is None else phi.conj().T @ rate @ phi
        row = system.outputs[output]
        modal = phi.conj().T @ force
        remainder = row @ sla.cho_solve(factor, force) - (row @ phi) @ (modal / (lam + shift))
        for start in range(0, len(omega), LINEAR.block):
            s = 1j * h * omega[start : start + LINEAR.block, None, None]
            dynamic = np.diag(lam) + s**2 * np.eye(len(lam)) + s * damping
            modal_amplitudes = np.linalg.solve(dynamic, modal[:, None])[..., 0]
            amplitudes[start : start + LINEAR.block, position] = remainder + modal_amplitudes @ (row @ phi)
    return amplitude(basis.to_real(amplitudes), basis.harmonics)


def free_deflection(balance: HarmonicBalance) -> np.ndarray:
    """Normal approach of the pairs (n_pair,) under the static loads with body 2 absent [m].

    Of a cyclic part: approach of neighbours. It is nan where the part is unconstrained without its contact, or where
    the normal direction or harmonic 0 is not modelled."""
    interface = balance.model.interface
    missing = np.full(interface.n_pair, np.nan)
    if "n" not in interface.components or not balance.basis.has_static:
        return missing
    system, B = balance.model.at_harmonic(0)
    force = balance.excitation.force(0, system.loads, system.n_dof).real
    try:
        factor = sla.cho_factor(system.stiffness)
    except np.linalg.LinAlgError:
        return missing
    if softest_residual(system.stiffness, lambda b: sla.cho_solve(factor, b)) > SINGULAR:
        return missing  # it can move rigidly, but rounding let the factorisation pass
    q = sla.cho_solve(factor, force)
    return np.asarray((B @ q)[interface.components.index("n") :: len(interface.components)])
