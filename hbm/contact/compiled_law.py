"""The compiled `step` of a contact law as a function pointer.

Kernels that take the pointer as an argument are compiled once for every law, and numba keeps them on disk. With the
law itself as their argument they would be compiled anew for every law in every process, some seconds each.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from functools import cache

import numba
from numba.core.errors import NumbaError

_VECTOR, _MATRIX = numba.float64[::1], numba.float64[:, ::1]
_LAW = numba.int64(_VECTOR, _VECTOR, _VECTOR, _VECTOR, _MATRIX, _MATRIX, _MATRIX, _MATRIX)


@cache
def pointer(step: Callable) -> Callable:
    """The `step` of a law as a function pointer; a law that is not compiled is given back as it is."""
    if not hasattr(step, "py_func"):
        return step
    # without numba's count of references, which takes longer than most laws, where the law makes no array; kept on disk
    # where the law lies in a file
    for options in ({"cache": True, "_nrt": False}, {"cache": True}):
        with suppress(RuntimeError, NumbaError):
            return numba.cfunc(_LAW, **options)(step.py_func)
    return numba.cfunc(_LAW)(step.py_func)
