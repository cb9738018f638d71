"""The kernels of time steps, compiled in a second process while the first makes the model and its response.

numba compiles them for half a minute, once on a machine, and one kernel at a time in a process; it keeps them on disk,
where the first process finds them."""

import subprocess
import sys
from multiprocessing import parent_process

import numpy as np

from tribodyn.hbm.contact import compiled_law, contact_law
from tribodyn.hbm.contact.contact_law import ContactParameters
from tribodyn.hbm.time import coupled_pairs, time_step

_compiler: subprocess.Popen[bytes] | None = None


def start() -> None:
    """Begin to compile, unless the kernels are on disk or this process is one of a pool."""
    global _compiler
    cache_file = getattr(time_step.march._cache, "_cache_file", None)  # none where numba may not write
    if _compiler is None and parent_process() is None and cache_file is not None and not cache_file._load_index():
        command = [sys.executable, "-m", __name__]
        _compiler = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def wait() -> None:
    """Wait for what `start` has begun. Where it failed, this process compiles the kernels at their first call."""
    if _compiler is not None:
        _compiler.wait()


def compile_kernels() -> None:
    """March two steps of one mass on one pair."""
    law = contact_law.load("jenkins")
    parameters = ContactParameters.of(("t1", "t2", "n"), np.ones((1, 3)), friction=np.ones(1))
    n_state = law.n_state(parameters.components)
    step, memory = compiled_law.pointer(law.step), np.zeros((1, n_state))
    packed, gap = parameters.packed(), parameters.gap
    forgets = time_step.forgets(step, packed, gap, 2, memory)
    contact = coupled_pairs.Contact(packed, gap, 2, 1e-3 * np.eye(3), forgets, 1e-12)
    space, zero = coupled_pairs.Space.of(1, 3, n_state), np.zeros((2, 3))
    x, f, z = np.zeros((1, 3)), np.zeros((1, 3)), np.zeros(2)
    coupled_pairs.displace(contact.A, f, space.y)
    coupled_pairs.solve_contact(step, contact, zero[0], x, np.zeros(1, bool), memory, x.copy(), f, 1.0, space)
    bits = time_step.memory_after(step, x[None], contact, memory)[1]
    linear = time_step.Linear(np.eye(2), np.zeros((2, 1)), np.zeros((3, 1)), np.zeros((2, 2)), zero, 0.5)
    record = time_step.Record(
        np.zeros((2, 1, 3)), np.zeros((2, 1, 3)), np.zeros((2, 2)), np.zeros((0, 0)), bits, np.zeros((0, 1, 5, 8))
    )
    time_step.march(step, contact, linear, time_step.Moving(z, x, f, memory, bits, np.zeros(0)), record, space)


if __name__ == "__main__":
    compile_kernels()
