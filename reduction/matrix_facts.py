"""Checks of foreign matrices: symmetry, and what they state about their structure."""

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from tribodyn.fem.modes import modes
from tribodyn.reduction.abaqus_matrix import Labels
from tribodyn.refusal import Refusal


@dataclass(frozen=True)
class MatrixFacts:
    """What matrices by themselves say about their structure.

    frequency : (n,) [Hz] of its lowest modes, those of rigid bodies first, which are n_rigid
    mass : [kg] moved along each of x, y, z along which it is free; empty where it is held or the rows have no labels
    remarks : doubts, one sentence each"""

    frequency: np.ndarray
    n_rigid: int
    mass: tuple[float, ...]
    remarks: tuple[str, ...]

    def lines(self) -> list[str]:
        """Sentences, the doubts as warnings."""
        elastic = ", ".join(f"{f:.5g}" for f in self.frequency[self.n_rigid :][:6])
        support = f"{self.n_rigid} rigid-body modes" if self.n_rigid else "no rigid-body mode: it is held"
        free = f", mass {' / '.join(f'{m:.5g}' for m in self.mass)} kg along its free directions" if self.mass else ""
        return [
            f"matrices: {support}{free}; first elastic modes {elastic} Hz",
            *(f"warning: {r}" for r in self.remarks),
        ]


def matrix_facts(stiffness: sp.csr_matrix, mass_matrix: sp.csr_matrix, labels: Labels | None) -> MatrixFacts:
    """Modes, mass and doubts of a structure, without damping, loads and contacts.

    Raises  Refusal where the matrices have no modes, as where the mass matrix is not positive definite"""
    K, M = stiffness, mass_matrix
    frequency = modes(K, M, min(12, stiffness.shape[0]))[0] / (2 * np.pi)
    n_rigid = int((frequency < 1e-3 * frequency[-1]).sum())
    mass: list[float] = []
    for axis in (1, 2, 3):
        translation = np.array([label[1] == axis for label in labels or ()], float)
        if translation.any() and abs(K @ translation).max() <= 1e-6 * abs(K).max():
            mass.append(float(translation @ (M @ translation)))
    remarks = []
    if n_rigid not in (0, 6):
        remarks.append(f"{n_rigid} rigid-body modes: a structure has none where it is held, and six where it is free")
    if mass and max(mass) > 1.01 * min(mass):
        each = ", ".join(f"{m:.4g}" for m in mass)
        remarks.append(f"its mass is not the same in all directions ({each} kg): rows are missing or turned")
    elastic = frequency[n_rigid] if n_rigid < len(frequency) else 0.0
    if not 1e-2 < elastic < 1e6:
        remarks.append(f"its first elastic mode is at {elastic:.3g} Hz: check that both matrices are in one system")
    if mass and not 1e-4 < mass[0] < 1e5:
        remarks.append(f"its mass is {mass[0]:.3g} kg, as in tonnes or grams: give scale, 1e3 for N, mm, t and s")
    return MatrixFacts(frequency, n_rigid, tuple(mass), tuple(remarks))


def symmetric(matrix: sp.csr_matrix, name: str, rounding: float = 1e-8, zero: bool = False) -> sp.csr_matrix:
    """The matrix, made exactly symmetric, or a Refusal that shows the worst entry.

    rounding : largest asymmetry, over the largest entry, that is rounding of the file"""
    if matrix.shape[0] != matrix.shape[1]:
        raise Refusal(f"the {name} is {matrix.shape[0]} x {matrix.shape[1]}: it must be square")
    largest = abs(matrix).max()
    if largest == 0 and not zero:
        raise Refusal(f"the {name} is zero: is it the right variable?")
    difference = abs(matrix - matrix.T).tocoo()
    if difference.nnz and difference.data.max() > rounding * largest:
        if not (sp.tril(matrix, -1).nnz and sp.triu(matrix, 1).nnz):
            raise Refusal(f"the {name} holds one triangle only: mirror it before saving, A + tril(A, -1).T")
        worst = int(difference.data.argmax())
        row, column = int(difference.row[worst]), int(difference.col[worst])
        raise Refusal(
            f"the {name} is not symmetric: entry ({row}, {column}) is {matrix[row, column]:g} "
            f"but ({column}, {row}) is {matrix[column, row]:g}"
        )
    return ((matrix + matrix.T) / 2).tocsr()
