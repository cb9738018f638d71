"""What a contact answers to a growing or decaying perturbation of a periodic motion, by the memory of its law.

To dx(t) = exp(lambda t) p(t), p periodic, a law answers with exp(lambda t) q(t). A slider remembers where it came to
rest, when the perturbation had another phase, so that q depends on lambda. At lambda = 0, where Hill's method takes it,
it feeds modes far above the vibration with energy that they do not get."""

from collections.abc import Callable

import numpy as np

from tribodyn.hbm.balance import HarmonicBalance, State
from tribodyn.hbm.contact import compiled_law
from tribodyn.hbm.time import coupled_pairs, time_step

STEPS = 256  # of a period
MOST_MEMORY = 10  # numbers that a pair remembers; the linearised steps of laws with more fill the memory


def answer_of(balance: HarmonicBalance, state: State, top: int) -> Callable[[complex], np.ndarray] | None:
    """Derivative of g = k x - f (n_pair, c, nc, c, nc) on the amplitudes of exp((rate + i k) w t), |k| <= top, by rate.

    None for a law without a memory, on which nothing depends, or with much of it
    Raises  ValueError for several laws"""
    joint = balance.contact.merge("stability")
    parameters, memory = joint.parameters, balance.memory
    if not 0 < memory.shape[1] <= MOST_MEMORY:
        return None
    normal = parameters.components.index("n") if "n" in parameters.components else -1
    contact = coupled_pairs.Contact(parameters.packed(), parameters.gap, normal, np.zeros((1, 1)))
    law, (n_pair, c, _), n_state = compiled_law.pointer(joint.module.step), state.x.shape, memory.shape[1]
    angle, nc = 2 * np.pi * np.arange(1, STEPS + 1) / STEPS, 2 * top + 1
    x = np.ascontiguousarray((state.x @ balance.basis.functions(angle).T).transpose(2, 0, 1))
    memory, bits = time_step.memory_after(law, x, contact, memory)
    slopes = np.zeros((STEPS, n_pair, c + n_state, 2 * c + n_state))
    time_step.along(law, contact, x[-1], x, memory, bits, x[:0], slopes)
    of_x, of_s, of_x0 = np.split(slopes, [c, c + n_state], axis=3)
    waves = np.exp(1j * np.outer(angle, np.arange(-top, top + 1)))
    p = np.kron(np.eye(c), waves[:, None]).reshape(STEPS, 1, c, c * nc)
    stuck = np.einsum("pa,ab,km->pakbm", balance.compliance.k.reshape(n_pair, c), np.eye(c), np.eye(nc))

    def departure(rate: complex) -> np.ndarray:
        turn = np.exp(-rate * 2 * np.pi / STEPS)
        driven = of_x @ p + turn * (of_x0 @ np.roll(p, 1, axis=0))
        passed_on = turn * of_s
        remembered = np.zeros((STEPS + 1, n_pair, n_state, c * nc + n_state), complex)  # from no memory, and of one
        remembered[0, :, :, c * nc :] = np.eye(n_state)
        for j in range(STEPS):
            np.matmul(passed_on[j, :, c:], remembered[j], out=remembered[j + 1])
            remembered[j + 1, :, :, : c * nc] += driven[j, :, c:]
        s, of_one = remembered[..., : c * nc], remembered[..., c * nc :]
        # as a period before; a slider that rests does so
        first = np.linalg.pinv(np.eye(n_state) - of_one[-1], rcond=1e-9) @ s[-1]
        now = driven[:, :, :c] + passed_on[:, :, :c] @ (s[:-1] + of_one[:-1] @ first)
        force = np.tensordot(waves.conj(), now, (0, 0)).transpose(1, 2, 0, 3)
        return stuck - force.reshape(n_pair, c, nc, c, nc) / STEPS

    return departure
