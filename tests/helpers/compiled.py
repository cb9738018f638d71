"""Compile the kernels that most tests need, which numba then keeps on disk.

Processes that begin together would each compile them. `python -m tests.helpers.compiled` is run by `./tribodyn check`
before the documentation and the tests."""

from typing import Any

import tribodyn as td
from tribodyn.hbm.time import compile_ahead

SMALL: dict[str, Any] = {
    "geometry.n_patch": 3, "geometry.n_length": 3, "geometry.n_height": 1, "reduction.modes": 4,
    "harmonics.kept": [0, 1], "response.points": 6, "loads.harmonic.shake.value": "1 kN", "wear": None,
    "verdict.enabled": False,
}  # fmt: skip


def small_run(**more: Any) -> td.Result:
    """A response of the beam on the coarsest mesh, which keeps no file."""
    return td.run("beam", overrides=SMALL | more)


if __name__ == "__main__":
    compile_ahead.start()
    td.verify(small_run(), at=700.0)  # transitions located, and time integration
    small_run(**{"harmonics.transitions": "sampled"})
    model = td.build("beam", SMALL)
    model.balance.frequency_slope(model.balance.evaluate(5e3, model.balance.stuck(5e3)))  # as a curve near its peak
