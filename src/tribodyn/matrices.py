"""One's own matrices: read, held by contacts, reduced, balanced, followed, integrated and worn; see `td.__doc__`."""

from tribodyn.reduction.foreign import ForeignMatrices as Matrices
from tribodyn.reduction.foreign import from_arrays
from tribodyn.reduction.foreign import read_matrices as read
from tribodyn.workflows.studies.matrices import Balance, Contact, Cycle, Structure, reduce, wear_law

__all__ = ["Balance", "Contact", "Cycle", "Matrices", "Structure", "from_arrays", "read", "reduce", "wear_law"]
