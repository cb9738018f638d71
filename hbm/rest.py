"""A contact that has come to its preload without friction, and rests there with friction on.

The static loads act on a contact whose friction is off; then friction is on and every slider stands where the contact
stands, so that the preloaded state carries no shear. A law whose springs follow from its own numbers then has the
tangent of this state for its stuck springs.
Source  the order of loading of Porter and Brake, MSSP 192 (2023) 110210"""

from dataclasses import replace

import numpy as np

from tribodyn.hbm import newton
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.threads import single
from tribodyn.refusal import Refusal

EXACT = 1e-11  # relative residual of the state at rest


@single
def displacement(balance: HarmonicBalance, options: newton.NewtonOptions | None = None) -> np.ndarray:
    """Static displacement x (n_pair, n_component) [m] under the static loads alone, friction off.

    Raises  Refusal where the contact does not settle"""
    if not balance.basis.has_static:
        raise Refusal("a preload without friction needs harmonic 0: keep it in harmonics.kept")
    reduced = balance if 1 not in balance.basis.harmonics else balance.with_harmonics((0, 1))
    smooth = reduced.contact.with_friction_scaled(0.0)
    still = reduced.with_contact(smooth).with_load(0.0)
    exact = replace(options or newton.NewtonOptions(), tolerance=EXACT)

    def solve(at: HarmonicBalance, start: np.ndarray) -> newton.Solution:
        return newton.solve(at, at.omega_max, start, exact)

    solved = solve(still, still.stuck(still.omega_max))
    gap = balance.contact.gap
    if not solved.converged and np.ptp(gap) > 0:  # far openings: from faces that fit, each opened by its gap
        start = solve(still.with_gap(np.zeros_like(gap)), still.stuck(still.omega_max)).state.x.copy()
        start[:, balance.contact.components.index("n"), 0] += gap
        solved = solve(still, start)
    if not solved.converged:
        raise Refusal(f"preload: the contact does not settle without friction ({solved.outcome})")
    return solved.state.x[:, :, 0]


def memory(balance: HarmonicBalance, x: np.ndarray) -> np.ndarray:
    """Memory (n_pair, n_state) of every joint without shear at the displacement x (n_pair, n_component)."""
    sliders = np.zeros((balance.contact.n_pair, balance.contact.n_state))
    for joint in balance.contact.joints:
        joint_displacement = x[np.ix_(joint.rows, balance.contact.columns(joint))]
        if hasattr(joint.module, "memory_at_rest"):
            sliders[joint.rows, : joint.n_state] = joint.module.memory_at_rest(joint_displacement, joint.parameters)
        elif joint.n_state == len(joint.parameters.tangential):  # the positions of its sliders
            sliders[joint.rows, : joint.n_state] = joint_displacement[:, joint.parameters.tangential]
    return sliders


def tangents(balance: HarmonicBalance, x: np.ndarray) -> dict[str, np.ndarray]:
    """Springs (n_pair, n_component) [N/m] at rest in x, of the joints whose springs follow from their own numbers."""
    contact, basis = balance.contact, balance.basis
    soft_joints = [joint for joint in contact.joints if getattr(joint.module, "STIFFNESS_FROM_NUMBERS", False)]
    if not soft_joints:
        return {}
    still = np.zeros((*x.shape, basis.n_coeff))
    still[:, :, 0] = x
    jac = contact.cycle(still, basis, balance.memory, omega=balance.omega_max).slope
    each = np.diagonal(jac, axis1=1, axis2=2).reshape(still.shape)[:, :, basis.harmonics.index(1)]
    return {joint.name: np.maximum(each[np.ix_(joint.rows, contact.columns(joint))], 0.0) for joint in soft_joints}
