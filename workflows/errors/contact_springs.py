"""What the springs of a contact do: its state with stiffer and stiffer ones, and how much is open, sticks and slips."""

from collections.abc import Collection, Iterator
from dataclasses import replace

import numpy as np

from tribodyn.declarations import SLIP_LIMITS, Role
from tribodyn.hbm.balance import HarmonicBalance, State
from tribodyn.hbm.contact.contact_law import SEPARATES, SLIPS, STICKS
from tribodyn.refusal import Refusal, SolverFailure
from tribodyn.workflows.errors import operating_states
from tribodyn.workflows.errors.ladders import STIFFER, harmonic_with_springs
from tribodyn.workflows.errors.operating_states import OperatingState
from tribodyn.workflows.errors.refinement_limits import RefinementLimits
from tribodyn.workflows.result.contact_states import status_of


def stiffened(
    state: OperatingState, names: Collection[str], limits: RefinementLimits
) -> Iterator[tuple[float, OperatingState]]:
    """The state with stiffer and stiffer springs of some joints, each followed from the one before, as far as it goes.

    Raises  Refusal where a law has no springs"""
    contact, basis = state.balance.contact, state.balance.basis
    for joint in contact.joints:
        if joint.name in names and getattr(joint.module, "STIFFNESS_FROM_NUMBERS", False):
            raise Refusal(f"the springs of law '{joint.law}' follow from its numbers: leave contact.springs out")
    tops = {factor: harmonic_with_springs(basis.harmonics[-1], factor) for factor in STIFFER[1:]}
    tops = {f: top for f, top in tops.items() if contact.stiffness.size * (2 * top + 1) <= limits.max_unknowns}
    yield STIFFER[0], state
    for factor, top in tops.items():
        harmonics = (*basis.harmonics, *range(basis.harmonics[0], top + 1))
        try:
            for part in (factor / 4, factor / 2, factor):  # more harmonics first, then the springs in two steps
                joints = tuple(
                    replace(j, parameters=replace(j.parameters, stiffness=part * j.parameters.stiffness))
                    if j.name in names
                    else j
                    for j in contact.joints
                )
                balance = state.balance.with_contact(replace(contact, joints=joints))
                balance = balance.with_samples(max(basis.n_samples, 16 * top), basis.transitions == "located")
                state = operating_states.with_harmonics(replace(state, balance=balance), harmonics, max(tops.values()))
        except (Refusal, SolverFailure):
            return
        yield factor, state


def contact_shares(balance: HarmonicBalance, state: State) -> tuple[float, ...]:
    """Shares of open, stick and slip in a cycle, over pairs and instants."""
    contact, force = balance.contact, balance.history(state)[1]
    limit = np.full(force[:, 0].shape, np.nan)
    for joint in (joint for joint in contact.joints if joint.has_friction):
        roles = (*SLIP_LIMITS, Role.NORMAL_LOAD)
        friction, slip, load = (joint.parameters.numbers.get(joint.name_of(r) or "", np.zeros(1)) for r in roles)
        normal = force[joint.rows, contact.components.index("n")] if "n" in contact.components else load[:, None]
        limit[joint.rows] = friction[:, None] * normal + slip[:, None]
    status = status_of(force, contact.components, limit)
    return tuple(float((status == bits).mean()) for bits in (SEPARATES, STICKS, SLIPS))
