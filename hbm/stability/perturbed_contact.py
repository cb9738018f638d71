"""What a contact answers to a growing or decaying perturbation of a periodic motion, by the memory of its law.

To dx(t) = exp(lambda t) p(t), p periodic, a law answers with df(t) = exp(lambda t) q(t). A slider remembers where it
came to rest, at a time at which the perturbation had another phase: q depends on lambda. Hill's method takes q at
lambda = 0, which is right for a perturbation that hardly turns while a slider sticks, and feeds modes far above the
vibration with energy that they do not get.
"""

from __future__ import annotations

import numpy as np

from tribodyn.hbm.balance import HarmonicBalance, State
from tribodyn.hbm.contact import compiled_law
from tribodyn.hbm.contact.law import SEPARATES
from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.hbm.time import time_step

STEPS = 256  # of a period
LARGEST = 2e7  # numbers of the linearised steps of all pairs, above which laws with much memory are left out


class PerturbedContact:
    """The linearised steps of all pairs along the motion of a state.

    Raises  ValueError for laws without a memory, on which nothing depends, with too much of it, and for several laws
    """

    def __init__(self, balance: HarmonicBalance, state: State, basis: HarmonicBasis):
        joint = balance.contact.merged("stability")
        components = joint.parameters.components
        normal = components.index("n") if "n" in components else -1
        contact = time_step.Contact(joint.parameters.packed(), joint.parameters.gap, normal, np.zeros((1, 1)))
        law, (n_pair, c, _), n_state = compiled_law.pointer(joint.module.step), state.x.shape, balance.memory.shape[1]
        if n_state == 0 or STEPS * n_pair * (c + n_state) * (2 * c + n_state) > LARGEST:
            raise ValueError("the law has no memory, or too much of it")
        angle = 2 * np.pi * np.arange(1, STEPS + 1) / STEPS
        x = np.ascontiguousarray((state.x @ balance.basis.functions(angle).T).transpose(2, 0, 1))
        memory, bits = time_step.memory_after(law, x, contact, balance.memory)
        self._slopes = np.zeros((STEPS, n_pair, c + n_state, 2 * c + n_state))
        work = time_step.room(c, n_state)
        for j in range(STEPS):
            was_open = bits == SEPARATES
            time_step.pass_on(law, contact, x[j - 1], was_open, x[j], memory, bits, work, self._slopes[j:])
        numbers = np.arange(-basis.harmonics[-1], basis.harmonics[-1] + 1)
        self._waves = np.exp(1j * np.outer(angle, numbers))
        self._stuck = balance.compliance.k.reshape(n_pair, c)

    def departure(self, rate: complex) -> np.ndarray:
        """Derivative of g = k x - f (n_pair, c, nc, c, nc) on the amplitudes of exp((rate + i k) w t), k = -H .. H."""
        _, n_pair, width, both = self._slopes.shape
        c, nc = both - width, self._waves.shape[1]
        turn = np.exp(-rate * 2 * np.pi / STEPS)
        p = np.einsum("jk,ab->jabk", self._waves, np.eye(c)).reshape(STEPS, c, c * nc)
        of_x, of_s, of_x0 = np.split(self._slopes, [c, width], axis=3)
        driven = of_x @ p[:, None] + turn * (of_x0 @ np.roll(p, 1, axis=0)[:, None])
        memory, kept = np.zeros((n_pair, width - c, c * nc), complex), np.eye(width - c)
        for j in range(STEPS):
            memory = driven[j, :, c:] + turn * (of_s[j, :, c:] @ memory)
            kept = turn * (of_s[j, :, c:] @ kept)
        memory = np.linalg.pinv(np.eye(width - c) - kept, rcond=1e-9) @ memory  # as before a period; what rests stays
        force = np.zeros((n_pair, c, nc, c * nc), complex)
        for j in range(STEPS):
            now = driven[j] + turn * (of_s[j] @ memory)
            memory = now[:, c:]
            force += self._waves[j].conj()[:, None] * now[:, :c, None]
        found = -force.reshape(n_pair, c, nc, c, nc) / STEPS
        for a in range(c):
            for k in range(nc):
                found[:, a, k, a, k] += self._stuck[:, a]
        return found
