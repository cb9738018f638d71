"""What of a structure looks wrong by a thousand: a slip of units, or loads that bend it beyond a linear model."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from scipy.linalg import LinAlgError, cho_factor, cho_solve, eigh
from scipy.sparse import issparse

from tribodyn.fem.factor import factorise
from tribodyn.fem.material import Material
from tribodyn.fem.modes import modes
from tribodyn.fem.system import SecondOrderSystem
from tribodyn.workflows.scene.schema import MeshScene

LARGE, SMALL = 20.0, 1e-4  # [m], sizes beyond which the unit of length is doubted
LIGHT, HEAVY = 50.0, 30_000.0  # [kg/m3]; foams are below, nothing is above
SOFT, HARD = 1e6, 2e12  # [Pa]; rubber and diamond
BENT = 0.1  # of its size: more is no small displacement
RIGID = 1e-12  # of the largest squared frequency, below which the lowest one is rounding
WATCHED = 6  # modes whose resonance is looked at


def odd_sizes(size: np.ndarray, cure: str) -> list[str]:
    """A remark on a size (3,) [m] that looks wrong by a thousand; cure : what to do about it."""
    longest = float(size.max())
    if longest > LARGE:
        return [f"it is {longest:.4g} m long, as a mesh in millimetres read in metres would be: {cure}"]
    if longest < SMALL:
        return [
            f"it is {1e6 * longest:.4g} um long, as a mesh in metres read in millimetres would be: correct its unit"
        ]
    return []


def odd_materials(materials: Mapping[str, Material]) -> list[str]:
    """Remarks on materials, body -> material, whose numbers look wrong by a thousand."""
    remarks = []
    for name, one in materials.items():
        if one.rho < LIGHT or one.rho > HEAVY:
            unit = "g/cm3" if 0.1 < one.rho < LIGHT else "another unit"
            remarks.append(
                f"the density of {name} is {one.rho:.4g} kg/m3, as a value in {unit} without its unit would be: "
                'write it with its unit, such as "7.86 g/cm3"'
            )
        if one.E < SOFT or one.E > HARD:
            unit = "GPa" if one.E < 2e3 else "MPa" if one.E < SOFT else "another unit"
            remarks.append(
                f"Young's modulus of {name} is {one.E:.4g} Pa, as a value in {unit} without its unit would be: "
                'write it with its unit, such as "210 GPa"'
            )
    return remarks


def _free(system: SecondOrderSystem) -> bool:
    """Whether a reduced structure moves as a rigid body but for rounding."""
    if not isinstance(system.stiffness, np.ndarray):
        return False
    squares = eigh(system.stiffness, system.mass, eigvals_only=True, subset_by_index=(0, min(12, len(system.mass) - 1)))
    return bool(abs(squares[0]) < RIGID * squares[-1])


def odd_deflection(
    scene: MeshScene, system: SecondOrderSystem, largest: Callable[[np.ndarray], float], size: float
) -> list[str]:
    """A remark where a load, alone and with the contact open, bends the part beyond a linear model.

    Static loads by their static deflection; harmonic ones by the resonances in the range of the response, with the
    modal damping of the scene. Nothing is said of a structure that contact alone holds.
    system : full or reduced, without contact; largest : of its coordinates -> largest displacement [m]; size : [m]
    """
    moved: dict[str, tuple[float, str]] = {}
    try:
        solve = _solver(system.stiffness)
    except (ValueError, LinAlgError):  # nothing holds it but the contact
        return []
    if _free(system):
        return []
    for name, load in {**scene.loads.static, **scene.loads.harmonic}.items():
        if name in system.loads:
            moved[name] = (largest(solve(system.loads[name] * load.amplitude)), "at rest")
    ratio = scene.damping.modal
    if ratio:
        omega, phi = modes(system.stiffness, system.mass, min(WATCHED, system.mass.shape[0]))
        low, high = (2 * np.pi * f for f in scene.response.frequency)
        for name, load in scene.loads.harmonic.items():
            force = system.loads[name] * load.amplitude if name in system.loads else 0.0 * phi[:, 0]
            for i in np.flatnonzero((omega * load.harmonic >= low) & (omega <= high * load.harmonic) & (omega > 0)):
                swing = largest(phi[:, i] * (phi[:, i] @ force) / (2 * ratio * omega[i] ** 2))
                moved[name] = max(
                    moved.get(name, (0.0, "")), (swing, f"at its resonance of {omega[i] / (2 * np.pi):.4g} Hz")
                )
    name, (most, where) = max(moved.items(), key=lambda item: item[1][0], default=("", (0.0, "")))
    if most <= BENT * size:
        return []
    return [
        f"load {name} alone moves the part by {1e3 * most:.3g} mm on {1e3 * size:.3g} mm {where} while the "
        "contact is open, more than a linear model describes: check its unit, or keep this in mind"
    ]


def _solver(stiffness: Any) -> Callable[[np.ndarray], np.ndarray]:
    if issparse(stiffness):
        return factorise(stiffness).solve
    factor = cho_factor(stiffness)
    return lambda force: np.asarray(cho_solve(factor, force))
