"""Linear elastic materials: isotropic, and orthotropic or anisotropic along axes of their own."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tribodyn.geometry.sources.directions import Directions, orthogonal
from tribodyn.refusal import Refusal

VOIGT = ((0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1))


@dataclass(frozen=True)
class Material:
    """E : Young's modulus [Pa]; nu : Poisson's ratio, between -1 and 0.5; rho : density [kg/m3];
    expansion : coefficient of thermal expansion [1/K]
    elements : of 8-node hexahedra one of `elasticity.FORMULATIONS`, "" for elements of second order"""

    E: float
    nu: float
    rho: float
    expansion: float = 0.0
    elements: str = ""

    def __post_init__(self) -> None:
        if not self.E > 0:
            raise Refusal(f"material: E = {self.E} Pa is not positive; give Young's modulus in pascal")
        if not -1 < self.nu < 0.5:
            raise Refusal(f"material: nu = {self.nu} is outside -1 < nu < 0.5; metals have about 0.3")
        if not self.rho > 0:
            raise Refusal(f"material: rho = {self.rho} kg/m3 is not positive; steel has 7860")

    @property
    def lame(self) -> tuple[float, float]:
        """Lame's constants lambda, mu [Pa]."""
        return (self.E * self.nu / ((1 + self.nu) * (1 - 2 * self.nu)), self.E / (2 * (1 + self.nu)))

    def tensor(self, points: np.ndarray) -> np.ndarray:
        """Elasticity tensors (n, 3, 3, 3, 3) [Pa] at points (n, 3), all alike."""
        lam, mu = self.lame
        eye = np.eye(3)
        shear = np.einsum("ik,jl->ijkl", eye, eye) + np.einsum("il,jk->ijkl", eye, eye)
        return np.broadcast_to(lam * np.einsum("ij,kl->ijkl", eye, eye) + mu * shear, (len(points), 3, 3, 3, 3))

    def expansion_tensor(self, points: np.ndarray) -> np.ndarray:
        """Thermal strain per kelvin (n, 3, 3) [1/K] at points (n, 3), all alike."""
        return np.broadcast_to(self.expansion * np.eye(3), (len(points), 3, 3))


class _Turned:
    """What materials with axes of their own have in common; each gives its `stiffness` along them.

    axes : (2, 3) directions of the first and second material axis, made orthogonal, or directions from place to place
    """

    axes: Sequence[Sequence[float]] | Directions
    expansion: Sequence[float]

    @property
    def stiffness(self) -> np.ndarray:
        """(6, 6) [Pa] along its axes, stresses 11, 22, 33, 23, 13, 12 of strains 11, 22, 33, 2*23, 2*13, 2*12."""
        raise NotImplementedError

    @property
    def _tensor(self) -> np.ndarray:
        """Elasticity tensor (3, 3, 3, 3) [Pa] along its axes."""
        D, tensor = self.stiffness, np.empty((3, 3, 3, 3))
        for a, (i, j) in enumerate(VOIGT):
            for b, (k, l) in enumerate(VOIGT):
                tensor[i, j, k, l] = tensor[j, i, k, l] = tensor[i, j, l, k] = tensor[j, i, l, k] = D[a, b]
        return tensor

    def rotation(self, points: np.ndarray) -> np.ndarray:
        """(n, 3, 3) rows are the material axes at points (n, 3); one (1, 3, 3) where they are the same everywhere."""
        if not hasattr(self.axes, "at"):
            return orthogonal(*np.asarray(self.axes, dtype=float))[None]
        return self.axes.at(points)

    def tensor(self, points: np.ndarray) -> np.ndarray:
        """Elasticity tensors (n, 3, 3, 3, 3) [Pa] along x, y, z at points (n, 3)."""
        R = self.rotation(points)
        C = np.einsum("nai,nbj,nck,ndl,abcd->nijkl", R, R, R, R, self._tensor, optimize=True)
        return np.broadcast_to(C, (len(points), 3, 3, 3, 3))

    def expansion_tensor(self, points: np.ndarray) -> np.ndarray:
        """Thermal strain per kelvin (n, 3, 3) [1/K] along x, y, z at points (n, 3)."""
        R = self.rotation(points)
        strain = R.transpose(0, 2, 1) @ np.diag(np.asarray(self.expansion, dtype=float)) @ R
        return np.broadcast_to(strain, (len(points), 3, 3))


@dataclass(frozen=True)
class Orthotropic(_Turned):
    """A material with three planes of symmetry, such as a single crystal or a laminate.

    young : E1, E2, E3 [Pa]; poisson : nu12, nu13, nu23, the strain along the second axis when pulled along the first;
    shear : G12, G13, G23 [Pa]; rho : [kg/m3]
    axes : (2, 3) directions of the first and second material axis, made orthogonal; the third follows by the right
        hand; or directions from place to place
    expansion : along the three axes [1/K]; elements : as of an isotropic one
    Source  Lekhnitskii, Theory of Elasticity of an Anisotropic Body, 1981, chapter 1"""

    young: Sequence[float]
    poisson: Sequence[float]
    shear: Sequence[float]
    rho: float
    axes: Sequence[Sequence[float]] | Directions = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    expansion: Sequence[float] = (0.0, 0.0, 0.0)
    elements: str = ""

    def __post_init__(self) -> None:
        if not (self.rho > 0 and min(self.young) > 0 and min(self.shear) > 0):
            raise Refusal("material: Young's moduli, shear moduli and density must all be positive")
        if not np.linalg.eigvalsh(self.compliance)[0] > 0:
            raise Refusal(
                f"material: Poisson's ratios {list(self.poisson)} do not fit Young's moduli {list(self.young)}: "
                "the material would gain energy when strained; nu12 is the strain along 2 when pulled along 1"
            )
        if not hasattr(self.axes, "at"):
            first, second = (np.asarray(axis, dtype=float) for axis in self.axes)
            if not np.linalg.norm(np.cross(first, second)) > 1e-3 * np.linalg.norm(first) * np.linalg.norm(second):
                raise Refusal("material: the two axes must be directions that are not parallel")

    @property
    def compliance(self) -> np.ndarray:
        """Compliance (6, 6) [1/Pa] in material axes, strains 11, 22, 33, 2*23, 2*13, 2*12."""
        E1, E2, E3 = self.young
        nu12, nu13, nu23 = self.poisson
        S = np.diag([1 / E1, 1 / E2, 1 / E3, 1 / self.shear[2], 1 / self.shear[1], 1 / self.shear[0]])
        for i, j, value in ((0, 1, -nu12 / E1), (0, 2, -nu13 / E1), (1, 2, -nu23 / E2)):
            S[i, j] = S[j, i] = value
        return S

    @property
    def stiffness(self) -> np.ndarray:
        return np.linalg.inv(self.compliance)


@dataclass(frozen=True)
class Anisotropic(_Turned):
    """A material without planes of symmetry.

    D : (6, 6) its `stiffness` [Pa]; rho : [kg/m3]; axes, expansion, elements : as of an orthotropic one"""

    D: np.ndarray
    rho: float
    axes: Sequence[Sequence[float]] | Directions = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    expansion: Sequence[float] = (0.0, 0.0, 0.0)
    elements: str = ""

    def __post_init__(self) -> None:
        if not (self.rho > 0 and np.linalg.eigvalsh(self.D)[0] > 0):
            raise Refusal("material: density must be positive, and the 21 elastic constants positive definite")

    @property
    def stiffness(self) -> np.ndarray:
        return np.asarray(self.D, dtype=float)


AnyMaterial = Material | Orthotropic | Anisotropic
