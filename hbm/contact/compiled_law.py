"""Compiled contact laws: their `step` as a function pointer, and kernels whose callees stand in other files.

Kernels that take the pointer as an argument are compiled once for every law, and numba keeps them on disk. With the
law itself as their argument they would be compiled anew for every law in every process, some seconds each."""

from collections.abc import Callable
from contextlib import suppress
from functools import cache
from hashlib import sha256
from pathlib import Path
from types import ModuleType
from typing import Any

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


def stamp_with(names: dict[str, Any], *modules: ModuleType) -> None:
    """Let numba compile the cached kernels of a file again after an edit of the modules that they call.

    numba takes what it keeps on disk for valid as long as the kernel's own file has not changed.
    names : `globals()` at the end of the file"""
    digests = tuple(sha256(Path(str(module.__file__)).read_bytes()).digest() for module in modules)
    for kernel in names.values():
        cache_file = getattr(getattr(kernel, "_cache", None), "_cache_file", None)
        if cache_file is not None and kernel.__module__ == names["__name__"]:
            cache_file._source_stamp = (cache_file._source_stamp, *digests)
