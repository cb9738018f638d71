"""What a free decay along a nonlinear mode loses in a period, from the mode itself.

The damping ratio zeta of a nonlinear mode counts the loss of a cycle against its kinetic energy: it is the ratio of the
term - 2 zeta w M q' that would keep the motion going. A free decay takes the same loss from the energy that is stored,
and springs that slip do not store more of it for a larger amplitude. With E(A) the energy at a turning point of the
amplitude A, its logarithmic decrement is

    delta = (loss of a cycle) / (2 pi dE / d ln A),        (k + k_eq) / k times zeta for one friction element.

Only laws know what their springs hold. So the energy is taken in two parts: that of the structure with every contact
stuck and closed, from the mode; and the work of the departure g = k x - f_c, from the law marched along one slowly
falling cycle of the mode's own displacement, which holds the loss and what the contact gives back.
Source  energy balance of slowly varying motion, as of Krack, Bergman and Vakakis, JSV 372 (2016); in this form ours"""

import numpy as np

from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.contact import compiled_law
from tribodyn.hbm.continuation.free_vibration import FreeVibration, ModePoint
from tribodyn.hbm.continuation.nonlinear_modes import Backbone
from tribodyn.hbm.threads import single
from tribodyn.hbm.time import coupled_pairs, time_step
from tribodyn.refusal import Refusal

LEAST = 1e-4  # decrement over 2 pi of the falling cycle, where the damping is below


@single
def decrement(balance: HarmonicBalance, mode: Backbone) -> np.ndarray:
    """Logarithmic decrement over 2 pi (n_point,) of a free decay, at the amplitudes mode.first_harmonic.

    Its error is of second order in the distance of the points and of first order in the decrement itself.
    Raises  ValueError for fewer than three points, a backbone that turns back in amplitude, several contact laws"""
    size = np.log(mode.first_harmonic)
    if len(size) < 3 or not (np.all(np.diff(size) > 0) or np.all(np.diff(size) < 0)):
        raise Refusal("a decay has one rate per amplitude where the backbone has three points and never turns back")
    problem = FreeVibration(balance.with_load(0.0), mode.number, mode.output)
    if not problem.one_system:
        raise Refusal("a free decay needs one system for all harmonics: this model has several")
    points = [
        problem.at(
            mode.contact[i].reshape(problem.rest_x.shape), mode.omega[i], mode.damping[i], mode.modal_amplitude[i]
        )
        for i in range(len(size))
    ]
    order = problem.basis.order
    x = np.stack([p.x for p in points])
    eta = np.stack([problem.basis.to_real(p.eta) for p in points])
    by_size = [_slope(values, size, order) for values in (x, eta)]
    by_omega = np.gradient(mode.omega, size, edge_order=2)
    law = _Marched(problem)
    return np.array(
        [
            law.rate(p, x_slope, eta_slope, w)
            for p, x_slope, eta_slope, w in zip(points, *by_size, by_omega, strict=True)
        ]
    )


def _slope(values: np.ndarray, size: np.ndarray, order: np.ndarray) -> np.ndarray:
    """d / d ln A of coefficients (n_point, ..., n_coeff); those that vibrate are nearly proportional to A."""
    scale = np.where(order == 0, 1.0, np.exp(size)[:, None]).reshape(len(size), *[1] * (values.ndim - 2), len(order))
    shape = values / scale
    return scale * np.gradient(shape, size, axis=0, edge_order=2) + np.where(order == 0, 0.0, values)


class _Marched:
    """The law of a problem's contact, marched through falling cycles."""

    def __init__(self, problem: FreeVibration):
        balance = problem.balance
        joint = balance.contact.merge("the decrement of a free decay")
        components = joint.parameters.components
        normal = components.index("n") if "n" in components else -1
        self._contact = coupled_pairs.Contact(joint.parameters.packed(), joint.parameters.gap, normal, np.zeros((1, 1)))
        self._law = compiled_law.pointer(joint.module.step)
        self._problem, self._memory = problem, balance.memory
        self._k = problem.k.reshape(problem.rest_x.shape[:2])
        n = problem.basis.n_samples
        self._angle = 2 * np.pi * np.arange(1, n + 1) / n

    def rate(self, p: ModePoint, x_slope: np.ndarray, eta_slope: np.ndarray, omega_slope: float) -> float:
        """The decrement over 2 pi at one point of the backbone."""
        problem, basis = self._problem, self._problem.basis
        start, eta = basis.functions(np.zeros(())), basis.to_real(p.eta)
        motion, shape = eta @ start, eta_slope @ start
        speed = eta @ basis.rate @ start
        by_size = p.omega * speed @ (p.omega * eta_slope @ basis.rate @ start + omega_slope * speed)
        preload = problem.modes[0].lam * motion - problem.static_load
        by_size += preload @ shape  # d / d ln A of the stuck structure's energy
        quarter = eta @ basis.rate
        weight = np.where(basis.order == 0, 1.0, 0.5)
        dashpots = 2 * np.pi * p.omega * float(np.sum(weight * quarter * (problem.modes[0].damping @ quarter)))
        level = self._loss(p.x, x_slope, 0.0)
        fall = max(abs(p.zeta), LEAST)
        released = (self._loss(p.x, x_slope, fall) - level) / fall
        return float((dashpots + level) / (2 * np.pi * by_size - released))

    def _loss(self, x: np.ndarray, x_slope: np.ndarray, fall: float) -> float:
        """Work that the departure g takes in one period [J] while ln A falls through its value by 2 pi fall.

        One more falling period goes before it, and before that one as many periodic ones as memory needs."""
        basis = self._problem.basis
        angle = np.concatenate([self._angle - 2 * np.pi, self._angle])
        functions = basis.functions(angle)
        drop = -fall * (angle - np.pi)
        falling = np.einsum("pcm,tm->tpc", x, functions) + np.einsum("pcm,tm,t->tpc", x_slope, functions, drop)
        before = np.einsum("pcm,tm->tpc", x + 3 * np.pi * fall * x_slope, functions[: len(self._angle)])
        memory, bits = time_step.memory_after(self._law, np.ascontiguousarray(before), self._contact, self._memory)
        forces = np.empty_like(falling)
        time_step.along(self._law, self._contact, before[-1], falling, memory, bits, forces, np.empty((0, 0, 0, 0)))
        g, path = (series[len(self._angle) - 1 :] for series in (self._k * falling - forces, falling))
        return -0.5 * float(np.sum((g[1:] + g[:-1]) * np.diff(path, axis=0)))
