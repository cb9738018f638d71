"""Bodies on which extremes are tried: a small lattice, a rigid mass, a floating body, the beam scene."""

from dataclasses import dataclass, replace

import numpy as np

from tribodyn.fem.interface import ContactInterface
from tribodyn.fem.system import SecondOrderSystem
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.contact.contact_law import ContactParameters
from tribodyn.hbm.contact.joint import Joint
from tribodyn.hbm.excitation import Excitation
from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.reduction.linear_damping import modal_damping
from tribodyn.reduction.model import ReducedModel
from tribodyn.workflows.run import modelling
from tribodyn.workflows.run.progress import Progress
from tribodyn.workflows.scene import scene_file

ALL = ("t1", "t2", "n")


@dataclass(frozen=True)
class Setting:
    """What is varied; stiffness is that of the whole contact [N/m], loads in [N], omega in [rad/s]."""

    tangential: float
    normal: float
    friction: float
    preload: float
    force: float
    omega: float
    damping: float = 0.01
    gap: float = 0.0
    harmonics: tuple[int, ...] = (0, 1)
    samples: int = 128
    transitions: str = "located"


@dataclass(frozen=True)
class Body:
    """An undamped reduced model with loads "press" and "shake" and one output, and its ordinary setting."""

    name: str
    model: ReducedModel
    ordinary: Setting

    def balance(self, setting: Setting) -> HarmonicBalance:
        """The nonlinear problem of this body at a setting; raises what the solver refuses."""
        parameters = ContactParameters.of(
            self.model.interface.components,
            self.model.interface.stiffness(setting.tangential, setting.normal),
            friction=setting.friction,
            gap=self.model.interface.gap + setting.gap,
        )
        basis = HarmonicBasis(setting.harmonics, setting.samples, setting.transitions)
        loads: dict[tuple[int, str], complex] = {(1, "shake"): setting.force}
        if setting.preload != 0:
            loads[0, "press"] = setting.preload
        model = self.model.with_damping(lambda system, _: modal_damping(system, setting.damping))
        return HarmonicBalance.of(
            model, Joint("contact", "jenkins", parameters), basis, Excitation(loads), setting.omega
        )


def beam(n_patch: int) -> Body:
    """The beam scene with n_patch x n_patch contact nodes and its published loads, between free and stuck peak."""
    file = scene_file.read("beam_thesis", (f"geometry.n_patch={n_patch}", "damping="))
    model = modelling.build(file, Progress())
    contact, loads = file.mesh_scene.contact, model.balance.excitation.loads
    tangential, normal = contact.tangential_stiffness or 0.0, contact.normal_stiffness or 0.0
    ordinary = Setting(
        tangential, normal, contact.numbers["friction"], abs(loads[0, "press"]), abs(loads[1, "shake"]), 2 * np.pi * 860
    )
    return Body(f"beam, {n_patch} x {n_patch} nodes", model.reduced, ordinary)


def lattice(nx: int, ny: int, suspended: bool = True) -> Body:
    """Two layers of masses joined by springs, the lower one on the ground: it slides, rocks and lifts at its edges.

    suspended : soft springs hold the upper layer; else the contact alone holds the body, which has six rigid modes"""
    grid = np.array([(i * 2e-3, j * 2e-3) for i in range(nx) for j in range(ny)])
    points = np.concatenate([np.c_[grid, np.zeros(len(grid))], np.c_[grid, np.full(len(grid), 3e-3)]])
    n_pair, n = len(grid), 3 * len(points)
    stiffness = np.zeros((n, n))
    for i, point in enumerate(points):
        for j in range(i + 1, len(points)):
            length = np.linalg.norm(points[j] - point)
            if length < 3.8e-3:
                rows = np.r_[3 * i : 3 * i + 3, 3 * j : 3 * j + 3]
                direction = np.r_[points[j] - point, point - points[j]] / length
                stiffness[np.ix_(rows, rows)] += 4e6 * np.outer(direction, direction)
    if suspended:
        stiffness[np.arange(n // 2, n), np.arange(n // 2, n)] += np.tile([2e6, 2e6, 1e5], n_pair) / n_pair
    press, shake, edge = np.zeros((3, n))
    press[3 * n_pair + 2 :: 3] = -1 / n_pair
    shake[3 * n_pair :: 3] = 1 / n_pair
    edge[-3] = 1.0
    system = SecondOrderSystem(
        0.2 / len(points) * np.eye(n), stiffness, None, {"press": press, "shake": shake}, {"edge": edge}
    )
    b = np.kron(np.eye(n_pair, 2 * n_pair), np.diag([1.0, 1.0, -1.0]))
    name = f"lattice, {nx} x {ny} nodes" if suspended else f"lattice without supports, {nx} x {ny} nodes"
    ordinary = Setting(2e6, 3e6, 0.4, 40.0, 80.0, 2 * np.pi * 500)  # all pairs slip, two thirds lift
    return Body(name, ReducedModel(system, _interface(b, points[:n_pair], ALL)), ordinary)


def rigid(n_pair: int) -> Body:
    """One mass on springs along t1 and n that rests on n_pair equal pairs: its motion does not depend on n_pair."""
    b = np.tile(np.eye(2), (n_pair, 1))
    system = SecondOrderSystem(
        np.eye(2), np.diag([1e6, 1e6]), None, {"press": np.eye(2)[1], "shake": np.eye(2)[0]}, {"mass": np.eye(2)[0]}
    )
    ordinary = Setting(1e6, 2e6, 0.4, 100.0, 60.0, 1100.0)
    return Body(
        f"mass on {n_pair} nodes", ReducedModel(system, _interface(b, np.zeros((n_pair, 3)), ("t1", "n"))), ordinary
    )


def scaled(body: Body, length: float, force: float) -> Body:
    """The same body in other units of length and force: numbers grow by these factors, time stays.

    The motion of the scaled body is the scaled motion, so that a pair of solves checks one by the other."""
    stiffness, system = force / length, body.model.system
    scaled_system = replace(system, mass=stiffness * system.mass, stiffness=stiffness * system.stiffness)
    o = body.ordinary
    springs = {"tangential": stiffness * o.tangential, "normal": stiffness * o.normal}
    ordinary = replace(o, **springs, preload=force * o.preload, force=force * o.force, gap=length * o.gap)
    return Body(body.name, replace(body.model, system=scaled_system), ordinary)


def _interface(b: np.ndarray, points: np.ndarray, components: tuple[str, ...]) -> ContactInterface:
    n = len(points)
    frames = np.tile(np.eye(3), (n, 1, 1))
    return ContactInterface(components, points, frames, np.full(n, 1e-6), np.zeros(n), b, np.zeros((0, 4), int))
