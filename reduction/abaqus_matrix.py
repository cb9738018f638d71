"""Abaqus global matrices in text: *MATRIX GENERATE with *MATRIX OUTPUT.

Two layouts, by their columns: node, dof, node, dof, value (FORMAT=MATRIX INPUT and LABELS) and row, column, value with
rows from 1 (FORMAT=COORDINATE). Nodes that Abaqus makes itself have negative numbers."""

from pathlib import Path

import numpy as np
import scipy.sparse as sp

from tribodyn.refusal import Refusal
from tribodyn.text_file import numbers_of, text_of

Labels = tuple[tuple[int, int], ...]
"""(node, component 1..6) of each row of a matrix."""


def looks_like(lines: list[str]) -> bool:
    """Whether the first line of data holds three or five numbers."""
    for line in lines:
        if line.strip() and not line.lstrip().startswith("*"):
            return len(numbers_of(line.replace(",", " ").split()) or ()) in (3, 5)
    return False


def read(path: Path) -> tuple[sp.csr_matrix, Labels | None]:
    """Read a matrix and the labels of its rows (None in the layout without labels).

    A single triangle is mirrored. raises Refusal where lines are not numbers or indices not whole."""
    text = text_of(path).replace(",", " ")
    rows = [line for line in text.splitlines() if line.strip() and not line.lstrip().startswith("*")]
    try:
        table = np.loadtxt(rows, ndmin=2)
    except ValueError:
        raise Refusal(f"{path.name} has lines that are not numbers or not equally many: export it again") from None
    if table.shape[1] not in (3, 5):
        raise Refusal(f"{path.name} has {table.shape[1]} columns: node, dof, node, dof, value or row, column, value")
    full_matrix = (np.abs(table[:, :-1]) < 2**53) & (table[:, :-1] == np.round(table[:, :-1]))
    index = np.where(full_matrix, table[:, :-1], 0).astype(np.int64)
    if not full_matrix.all():
        raise Refusal(f"{path.name} has node, dof or row numbers that are not whole: is the last column the value?")
    labels = None
    if table.shape[1] == 5:
        symmetric = np.concatenate([index[:, :2], index[:, 2:]])
        kinds, place = np.unique(symmetric, axis=0, return_inverse=True)
        labels = tuple((int(node), int(component)) for node, component in kinds)
        row, column = place.reshape(2, -1)
        size = len(labels)
    else:
        if index.min() < 1:
            raise Refusal(f"{path.name} has row {index.min()}: rows count from 1 in FORMAT=COORDINATE")
        row, column = index.T - 1
        size = int(index.max())
    lower, above = (row > column).any(), (row < column).any()
    matrix = sp.coo_matrix((table[:, -1], (row, column)), shape=(size, size)).tocsr()
    if lower != above:
        matrix = (matrix + matrix.T - sp.diags(matrix.diagonal())).tocsr()
    return matrix, labels


def onto(matrix: sp.csr_matrix, labels: Labels, target_labels: Labels, name: str) -> sp.csr_matrix:
    """The matrix on the rows of another one; rows it lacks (a massless degree of freedom) are zero."""
    if labels == target_labels:
        return matrix
    place = {label: k for k, label in enumerate(target_labels)}
    unknown = [label for label in labels if label not in place]
    if unknown:
        node, component = unknown[0]
        raise Refusal(f"the {name} has node {node} component {component}, which the stiffness matrix lacks")
    to = np.array([place[label] for label in labels])
    entries = matrix.tocoo()
    return sp.coo_matrix((entries.data, (to[entries.row], to[entries.col])), shape=(len(target_labels),) * 2).tocsr()
