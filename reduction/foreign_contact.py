"""A contact of foreign matrices: components, signs and frames as a user gives them."""

from collections.abc import Sequence

import numpy as np
import scipy.sparse as sp

from tribodyn.fem.interface import ContactInterface, contact_frames
from tribodyn.reduction import harwell_boeing
from tribodyn.refusal import Refusal


def interface_of_rows(
    motion: sp.csr_matrix, components: tuple[str, ...], frames: np.ndarray, area: float | np.ndarray,
    gap: float | np.ndarray, points: np.ndarray | None,
) -> ContactInterface:  # fmt: skip
    """The interface of rows (n_pair * n_component, n_dof); raises Refusal for an empty row and for bad areas."""
    n_pair = len(frames)
    motion.eliminate_zeros()
    if (np.diff(motion.indptr) == 0).any():
        pair = int(np.flatnonzero(np.diff(motion.indptr) == 0)[0]) // len(components)
        raise Refusal(f"contact pair {pair} has the same DOF on both bodies, or a row of zeros: it can never move")
    areas = np.broadcast_to(np.asarray(area, float) / (n_pair if np.ndim(area) == 0 else 1), n_pair).copy()
    if not (areas > 0).all():
        raise Refusal("a contact area is not positive: give the area of the patch, or one per pair, in m2")
    return ContactInterface(
        components=components,
        points=np.zeros((n_pair, 3)) if points is None else np.asarray(points, float).reshape(n_pair, 3),
        frames=frames,
        area=areas,
        gap=np.broadcast_to(np.asarray(gap, float), n_pair).copy(),
        B=motion,
        faces=np.zeros((0, 4), int),
    )


def component_number(component: int | str) -> int:
    """Component 1..6 from a number, from UX .. ROTZ, or from x, y, z."""
    if isinstance(component, str):
        name = component.upper()
        name = "U" + name if name in ("X", "Y", "Z") else name
        if name in harwell_boeing.COMPONENT_NAMES:
            return harwell_boeing.COMPONENT_NAMES.index(name) + 1
    elif 0 <= component <= 6:
        return int(component)
    raise Refusal(
        f"component {component!r} is unknown: give 1 to 6, x, y, z or UX, UY, UZ, ROTX, ROTY, ROTZ (0: a scalar point)"
    )


def sign_factors(signs: Sequence[float] | None, n_component: int) -> np.ndarray:
    chosen = np.ones(n_component) if signs is None else np.asarray(signs, float)
    if chosen.shape != (n_component,) or not (np.abs(chosen) == 1).all():
        raise Refusal(f"signs is {signs}: give +1 or -1 for each of the {n_component} components")
    return chosen


def frames_of_normals(normal: Sequence[float] | np.ndarray, t1: Sequence[float] | None, n_pair: int) -> np.ndarray:
    """(n_pair, 3, 3) rows t1, t2, n; without a t1 it follows the axis that is least along the normal."""
    direction = np.broadcast_to(np.asarray(normal, float), (n_pair, 3))
    length = np.linalg.norm(direction, axis=1, keepdims=True)
    if not (length > 0).all():
        raise Refusal("a contact normal is zero: give a direction from body 1 into body 2")
    n = direction / length
    if t1 is not None:
        return contact_frames(n, t1)
    return np.concatenate(
        [contact_frames(reference[None], np.eye(3)[np.abs(reference).argmin()].tolist()) for reference in n]
    )
