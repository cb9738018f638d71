"""Small models for the checks of harmonic balance against time integration and closed forms."""

import numpy as np
import scipy.linalg as sla

from tribodyn.fem.interface import ContactInterface
from tribodyn.fem.system import SecondOrderSystem
from tribodyn.reduction.model import ReducedModel


def interface(b: np.ndarray, components: tuple[str, ...], points: np.ndarray | None = None) -> ContactInterface:
    """A contact of unit-area pairs from its map alone."""
    n = len(b) // len(components)
    points = np.zeros((n, 3)) if points is None else points
    return ContactInterface(
        components, points, np.tile(np.eye(3), (n, 1, 1)), np.ones(n), np.zeros(n), b, np.zeros((0, 4), int)
    )


def modal_damping(mass: np.ndarray, stiffness: np.ndarray, ratio: float) -> np.ndarray:
    """The same damping ratio in every mode."""
    lam, phi = sla.eigh(stiffness, mass)
    mphi = mass @ phi
    return (mphi * (2 * ratio * np.sqrt(np.maximum(lam, 0.0)))) @ mphi.T


def oscillator(mass: float, stiffness: float, ratio: float, component: str = "t1") -> ReducedModel:
    """One moving mass whose tangential (with a second mass for the normal) or normal displacement meets the ground.

    component : "t1" gives DOFs (t1, n), the normal one loaded by "normal"; "n" gives one DOF, loaded by either name"""
    n = 2 if component == "t1" else 1
    m, k = mass * np.eye(n), stiffness * np.eye(n)
    loads = {"force": np.eye(n)[0], "normal": np.eye(n)[-1]}
    components = ("t1", "n") if component == "t1" else ("n",)
    system = SecondOrderSystem(m, k, 2 * ratio * np.sqrt(mass * stiffness) * np.eye(n), loads, {"mass": np.eye(n)[0]})
    return ReducedModel(system, interface(np.eye(n), components))


def random_structure(n_pair: int, seed: int = 0, ratio: float = 0.01, n_extra: int = 4) -> ReducedModel:
    """A random stiff structure with three-component contact pairs: nothing aligned, every coordinate coupled."""
    rng = np.random.default_rng(seed)
    n = 3 * n_pair + n_extra
    a = rng.normal(size=(n, n))
    stiffness = a @ a.T * 2e6 + np.eye(n) * 1e5
    mass = np.eye(n) + 0.1 * np.diag(rng.random(n))
    static, shaker = np.zeros(n), np.zeros(n)
    static[2 : 3 * n_pair : 3] = 1 / n_pair
    static[-1] = 0.3
    shaker[-2], shaker[0] = 1.0, 0.5
    system = SecondOrderSystem(
        mass,
        stiffness,
        modal_damping(mass, stiffness, ratio),
        {"static": static, "shaker": shaker},
        {"tip": np.eye(n)[-1]},
    )
    return ReducedModel(system, interface(np.eye(3 * n_pair, n), ("t1", "t2", "n")))


def slab(nx: int, ny: int, ratio: float = 0.02) -> ReducedModel:
    """An elastic slab of two layers of nodes on the ground: it slides, rocks and lifts at its edges.

    Contact pairs are the lower nodes; loads: "press" (down, spread over the upper layer), "shake" (along x),
    "rock" (up and down at one edge of the upper layer); output: "edge", x of a corner of the upper layer"""
    xy = np.array([(i * 2e-3, j * 2e-3) for i in range(nx) for j in range(ny)])
    points = np.concatenate([np.c_[xy, np.zeros(len(xy))], np.c_[xy, np.full(len(xy), 3e-3)]])
    n = 3 * len(points)
    stiffness = np.zeros((n, n))
    for i in range(len(points)):
        for j in range(i + 1, len(points)):
            d = points[j] - points[i]
            length = np.linalg.norm(d)
            if length < 3.8e-3:
                e = d / length
                rows = np.r_[3 * i : 3 * i + 3, 3 * j : 3 * j + 3]
                b = np.r_[e, -e]
                stiffness[np.ix_(rows, rows)] += 4e6 * np.outer(b, b)
    upper = len(xy)
    for i in range(upper, len(points)):  # soft suspension
        stiffness[range(3 * i, 3 * i + 3), range(3 * i, 3 * i + 3)] += np.array([2e6, 2e6, 1e5]) / len(xy)
    mass = np.eye(n) * 0.2 / len(points)
    press, shake, rock, edge = np.zeros((4, n))
    press[3 * upper + 2 :: 3] = -1 / len(xy)
    shake[3 * upper :: 3] = 1 / len(xy)
    rock[3 * upper + 2 : 3 * (upper + ny) : 3] = 1 / ny
    edge[-3] = 1.0
    b = np.zeros((3 * len(xy), n))
    for i in range(len(xy)):
        b[3 * i, 3 * i], b[3 * i + 1, 3 * i + 1], b[3 * i + 2, 3 * i + 2] = 1.0, 1.0, -1.0
    loads = {"press": press, "shake": shake, "rock": rock}
    system = SecondOrderSystem(mass, stiffness, modal_damping(mass, stiffness, ratio), loads, {"edge": edge})
    return ReducedModel(system, interface(b, ("t1", "t2", "n"), points[:upper]))


def floating_beam(n_node: int = 9, ratio: float = 0.02) -> ReducedModel:
    """An elastic beam that nothing but unilateral contact along its underside holds: it lifts, pitches and bends.

    Coordinates are the heights of its nodes; two of its modes are rigid. Loads: "press" (down, spread evenly),
    "shake" (up, at one end); output: "end", height of the other end. Contact pairs: component n, closing downwards"""
    stations = np.linspace(0.0, 1.0, n_node)
    bend = np.diff(np.eye(n_node), 2, axis=0) / np.diff(stations)[0] ** 2
    stiffness = 3.0 * bend.T @ bend / n_node
    mass = np.diag(np.where(np.isin(np.arange(n_node), (0, n_node - 1)), 0.5, 1.0)) / (n_node - 1)
    loads = {"press": -mass.diagonal(), "shake": np.eye(n_node)[0]}
    points = np.stack([stations, 0 * stations, 0 * stations], axis=1)
    stuck = modal_damping(mass, stiffness + 50.0 / n_node * np.eye(n_node), ratio)
    system = SecondOrderSystem(mass, stiffness, stuck, loads, {"end": np.eye(n_node)[-1]})
    return ReducedModel(system, interface(-np.eye(n_node), ("n",), points))
