"""Relative coordinates at a contact of two bodies: half the contact DOFs become masters of a reduction.

The displacement of a body-1 node is replaced by the relative displacement of its pair, u_1 = R^T x + u_2 in the frame R
of the pair, so that the contact map picks coordinates and the nodes of body 2 may become slaves. Nothing is lost: it is
a change of variables. Fixed-interface modes are then those of the bodies glued together at the pairs.
Source  the relative displacement of a shroud in Tamatam 2021, section 3.2.2, for any pair of bodies"""

from dataclasses import replace

import numpy as np
from scipy.sparse import bsr_array, csr_matrix, eye_array

from tribodyn.fem.interface import COMPONENTS, ContactInterface
from tribodyn.fem.system import SecondOrderSystem
from tribodyn.refusal import Refusal


def relative(
    system: SecondOrderSystem, interface: ContactInterface
) -> tuple[SecondOrderSystem, ContactInterface, csr_matrix]:
    """Change the DOFs of the body-1 nodes of a full system to relative displacements.

    system : sparse, n DOFs; interface : all three components, B over the same DOFs
    Returns the system and interface in the new coordinates, and T (n, n) with q = T q_new; feed the reduced basis
        through T to get back to the full field
    Raises  Refusal where a component is missing, or where a body-1 DOF is held or shared by two pairs"""
    n, n_pair = system.n_dof, interface.n_pair
    B = csr_matrix(interface.B)
    body_1, retained = body_1_dofs(interface).ravel(), np.ones(n, dtype=bool)
    if len(np.unique(body_1)) < len(body_1):
        raise Refusal("relative coordinates need body-1 nodes of their own, but two pairs share one")
    retained[body_1] = False
    # x = R u_1 - R u_2, so u_1 = R^T x - R^T (B without its body-1 columns) u
    rows, columns = np.repeat(body_1, 3), np.tile(np.arange(3), 3 * n_pair) + np.repeat(3 * np.arange(n_pair), 9)
    back = csr_matrix((interface.frames.transpose(0, 2, 1).ravel(), (rows, columns)), shape=(n, 3 * n_pair))
    place = csr_matrix((np.ones(len(body_1)), (np.arange(len(body_1)), body_1)), shape=(3 * n_pair, n))
    keep = csr_matrix(eye_array(n).tocsr().multiply(retained[:, None]))
    T = csr_matrix(keep + back @ place - back @ (B.multiply(retained[None, :])))
    return system.projected(T), replace(interface, B=place), T


def body_1_dofs(interface: ContactInterface) -> np.ndarray:
    """DOFs (n_pair, 3) of the body-1 nodes along x, y, z: the columns of B that hold the frames themselves.

    Raises  Refusal where one is not among the DOFs of the system, or the contact has not all three components"""
    if interface.components != COMPONENTS:
        raise Refusal(f"relative coordinates need contact components t1, t2, n, not {list(interface.components)}")
    pairs, rows = np.arange(interface.n_pair + 1), np.arange(3 * interface.n_pair)
    back = bsr_array((interface.frames.transpose(0, 2, 1), pairs[:-1], pairs), shape=(len(rows), len(rows)))
    turned = csr_matrix(back @ csr_matrix(interface.B))  # x, from the frame of each pair back to the axes
    is_unit = turned.data > 1 - 1e-9
    if not np.array_equal(np.repeat(rows, np.diff(turned.indptr))[is_unit], rows):
        raise Refusal("relative coordinates need body-1 nodes that are free in x, y and z")
    return turned.indices[is_unit].astype(int).reshape(-1, 3)
