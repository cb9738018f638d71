"""Columns of a MATLAB file, read by scipy, which a damaged file can crash: called in a child process."""

from typing import Any

import numpy as np

from tribodyn.refusal import Refusal


def content(path: str) -> dict[str, Any]:
    """Numbers as arrays, texts and cells of texts as such, structs as dicts; other kinds are left out.

    Raises  Refusal"""
    from scipy.io import loadmat

    try:
        variables = loadmat(path, simplify_cells=True)
    except NotImplementedError:
        raise Refusal("MATLAB files of version 7.3 are not read: save it with -v7") from None
    except Exception as error:  # scipy's reader raises whatever a damaged file makes
        raise Refusal(f"no MATLAB file ({error}): save it again") from None
    return _plain({name: value for name, value in variables.items() if not name.startswith("__")})


def _plain(table: dict[str, Any]) -> dict[str, Any]:
    columns: dict[str, Any] = {}
    for name, value in table.items():
        array = np.asarray(value)
        if isinstance(value, dict):
            columns[name] = _plain(value)
        elif isinstance(value, str):
            columns[name] = value
        elif array.dtype.kind in "biufcU":
            columns[name] = np.atleast_1d(array)
        elif array.dtype.kind == "O" and all(isinstance(item, str) for item in array.flat):
            columns[name] = [*array.flat]
    return columns
