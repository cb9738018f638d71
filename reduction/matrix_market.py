"""Matrix Market files (NIST), read strictly: scipy takes missing entries of a dense one for zeros."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import scipy.sparse as sp

BANNER = "%%MatrixMarket"


def read(path: Path) -> sp.csr_matrix:
    """Read a real matrix; symmetric storage is mirrored.

    Raises  ValueError: complex or pattern matrices, a truncated file
    Source  Boisvert, Pozo and Remington, The Matrix Market exchange formats, NISTIR 5935, 1996
    """
    with path.open(encoding="ascii", errors="replace") as stream:
        banner = stream.readline().lower().split()
        if len(banner) != 5 or banner[:2] != [BANNER.lower(), "matrix"] or banner[2] not in ("coordinate", "array"):
            raise ValueError(f"{path.name} is a broken Matrix Market file: its first line is '{' '.join(banner)}'")
        kind, field, symmetry = banner[2:]
        if field not in ("real", "double", "integer") or symmetry not in ("general", "symmetric", "skew-symmetric"):
            raise ValueError(f"{path.name} holds a {field} {symmetry} matrix: real numbers are needed")
        sizes = next((line for line in stream if line.strip() and not line.startswith("%")), "").split()
        try:
            n_row, n_column, *count = (int(word) for word in sizes)
            with warnings.catch_warnings(action="ignore"):  # of no data: told below
                table = np.loadtxt(stream, comments="%", ndmin=2)
        except ValueError as problem:
            raise ValueError(f"{path.name} is a broken Matrix Market file: {' '.join(str(problem).split())}") from None
    if kind == "array":
        matrix = _dense(table, n_row, n_column, symmetry)
    else:
        matrix = _coordinates(table, n_row, n_column, count)
    if matrix is None:
        raise ValueError(f"{path.name} is a broken Matrix Market file: it has not the entries that it announces")
    if symmetry == "general":
        return matrix.tocsr()
    sign = 1 if symmetry == "symmetric" else -1
    return (matrix + sign * (matrix.T - sp.diags(matrix.diagonal()))).tocsr()


def _coordinates(table: np.ndarray, n_row: int, n_column: int, count: list[int]) -> sp.coo_matrix | None:
    """Rows of i, j, value, counted from 1; None where they are not what the sizes announce."""
    if table.size == 0:
        table = np.zeros((0, 3))
    if count != [len(table)] or table.shape[1] != 3:
        return None
    row, column = table[:, :2].T.astype(np.int64) - 1
    if len(table) and (min(row.min(), column.min()) < 0 or row.max() >= n_row or column.max() >= n_column):
        return None
    return sp.coo_matrix((table[:, 2], (row, column)), shape=(n_row, n_column))


def _dense(table: np.ndarray, n_row: int, n_column: int, symmetry: str) -> sp.csc_matrix | None:
    """Values column by column, of the lower triangle where it is symmetric; None where their number is another."""
    keep = np.tril(np.ones((n_row, n_column), bool), {"general": n_column, "symmetric": 0}.get(symmetry, -1))
    if table.size != np.count_nonzero(keep):
        return None
    whole = np.zeros((n_column, n_row))
    whole[keep.T] = table.ravel()
    return sp.csc_matrix(whole.T)
