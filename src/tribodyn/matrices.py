"""One's own matrices: read, held by contacts, reduced, balanced, followed, integrated and worn; see `td.__doc__`."""

from tribodyn.reduction.foreign import ForeignMatrices as Matrices, from_arrays, read_matrices as read
from tribodyn.workflows.studies.matrix_balance import Cycle, HertzBalance as Balance
from tribodyn.workflows.studies.matrix_structure import MatrixContact as Contact, Structure, reduce, wear_law

__all__ = ["Balance", "Contact", "Cycle", "Matrices", "Structure", "from_arrays", "read", "reduce", "wear_law"]
