"""Harwell-Boeing matrices, as ANSYS writes them with HBMAT (ASCII), and the mapping file beside them."""

import re
from pathlib import Path

import numpy as np
import scipy.sparse as sp

from tribodyn.refusal import Refusal
from tribodyn.text_file import text_of

COMPONENT_NAMES = ("UX", "UY", "UZ", "ROTX", "ROTY", "ROTZ")
"""ANSYS names of the degrees of freedom 1 to 6."""

_HEADER = re.compile(r"[RCP][SUHZR][AE]\s+\d+\s+\d+\s+\d+", re.IGNORECASE)
_FORTRAN = re.compile(r"(\d*)\s*[IEDFG]\s*(\d+)", re.IGNORECASE)
_NO_EXPONENT_LETTER = re.compile(r"(?<=[\d.])([+-]\d+)$")


def looks_like(lines: list[str]) -> bool:
    """Whether the first lines of a text are a Harwell-Boeing header."""
    return len(lines) > 3 and _HEADER.match(lines[2].strip()) is not None


def read(path: Path) -> sp.csr_matrix:
    """Read an assembled real matrix; symmetric storage (RSA) is mirrored.

    Raises  Refusal: complex, pattern or unassembled matrices, a truncated file
    Source  Duff, Grimes and Lewis, Users' guide for the Harwell-Boeing sparse matrix collection, 1992"""
    lines = text_of(path).splitlines()
    if not looks_like(lines):
        raise Refusal(f"{path.name} has no Harwell-Boeing header: export it with HBMAT in ASCII form")
    try:
        counts = [int(word) for word in lines[1].split()]
    except ValueError:
        raise Refusal(f"{path.name} counts its lines as '{lines[1].strip()}': whole numbers are expected") from None
    kind, n_row, n_column, n_entry = lines[2].split()[:4]
    kind = kind.upper()
    if kind[0] != "R" or kind[1] not in "SUR" or kind[2] != "A":
        raise Refusal(f"{path.name} holds a matrix of type {kind}: only real assembled ones (RSA, RUA) can be read")
    first = 5 if len(counts) > 4 and counts[4] > 0 else 4  # one more header line where a right-hand side follows
    ends = np.cumsum([first, *counts[1:4]])
    if len(lines) < ends[-1]:
        raise Refusal(f"{path.name} ends after {len(lines)} of {ends[-1]} lines: export the matrix again")
    layouts, sizes = _formats(lines[3], path), (int(n_column) + 1, int(n_entry), int(n_entry))
    pointer, index, value = (
        _fields(lines[ends[k] : ends[k + 1]], layout, size)
        for k, (layout, size) in enumerate(zip(layouts, sizes, strict=True))
    )
    try:
        matrix = sp.csc_matrix(
            (
                np.array([number(word) for word in value]),
                np.array(index, dtype=np.int64) - 1,
                np.array(pointer, dtype=np.int64) - 1,
            ),
            shape=(int(n_row), int(n_column)),
        )
        matrix.check_format()
    except ValueError:
        raise Refusal(
            f"{path.name} does not hold the {n_entry} entries in {n_column} columns that its header announces: "
            "export the matrix again"
        ) from None
    if kind[1] != "S":
        return matrix.tocsr()
    if sp.tril(matrix, -1).nnz and sp.triu(matrix, 1).nnz:
        raise Refusal(f"{path.name} is declared symmetric but stores both triangles: export it as RUA")
    return (matrix + matrix.T - sp.diags(matrix.diagonal())).tocsr()


def read_mapping(path: Path) -> tuple[tuple[int, int], ...]:
    """(node, component 1..6) of each equation, from the .mapping file that HBMAT writes on request.

    A list of one's own in its form, equation, node and component (UX or 1), is taken too.
    Raises  Refusal: no such file, no mapping file"""
    if not path.is_file():
        raise Refusal(f"there is no mapping file {path}: check the name and the folder")
    rows: dict[int, tuple[int, int]] = {}
    for line in text_of(path).splitlines():
        words = line.split()
        if len(words) == 3 and words[0].isdigit() and words[1].isdigit():
            name = COMPONENT_NAMES[int(words[2]) - 1] if words[2] in "123456" else words[2].upper()
            if name not in COMPONENT_NAMES:
                raise Refusal(
                    f"{path.name} maps equation {words[0]} to {name}: only {', '.join(COMPONENT_NAMES)} are structural"
                )
            rows[int(words[0])] = (int(words[1]), COMPONENT_NAMES.index(name) + 1)
    if sorted(rows) != list(range(1, len(rows) + 1)) or not rows:
        raise Refusal(f"{path.name} does not list equations 1, 2, 3 ... with node and DOF: is it a mapping file?")
    return tuple(rows[k] for k in sorted(rows))


def _formats(line: str, path: Path) -> list[tuple[int, int]]:
    """(fields per line, width) of pointers, indices and values from Fortran formats such as (8I10) or (1P,3E25.16)."""
    field_match = [_FORTRAN.search(bracket) for bracket in re.findall(r"\(([^)]*)\)", line)]
    if len(field_match) < 3 or None in field_match[:3]:
        raise Refusal(f"{path.name} gives its formats as '{line.strip()}': three Fortran formats are expected")
    return [(int(match[1] or 1), int(match[2])) for match in field_match[:3] if match]


def _fields(lines: list[str], layout: tuple[int, int], size: int) -> list[str]:
    """The words of a block, by blanks where that gives the right number, else by width.

    Fortran may leave no blank between fields; and some writers, scipy's among them, break the width they announce."""
    words = " ".join(lines).split()
    if len(words) == size:
        return words
    per_line, width = layout
    fields = (line[k * width : (k + 1) * width].strip() for line in lines for k in range(per_line))
    return [field for field in fields if field]


def number(word: str) -> float:
    """A Fortran real, also 1.5D+03 and 1.5-103."""
    word = word.upper().replace("D", "E")
    return float(word if "E" in word else _NO_EXPONENT_LETTER.sub(r"E\1", word))
