"""What the modes that a reduction leaves out carry: its full field, one step nearer to that of the full matrices.

The shapes of the reduced coordinates are exact at rest. At a frequency w their field u leaves in the equations of the
DOFs that are no masters

    r = f - K u + w^2 M u.

Of its part in the retained shapes Phi the damping takes hold. The other part belongs to modes left out, which are stiff
at w and move by K^-1 (r - M Phi Phi^T r) with the masters held, right to the square of w over the first frequency left
out. Without it displacement converges with the modes, and stress, which counts high modes more, hardly does. Outputs,
and with them the stress at named places, do not change: their static shapes are among the coordinates.
Source  mode acceleration: Cornwell, Craig and Johnson, Earthq. Eng. Struct. Dyn. 11 (1983) 679"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Self

import numpy as np
from scipy.sparse import csr_matrix, eye_array
from threadpoolctl import threadpool_limits

from tribodyn.fem.constraints import partition
from tribodyn.fem.factor import Factor, factorise
from tribodyn.fem.system import SecondOrderSystem
from tribodyn.reduction.model import ReducedModel, ReductionBasis


@dataclass(frozen=True, eq=False)
class OmittedModes:
    """system : full, n DOFs; moves : (n, n_s) displacement of these by DOFs that are no masters, with the masters held
    shapes : (n_s, k) Phi, of unit modal mass"""

    system: SecondOrderSystem
    moves: csr_matrix
    shapes: np.ndarray

    @classmethod
    def of(cls, model: ReducedModel, system: SecondOrderSystem) -> Self | None:
        """Those of a model that was reduced from a full system in its own DOFs; None where its coordinates are others,
        as of a wheel, relative ones, with interface modes, or without contact masters."""
        origin, coordinates = model.origin, model.system.n_dof
        if model.is_wave or not isinstance(origin, ReductionBasis) or origin.n_interface_modes or not origin.n_modes:
            return None
        slaves, masters = partition(system.n_dof, origin.masters, "master")
        if np.any(origin.basis[masters, : len(masters)] != np.eye(len(masters))):
            return None
        shapes, back = origin.basis[slaves, len(masters) :], csr_matrix(eye_array(system.n_dof))
        unit = np.array_equal(model.system.mass[len(masters) :, len(masters) :], np.eye(coordinates - len(masters)))
        return cls(system, csr_matrix(back[:, slaves]), shapes) if len(masters) and unit else None

    @cached_property
    def mass(self) -> Any:
        """(n_s, n_s) with the masters held."""
        return self.moves.T @ self.system.mass @ self.moves

    @cached_property
    def factor(self) -> Factor:
        """Of the stiffness with the masters held; it does not travel between processes, each makes its own."""
        return factorise(self.moves.T @ self.system.stiffness @ self.moves)

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in self.__dict__.items() if name != "factor"}

    def displacement(self, u: np.ndarray, force: np.ndarray, omega: np.ndarray) -> np.ndarray:
        """What fields u (n, k) of frequencies omega (k,) [rad/s] under loads force (n, k) [N] lack (n, k) [m], complex.

        Forces of the contact are left out of the loads: they act on masters"""
        residual = self.moves.T @ (force - self.system.stiffness @ u + self.system.mass @ (u * omega**2))
        residual -= self.mass @ (self.shapes @ (self.shapes.T @ residual))
        with threadpool_limits(1):
            real, imaginary = np.hsplit(self.factor.solve(np.hstack([residual.real, residual.imag])), 2)
        return np.asarray(self.moves @ (real + 1j * imaginary))
