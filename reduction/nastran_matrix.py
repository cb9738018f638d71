"""Nastran matrices: OUTPUT4 files (.op4), in ASCII and binary, and DMIG entries of bulk data and punch files.

An OUTPUT4 file holds several named matrices, column by column: a run of rows for each column, or strings of rows where
it is sparse. A DMIG entry labels its rows by grid point and component; scalar points have component 0."""

import codecs
import re
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import numpy as np
import scipy.sparse as sp

from tribodyn.geometry.sources.nastran_cards import cards_of, lines_of
from tribodyn.reduction.abaqus_matrix import Labels
from tribodyn.reduction.harwell_boeing import number
from tribodyn.refusal import Refusal
from tribodyn.text_file import open_text

DECKS = (".pch", ".bdf", ".nas", ".dat", ".dmig")

Column = tuple[int, int, np.ndarray]
Matrix = tuple[str, tuple[int, int], int, Iterator[Column]]


def read_op4(path: Path) -> dict[str, sp.csr_matrix]:
    """All matrices of an OUTPUT4 file by name, real or complex, in the order of the file.

    Raises  Refusal for a file that is not one, or ends early
    Source  MSC Nastran, DMAP Programmer's Guide, module OUTPUT4, remarks on the formats of its files"""
    data = path.read_bytes().removeprefix(codecs.BOM_UTF8)
    order = {b"\x18\0\0\0": "<", b"\x30\0\0\0": "<", b"\0\0\0\x18": ">", b"\0\0\0\x30": ">"}.get(data[:4])
    matrices = {}
    try:
        for name, shape, kind, columns in _ascii(data) if order is None else _binary(data, order):
            rows, cols, values = [np.zeros(0, int)], [np.zeros(0, int)], [np.zeros(0)]
            for column, row, string in columns:
                matrix_name = string if kind < 3 else string.view(complex)
                rows.append(np.arange(row - 1, row - 1 + len(matrix_name)))
                cols.append(np.full(len(matrix_name), column - 1))
                values.append(matrix_name)
            entries = np.concatenate(values), (np.concatenate(rows), np.concatenate(cols))
            matrices[name] = sp.csr_matrix(sp.coo_matrix(entries, shape=shape))
    except (ValueError, IndexError, StopIteration, OverflowError, RuntimeError):
        raise Refusal(f"{path.name} is no OUTPUT4 file, or ends early: export it again with OUTPUT4") from None
    if not matrices:
        raise Refusal(f"{path.name} holds no matrix: export it again with OUTPUT4")
    return matrices


def _binary(data: bytes, order: str) -> Iterator[Matrix]:
    """Matrices of Fortran records, with words of four or of eight bytes."""
    at = 0
    word = 4 if data[0] + data[3] == 24 else 8
    integers = np.dtype(f"{order}i{word}")

    def record() -> bytes:
        nonlocal at
        size = int(np.frombuffer(data, f"{order}i4", 1, at)[0])
        if size < 0 or data[at : at + 4] != data[at + 4 + size : at + 8 + size]:
            raise Refusal("a record without its end")
        at += 8 + size
        return data[at - 4 - size : at - 4]

    def columns(n_column: int, real: np.dtype, big: bool) -> Iterator[Column]:
        while True:
            body = record()
            column, row, count = (int(i) for i in np.frombuffer(body, integers, 3))
            if column > n_column:
                return
            place = 3 * word
            end = place + count * word
            if len(body) < end:
                raise Refusal("a column that is shorter than announced")
            if row > 0:
                yield column, row, np.frombuffer(body[place:end], real).astype(float)
                continue
            while place < end:
                head = np.frombuffer(body, integers, 2 if big else 1, place).astype(int)
                length, row = _string(*head)
                place += len(head) * word
                yield column, row, np.frombuffer(body[place : place + length * word], real).astype(float)
                place += length * word

    while at < len(data):
        head = record()
        n_column, n_row, _, kind = (int(i) for i in np.frombuffer(head, integers, 4))
        name = head[4 * word :].decode("ascii", "replace").replace(" ", "").strip("\0")
        real = np.dtype(f"{order}f{8 if word == 8 or kind in (2, 4) else 4}")
        yield name.upper(), (abs(n_row), n_column), kind, columns(n_column, real, _is_big(n_row))


def _ascii(data: bytes) -> Iterator[Matrix]:
    """Matrices of fixed fields: eight columns for whole numbers, the width of the file's own format for reals."""
    lines = iter(data.decode("ascii", "replace").splitlines())

    def reals(count: int, per_line: int, width: int) -> np.ndarray:
        position = [next(lines) for _ in range(-(-count // per_line))]
        words = [line[i : i + width] for line in position for i in range(0, min(per_line * width, len(line)), width)]
        if len(words) < count:
            raise Refusal("a column that is shorter than announced")
        return np.array([number(word.strip()) for word in words[:count]])

    def columns(n_column: int, words: int, big: bool, layout: tuple[int, int]) -> Iterator[Column]:
        while True:
            line = next(lines)
            column, row, count = (int(line[i : i + 8]) for i in (0, 8, 16))
            if column > n_column:
                reals(1, *layout)
                return
            if row > 0:
                yield column, row, reals(count, *layout)
                continue
            while count > 0:
                line = next(lines)
                head = [int(line[:8]), int(line[8:16])] if big else [int(line)]
                length, row = _string(*head)
                count -= length + len(head)
                yield column, row, reals(length // words, *layout)

    for line in lines:
        if not line.strip():
            continue
        n_column, n_row, _, kind = (int(line[i : i + 8]) for i in (0, 8, 16, 24))
        layout = re.search(r"(\d*)[ED](\d+)\.", line[40:].upper())
        sizes = (int(layout[1] or 1), int(layout[2])) if layout else (5, 16)
        words = 2 if kind in (2, 4) else 1
        name = line[32:40].strip().upper()
        yield name, (abs(n_row), n_column), kind, columns(n_column, words, _is_big(n_row), sizes)


def _is_big(n_row: int) -> bool:
    return n_row < 0 or n_row > 65535


def _string(first: int, row: int | None = None) -> tuple[int, int]:
    """Length in words and first row of a string, from its one packed word, or from its two of a BIGMAT."""
    length, row = (first - 1, row) if row is not None else ((first >> 16) - 1, first & 65535)
    if length < 1:
        raise Refusal("a string without length")
    return length, row


def holds_dmig(path: Path) -> bool:
    """Whether a text has DMIG entries: near its beginning, or anywhere where its ending is that of bulk data."""
    with open_text(path) as stream:
        text = path.suffix.lower() in DECKS
        return any(line[:4].upper() == "DMIG" for k, line in enumerate(stream) if text or k < 50)


def read_dmig(path: Path) -> dict[str, Callable[[], tuple[sp.csr_matrix, Labels]]]:
    """The matrices of DMIG entries by name, each with what reads it: matrix and (grid, component) of its rows.

    Raises  Refusal: an entry that contradicts itself; what reads one also for rectangular and complex matrices
    Source  MSC Nastran, Quick Reference Guide, bulk data entry DMIG"""
    heads: dict[str, list[str]] = {}
    columns: dict[str, list[list[str]]] = {}
    for card, fields in cards_of(lines_of(path)):
        if card != "DMIG":
            continue
        name = fields[0].upper()
        if fields[1].strip() == "0":
            heads[name] = fields
        elif name in heads:
            columns.setdefault(name, []).append(fields)
        else:
            raise Refusal(f"{path.name} has columns of DMIG {name} before its first entry, DMIG {name} 0: repair it")
    return {name: partial(_square, name, head, columns.get(name, []), path) for name, head in heads.items()}


def _square(name: str, head: list[str], columns: list[list[str]], path: Path) -> tuple[sp.csr_matrix, Labels]:
    """A square DMIG matrix; of a symmetric one either triangle is given."""
    where = f"DMIG {name} of {path.name}"
    form, kind = ([*head, "", ""][2] or "6"), ([*head, "", "", ""][3] or "1")
    if form not in ("1", "6"):
        raise Refusal(f"{where} has form {form}: only square (1) and symmetric (6) matrices are read")
    if kind not in ("1", "2"):
        raise Refusal(f"{where} has type {kind}: real numbers are needed (1 or 2)")
    pairs: list[tuple[tuple[int, int], tuple[int, int]]] = []
    values: list[float] = []
    try:
        for fields in columns:
            column = int(fields[1]), int(fields[2] or 0)
            for k in range(4, len(fields) - 2, 4):
                if fields[k]:
                    pairs.append(((int(fields[k]), int(fields[k + 1] or 0)), column))
                    values.append(number(fields[k + 2]))
    except (ValueError, IndexError):
        raise Refusal(f"{where} has fields that are not numbers: export it again") from None
    if not pairs:
        raise Refusal(f"{where} has no entries: export it again")
    if len({frozenset(pair) if form == "6" else pair for pair in pairs}) < len(pairs):
        raise Refusal(f"{where} gives an entry twice: export it again")
    labels = tuple(sorted({label for pair in pairs for label in pair}))
    place = {label: k for k, label in enumerate(labels)}
    rows, cols = np.array([[place[row], place[column]] for row, column in pairs]).T
    matrix = sp.coo_matrix((values, (rows, cols)), shape=(len(labels),) * 2).tocsr()
    if form == "6":
        matrix = (matrix + matrix.T - sp.diags(matrix.diagonal())).tocsr()
    return matrix, labels
