"""One matrix out of a file that another program wrote: the format is recognised by content."""

import contextlib
import io
import re
import zipfile
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import scipy.io
import scipy.sparse as sp
from scipy.io.matlab import MatReadError

from tribodyn.hdf5_file import opened_hdf5
from tribodyn.reduction import abaqus_matrix, harwell_boeing, nastran_matrix
from tribodyn.reduction.abaqus_matrix import Labels
from tribodyn.refusal import Refusal
from tribodyn.text_file import open_text, text_of

MATRIX_MARKET = "%%MatrixMarket"
NUMBERS = b"0123456789+-.eE \t\r\nnNaAiIfFtTyY"  # what numbers are written with, nan and infinity too


def variables(path: Path) -> list[str]:
    """Names of what a container holds; an empty list for a file that is one matrix (also scipy.sparse.save_npz)."""
    _require(path)
    with _as_one_sentence(path):
        if path.suffix.lower() == ".npz":
            with _opened_npz(path) as archive:
                return [] if "format" in archive.files else sorted(archive.files)
        if path.suffix.lower() == ".mat":
            if h5py.is_hdf5(path):
                with opened_hdf5(path) as archive:
                    return sorted(name for name in archive if not name.startswith("#"))
            try:
                return sorted(name for name, _, _ in scipy.io.whosmat(path))
            except (ValueError, TypeError, OSError):
                raise Refusal(f"{path.name} is not a MATLAB file: write it with save") from None
        if path.suffix.lower() == ".op4":
            return list(nastran_matrix.read_op4(path))
        if nastran_matrix.holds_dmig(path):
            return list(nastran_matrix.read_dmig(path))
    return []


def read_matrix(path: Path, variable: str | None = None) -> tuple[sp.csr_matrix, Labels | None]:
    """Read a real matrix, and the (node, component) labels of its rows where the file has them.

    path : .npz (numpy or scipy.sparse), .mat (also version 7.3), Nastran .op4 or DMIG, Matrix Market, Harwell-Boeing,
        Abaqus text
    variable : its name in a container
    Raises  Refusal: no such file or variable, an unknown format, complex or non-finite entries"""
    suffixes = variables(path)
    labels = None
    if variable is not None and suffixes and variable not in suffixes:
        raise Refusal(f"{path.name} has no variable '{variable}': it holds {', '.join(suffixes)}")
    if suffixes and variable is None:
        raise Refusal(f"{path.name} holds {', '.join(suffixes)}: name the variable that is wanted")
    with _as_one_sentence(path):
        if path.suffix.lower() == ".npz":
            matrix = _from_npz(path, variable)
        elif path.suffix.lower() == ".mat":
            matrix = _from_mat(path, str(variable))
        elif path.suffix.lower() == ".op4":
            matrix = nastran_matrix.read_op4(path)[str(variable)]
        elif suffixes:
            matrix, labels = nastran_matrix.read_dmig(path)[str(variable)]()
        else:
            matrix, labels = _from_text(path)
    return real(matrix, f"{path.name} {variable or ''}".strip()), labels


def read_array(path: Path, variable: str) -> np.ndarray:
    """A named array of real numbers, such as a list of DOFs, out of a container; raises Refusal."""
    suffixes = variables(path)
    if variable not in suffixes:
        raise Refusal(f"{path.name} has no variable '{variable}': it holds {', '.join(suffixes) or 'one matrix alone'}")
    with _as_one_sentence(path):
        if path.suffix.lower() not in (".npz", ".mat"):
            arrays = read_matrix(path, variable)[0]
        else:
            arrays = _from_npz(path, variable) if path.suffix.lower() == ".npz" else _from_mat(path, variable)
    array = arrays.toarray() if sp.issparse(arrays) else np.asarray(arrays)
    if array.dtype.kind not in "fiub" or not np.isfinite(array).all():
        raise Refusal(f"{path.name} {variable} must hold finite real numbers")
    return array.astype(float)


@contextlib.contextmanager
def _as_one_sentence(path: Path) -> Iterator[None]:
    """What readers of several libraries raise for broken files, as one sentence."""
    try:
        yield
    except (LookupError, TypeError, EOFError, OSError, RuntimeError, MatReadError, zipfile.BadZipFile, zlib.error):
        raise Refusal(f"{path.name} is broken, it ends early or contradicts itself: export it again") from None


def _from_npz(path: Path, variable: str | None) -> Any:
    if variable is None or variable not in variables(path):
        return sp.load_npz(path)
    with _opened_npz(path) as archive:
        return archive[variable]


def _opened_npz(path: Path) -> Any:
    if not zipfile.is_zipfile(path):
        raise Refusal(f"{path.name} is not a numpy archive: write it with numpy.savez or scipy.sparse.save_npz")
    return np.load(path)


def _from_mat(path: Path, variable: str) -> Any:
    if not h5py.is_hdf5(path):
        return scipy.io.loadmat(path, variable_names=[variable])[variable]
    with opened_hdf5(path) as archive:
        item = archive[variable]
        if isinstance(item, h5py.Group):  # sparse in version 7.3: compressed columns, rows counted from 0
            columns = np.asarray(item["jc"])
            shape = (int(item.attrs["MATLAB_sparse"]), len(columns) - 1)
            if "data" not in item:
                return sp.csc_matrix(shape)
            return sp.csc_matrix((np.asarray(item["data"]), np.asarray(item["ir"]), columns), shape=shape)
        return np.asarray(item).T


def _from_text(path: Path) -> tuple[Any, Labels | None]:
    with open_text(path) as stream:
        head = [line for _, line in zip(range(50), stream, strict=False)]
    if head and head[0].startswith(MATRIX_MARKET):
        return _from_matrix_market(path), None
    if harwell_boeing.looks_like(head):
        return harwell_boeing.read(path), None
    if abaqus_matrix.looks_like(head):
        return abaqus_matrix.read(path)
    raise Refusal(
        f"{path.name} is in no format known here: give .npz, .mat, Matrix Market, Harwell-Boeing (ASCII) or Abaqus text"
    )


def _from_matrix_market(path: Path) -> Any:
    """A Matrix Market file by scipy's reader, which takes 1.0D3 for 1.0: no such number, no other count than announced.

    Raises  Refusal: complex or pattern matrices, a file that is not what it announces
    Source  Boisvert, Pozo and Remington, The Matrix Market exchange formats, NISTIR 5935, 1996"""
    content = text_of(path).encode()
    try:
        n_row, _, entries, kind, field, symmetry = scipy.io.mminfo(io.BytesIO(content))
        if field not in ("real", "double", "integer", "unsigned-integer") or symmetry == "hermitian":
            raise Refusal(f"{path.name} holds a {field} {symmetry} matrix: real numbers are needed")
        # what follows the line with the sizes, the first that is neither empty nor a comment
        body = re.sub(rb"(?:[^\S\n]*(?:%.*)?\n)*.*\n?", b"", content, count=1)
        if kind == "array" and symmetry != "general":
            entries = n_row * (n_row + (1 if symmetry == "symmetric" else -1)) // 2
        if body.translate(None, NUMBERS):
            raise Refusal("its numbers are not written as 1.0E+03")
        if sum(1 for line in body.splitlines() if line.strip()) != entries:
            raise Refusal(f"it has not the {entries} entries that it announces")
        return scipy.io.mmread(io.BytesIO(content))
    except (ValueError, OverflowError) as problem:
        if str(problem).startswith(path.name):
            raise
        raise Refusal(f"{path.name} is a broken Matrix Market file: {' '.join(str(problem).split())}") from None


def _require(path: Path) -> None:
    if not path.is_file():
        raise Refusal(f"there is no file {path}: check the name and the folder")
    ways = {
        ".sub": "in Ansys, *DMAT, K, D, IMPORT, SUB, FILE, STIFF and *EXPORT, K, MMF, k.mtx, and likewise for MASS",
        ".op2": "in Nastran, EXTSEOUT(STIFFNESS, MASS, DMIGPCH), or the matrices by OUTPUT4",
        ".sim": "in Abaqus, *MATRIX GENERATE or *SUBSTRUCTURE MATRIX OUTPUT in text (.mtx)",
    }
    way = ways.get(path.suffix.lower().replace(".dsub", ".sub"))
    if way is not None:
        raise Refusal(f"{path.name} is in a format of its program alone: export its matrices ({way})")


def real(matrix: Any, name: str) -> sp.csr_matrix:
    """Double precision compressed rows, or a ValueError for entries that cannot belong to a structure."""
    if not sp.issparse(matrix) and np.ndim(matrix) != 2:
        raise Refusal(f"{name} has {np.ndim(matrix)} dimensions: a matrix has two")
    if sp.issparse(matrix) and matrix.format in ("csr", "csc", "bsr"):
        try:
            matrix.check_format(full_check=True)  # scipy reads outside of its arrays otherwise
        except ValueError as problem:
            raise Refusal(f"{name} is broken, {problem}: export it again") from None
    rows = sp.csr_matrix(matrix)
    if rows.dtype.kind not in "fiub":
        raise Refusal(f"{name} has entries of type {rows.dtype}: real numbers are needed")
    rows = rows.astype(float)
    if not np.isfinite(rows.data).all():
        raise Refusal(f"{name} has entries that are not finite: export it again")
    return rows
