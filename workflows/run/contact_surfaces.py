"""From measured or made-up faces to the gap of every node pair."""

import numpy as np
import scipy

from tribodyn.fem.interface import COMPONENTS, ContactInterface
from tribodyn.geometry.height_map import centred, facing_gap, onto_nodes
from tribodyn.geometry.map_repair import repair, split
from tribodyn.refusal import Refusal
from tribodyn.workflows.run import model_cache
from tribodyn.workflows.scene.contact_numbers import faces
from tribodyn.workflows.scene.scene_file import SceneFile

FLAT = 1e-6  # part of its size by which a flat patch may bulge


def surface_gap(file: SceneFile, interface: ContactInterface) -> tuple[np.ndarray, tuple[str, ...]]:
    """Gap (n_pair,) [m] of a flat contact from the faces that a scene names.

    Returns it with a sentence for each thing that was changed in a height map

    Raises  ValueError where the patch is not flat, or where a height map or the mating height cannot be what the scene
        gives"""
    surfaces = file.mesh_scene.surfaces
    assert surfaces is not None
    nodes = patch_coordinates(interface, surfaces.axes)
    size = np.ptp(nodes, axis=0)
    if abs(surfaces.mating_height) > size.max():
        raise Refusal(
            f'surfaces.mating_height is {surfaces.mating_height:g} m, more than the face is long: give its unit, "3 um"'
        )

    def prepared_heights() -> tuple[np.ndarray, tuple[str, ...]]:
        repairs: list[str] = []
        heights = np.zeros((2, len(nodes)))
        for i, face in enumerate(faces(surfaces, file.folder)):
            levelled, changed = repair(face, (float(size[0]), float(size[1])))
            heights[i] = onto_nodes(centred(split(levelled, surfaces.cutoff)[0]), nodes)
            repairs += changed
        return heights, tuple(repairs)

    heights, repairs = model_cache.cached_heights(file, nodes, prepared_heights)
    return facing_gap(heights[0], heights[1], surfaces.mating_height), repairs


def mapped_gap(rows: np.ndarray, interface: ContactInterface, pairs: slice) -> np.ndarray:
    """Opening (k,) of some pairs of an interface from points in space, their least one taken off [m].

    rows : (n, 4) x, y, z, opening [m], seen along the mean normal of the pairs: linear between the points, that of the
        nearest one outside"""
    tangents = interface.frames[pairs].mean(axis=0)[:2]
    at, targets = rows[:, :3] @ tangents.T, interface.points[pairs] @ tangents.T
    opening = scipy.interpolate.LinearNDInterpolator(at, rows[:, 3])(targets)
    outside = ~np.isfinite(opening)
    opening[outside] = scipy.interpolate.NearestNDInterpolator(at, rows[:, 3])(targets[outside])
    return np.asarray(opening - opening.min())


def patch_coordinates(interface: ContactInterface, axes: tuple[str, str]) -> np.ndarray:
    """Pairs (n_pair, 2) in the plane of a flat patch along signed components, from the middle of its extent [m].

    Raises  ValueError where the patch is not flat"""
    frame = interface.frames.mean(axis=0)
    directions = np.stack(
        [(-1.0 if name.startswith("-") else 1.0) * frame[COMPONENTS.index(name[-2:])] for name in axes]
    )
    nodes = interface.points @ directions.T
    size = float(np.ptp(nodes, axis=0).max())
    if np.ptp(interface.points @ frame[2]) > FLAT * size or np.ptp(interface.frames, axis=0).max() > FLAT:
        raise Refusal("surfaces: the contact is not flat, so that a height map cannot be laid on it; leave them out")
    return nodes - (nodes.max(axis=0) + nodes.min(axis=0)) / 2
