"""Contact without springs in time: unilateral contact and Coulomb friction as set-valued laws.

A step is x_1 = x_free - A f_1, with f_1 in the normal cone of the laws at x_1. With a spring in series,
x' = x + f / k, it reads x' = x_free - (A - 1 / k) f(x'), where f(x') is the law with the spring k: a spring that is put
in and taken out again changes no solution, whatever k is, and Newton's method meets a function of x'. It is the
augmented Lagrangian form of the laws; the sliders of the law stand where the contact points do.
That takes contact coordinates without mass, whose displacement follows from the forces at once: as many of the highest
modes of the structure without contact as there are contact coordinates follow statically. An impact then needs no
coefficient of restitution, since no mass stops at once: the mass that the lower modes do not carry is neglected.
Source  massless boundary: Monjaraz-Tec, Gross and Krack 2022; augmented Lagrangian: Alart and Curnier 1991; dynamic
Lagrangian in the balance: Nacivet et al. 2003"""

from dataclasses import replace

import numpy as np

from tribodyn.declarations import Role
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.contact.contact_law import ContactParameters
from tribodyn.hbm.contact.joint import Joint, JointSet
from tribodyn.refusal import Refusal

FOLLOWS = 4.0  # static compliance of a pair, over that of its inertia within a step


def stops_masses(resolved: int, n: int, contact: JointSet) -> bool:
    """Whether friction stops masses at once: it acts alone, and a step resolves modes that should follow statically.

    resolved : modes that a step resolves, of n"""
    return "n" not in contact.components and resolved > n - contact.stiffness.size


def moving_modes(resolved: int, lam: np.ndarray, motion: np.ndarray, contact: JointSet, h: float) -> int:
    """Modes that move with inertia: every contact coordinate follows at once, by a compliance that rules a step.

    lam : (n,) eigenvalues; motion : (n_contact, n) of the contact in the modes; h : time step [s]
    A pair that follows less than it moves by inertia within a step would chatter and gain energy
    Raises  Refusal where none remain"""
    n, n_contact = len(lam), contact.stiffness.size
    if n <= n_contact:
        raise Refusal(
            f"unilateral contact without springs needs more coordinates of the structure ({n}) than of the contact "
            f"({n_contact}): keep more modes, or a mass would be stopped by an impact"
        )
    squares = (motion**2).reshape(contact.n_pair, -1, n).sum(axis=1)
    inertial = 0.25 * h**2 * np.cumsum(squares, axis=1)  # within a step, of the modes up to each
    static = np.cumsum((squares / np.maximum(lam, 1 / h**2))[:, ::-1], axis=1)[:, ::-1]  # of each and the higher ones
    rules = (static[:, 1:] >= FOLLOWS * inertial[:, :-1]).all(axis=0)
    return max(1, min(resolved, n - n_contact, int(rules.sum())))


def stopping_step(
    stiffness: np.ndarray, damping: np.ndarray, h: float, load: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """E, Q and impulse of `time_step` where friction stops masses: x_1 = x_0 + h v, v = 0 where a pair sticks.

    Velocities belong to the middle of the steps; the friction force is constant within one.
    stiffness, damping : (m, m) of modes with unit mass; load : (m, n_coeff)
    Source  Moreau 1988; Stoermer and Verlet's staggered steps"""
    m = len(stiffness)
    inverse = np.linalg.inv(np.eye(m) + 0.5 * h * damping)
    velocity = np.hstack([-(h**2) * inverse @ stiffness, inverse @ (np.eye(m) - 0.5 * h * damping)])
    position = velocity + np.eye(m, 2 * m)
    impulse = h**2 * inverse @ load
    return np.vstack([position, velocity]), np.tile(h**2 * inverse, (2, 1)), np.tile(impulse, (2, 1))


def without_springs(balance: HarmonicBalance, compliance: np.ndarray) -> HarmonicBalance:
    """The problem with set-valued laws, whose stiffness is that of the springs in series.

    compliance : (n_contact, n_contact) of the coordinates that follow statically [m/N]
    Raises  Refusal for laws that are neither unilateral contact nor Coulomb friction, and where a contact coordinate
        has no compliance"""
    contact = balance.contact
    n_pair, c = contact.stiffness.shape
    blocks = compliance.reshape(n_pair, c, n_pair, c)[np.arange(n_pair), :, np.arange(n_pair)]
    least = np.linalg.eigvalsh(blocks)[:, 0]
    if not (least > 1e-9 * np.abs(blocks).max()).all():
        pair = int(least.argmin())
        raise Refusal(f"pair {pair} of the contact has no elastic compliance of its own: keep more modes of the body")
    stiffness = np.repeat(2 / least[:, None], c, axis=1)  # of the springs in series, half as soft as a pair
    joints = tuple(_rigid(joint, stiffness[joint.rows]) for joint in contact.joints)
    rigid = balance.with_contact(JointSet(contact.components, contact.n_pair, joints))
    if rigid.contact.n_state == balance.memory.shape[1]:
        return rigid
    return rigid.with_memory(np.zeros((n_pair, rigid.contact.n_state)))


def _rigid(joint: Joint, stiffness: np.ndarray) -> Joint:
    """The joint as planar Coulomb friction, or as friction in one direction, with the springs in series."""
    parameters = joint.parameters
    stiffness = stiffness[:, : len(parameters.components)]
    if joint.law == "unilateral" or joint.name_of(Role.NORMAL_LOAD) is not None:
        return replace(joint, parameters=replace(parameters, stiffness=stiffness))
    friction = joint.name_of(Role.FRICTION)
    if friction is None or "n" not in parameters.components:
        raise Refusal(
            f"joint '{joint.name}' has the law '{joint.law}', which without springs is neither unilateral contact nor "
            "Coulomb friction: take one that is"
        )
    law = "coulomb_planar" if len(parameters.components) == 3 else "jenkins"
    numbers = {"friction": parameters.numbers[friction]}
    values = ContactParameters(parameters.components, stiffness, parameters.gap, numbers)
    return replace(joint, law=law, parameters=values)
