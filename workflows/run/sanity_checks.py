"""What a run prints before it computes: sizes, mass, gaps, what is not used, and checks of what may be a wrong unit."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.linalg import LinAlgError, cho_factor, cho_solve
from scipy.sparse import issparse

from tribodyn.fem.assembly import Body, materials_of
from tribodyn.fem.elasticity import densities
from tribodyn.fem.factor import SingularStiffness, factorise
from tribodyn.fem.material import AnyMaterial
from tribodyn.fem.modes import lowest_squares, modes
from tribodyn.fem.part import Part
from tribodyn.fem.system import SecondOrderSystem
from tribodyn.geometry.mesh import facts
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.workflows.result.summary import LARGEST_BEND
from tribodyn.workflows.run import matrix_model, part_reduction, scene_assembly
from tribodyn.workflows.run.damping_matrices import check_damping
from tribodyn.workflows.scene.matrix_scene import MatrixScene
from tribodyn.workflows.scene.part_tables import SolidMaterial
from tribodyn.workflows.scene.scene_file import SceneFile
from tribodyn.workflows.scene.scene_values import unusual_values, usual_range
from tribodyn.workflows.scene.schema import MeshScene

if TYPE_CHECKING:
    from tribodyn.workflows.run.modelling import Model


@dataclass(frozen=True)
class Usual:
    """What a structure usually is; what lies outside is mentioned, never refused.

    size : of the whole [m]
    bent : largest displacement over the size that a linear model describes
    rigid : of the largest squared frequency, below which the lowest one is rounding
    modes : whose resonance is checked; line_error : of frequencies between the speeds of an operating line"""

    size: tuple[float, float] = (1e-4, 20.0)
    bent: float = LARGEST_BEND
    rigid: float = 1e-10
    modes: int = 6
    line_error: float = 1e-4


TYPICAL = Usual()
ELASTIC = {"young": "E", "poisson": "nu", "density": "rho", "expansion": "expansion"}  # key -> of a `Material`
LARGEST_OPENING = 0.005  # of the length of a face: an opening or overlap from which on a pair is remarked


def lines(file: SceneFile, model: Model) -> Iterator[str]:
    """Sentences on the structure of a scene."""
    part = model.part
    if part is None:
        if isinstance(file.scene, MatrixScene):
            yield from matrix_model.lines(matrix_model.read(file.scene.model, file.folder))
        return
    scene = file.mesh_scene
    names = [body.name for body in part.mesh.bodies]
    material = part_reduction.material(scene, part.mesh)
    found, counts = [], []
    for name, (piece, piece_material) in zip(names, materials_of(part.mesh, material), strict=True):
        found.append(facts(piece.mesh, densities(piece.mesh, piece_material)))
        kind = "hexahedra" if piece.mesh.t.shape[0] == 8 else "tetrahedra"
        counts.append(f"{name}: {piece.mesh.nelements} {kind}" if name else f"{piece.mesh.nelements} {kind}")
    size = np.max([one.high for one in found], axis=0) - np.min([one.low for one in found], axis=0)
    masses = [one.mass or 0.0 for one in found]
    centre = np.average([one.centre for one in found], axis=0, weights=masses)
    yield f"size {_mm(size, ' x ')} mm, mass {sum(masses):.4g} kg, centre ({_mm(centre)}) mm; {'; '.join(counts)}"
    worst = min(found, key=lambda one: one.scaled_jacobian)
    yield f"worst element: scaled Jacobian {worst.scaled_jacobian:.3g} at ({_mm(worst.worst_centre)}) mm"
    for name, pairs in part.pairs.items():
        gap = np.asarray(part.interface.gap)[pairs]
        if gap.size:
            yield f"gap of {name}: {1e6 * gap.min():.4g} to {1e6 * gap.max():.4g} um"
    yield from notes(file, part)


def remarks_on_part(file: SceneFile, part: Part) -> list[str]:
    """What of a scene and its part is to be doubted before it is reduced, a sentence each."""
    scene = file.mesh_scene
    doubts = [*unusual_values(scene), *check_size(np.ptp(part.points, axis=0), "scale the mesh to metres")]
    doubts += [*check_decks(file, part), *check_places(scene), *check_heat(scene, part)]
    doubts += check_thickness(part.mesh.bodies)
    if scene.bolts:
        from tribodyn.workflows.run import bolt_tightening  # only bolts need it

        shanks = bolt_tightening.rods(scene, part.mesh, part.node_sets)
        doubts += bolt_tightening.leaning(scene, shanks, part.mesh, part.node_sets)
    return doubts


def remarks(file: SceneFile, model: Model) -> list[str]:
    """The same with what its model shows; a result keeps them as its notes."""
    part = model.part
    if part is None:
        return unusual_values(file.scene)
    scene, doubts = file.mesh_scene, remarks_on_part(file, part)
    size = np.ptp(part.points, axis=0)
    if model.reduced.has_one_system:
        reduced = model.reduced
        doubts += check_deflection(
            scene, reduced.system, lambda q: part.largest(reduced.reconstruct(q)), float(np.linalg.norm(size))
        )
    doubts += check_speed(scene, model.reduced.accuracy().get("line_error"))
    if model.reduced.at_harmonic(1)[0].damping is None:
        doubts.append("there is no damping but that of friction: give [damping]")
    doubts += check_damping(scene, model.reduced)
    if _unpressed(model.balance, 2 * np.pi * max(scene.response.range)):
        doubts.append(
            "nothing presses the contact together at rest, so that it rubs by chance: give [loads.static.NAME]"
        )
    return doubts


def check_decks(file: SceneFile, part: Part) -> list[str]:
    """Remarks on the materials and places of bodies that decks bring, which stand in no table of the scene."""
    scene = file.mesh_scene
    if not scene.decks:
        return []
    bodies = [body for body in part.mesh.bodies if body.name not in scene.bodies]
    heats = [f"loads.static.{name}" for name, load in scene.loads.static.items() if load.kind == "temperature"]
    tables = [
        f"{' and '.join(cards)} of material '{name}' of decks.{deck} at the initial temperature of the deck, which "
        f"{heats[0]} changes: give [materials.{name}] at the temperature that is meant"
        for deck, carried in (scene_assembly.carried_decks(scene, file.folder) if heats else {}).items()
        for name, cards in carried.tabulated.items()
    ]
    return [*check_materials(bodies), *scene_assembly.overlaps(part.mesh.bodies), *tables]


def check_heat(scene: MeshScene, part: Part) -> list[str]:
    """Remarks on bodies and shanks that a static load heats and that do not expand."""
    heats = [load for load in scene.loads.static.values() if load.kind == "temperature"]
    heated = [body for body in part.mesh.bodies if any(not load.bodies or body.name in load.bodies for load in heats)]
    materials: dict[str, Any] = {f"body '{body.name}'": of for body in heated for of in materials_in(body)}
    tables = {f"bolts.{name}": scene.materials.get(bolt.material or "") for name, bolt in scene.bolts.items()}
    materials |= {name: of for name, of in tables.items() if heats and of is not None}
    rigid = [name for name, of in materials.items() if not np.any(of.expansion)]
    return [f"{' and '.join(rigid)} is heated and does not expand: give its material an expansion"] if rigid else []


def check_modes(frequencies: Sequence[float]) -> list[str]:
    """A remark on natural frequencies [Hz] that are zero though the structure is held."""
    count = sum(frequency == 0.0 for frequency in frequencies)
    if not count:
        return []
    return [f"{count} of the modes are at 0 Hz: without contact nothing holds the bodies; hold or join them"]


def check_places(scene: MeshScene) -> list[str]:
    """Remarks on places of wear that the response does not reach."""
    if scene.response.frequency is None:
        return []
    low, high = scene.response.frequency
    return [
        f"wear is taken at {duty.at.frequency:g} Hz, outside response.frequency, {low:g} to {high:g} Hz: extend it"
        for duty in (scene.wear.duties if scene.wear is not None and scene.wears else ())
        if duty.at.frequency is not None and not low <= duty.at.frequency <= high
    ]


def _unpressed(balance: HarmonicBalance, omega: float) -> bool:
    """Whether pairs that touch without a gap bear nothing under the static loads, every contact stuck."""
    contact = balance.contact
    if "n" not in contact.components or not balance.basis.has_static or not (contact.gap <= 0).any():
        return False
    x = balance.stuck(omega)
    x[..., 1:] = 0.0
    return balance.preload(balance.evaluate(omega, x, jacobian=False)) == 0.0


def notes(file: SceneFile, part: Part) -> Iterator[str]:
    """What was done to the files of a scene, and what of them is not used."""
    scene = file.mesh_scene
    yield from (note for body in part.mesh.bodies for note in body.notes)
    for deck in scene_assembly.carried_decks(scene, file.folder).values():
        yield from deck.notes


def _mm(point: np.ndarray, between: str = ", ") -> str:
    return between.join(f"{1e3 * c:.4g}" for c in point)


def check_opening(pair: str, gap: np.ndarray, length: float) -> list[str]:
    """Remarks on the opening (n,) [m], negative in an overlap, of two faces; length : of the first one [m]."""
    return [
        f"the faces of {pair} lie up to {1e3 * far:.3g} mm {position}: correct their places"
        for far, position in ((float(gap.max()), "apart"), (-float(gap.min()), "inside each other"))
        if far > LARGEST_OPENING * length
    ]


def check_size(size: np.ndarray, cure: str) -> list[str]:
    """A remark on a size (3,) [m] that is not usual; cure : what to do about it."""
    longest = float(size.max())
    if longest > TYPICAL.size[1]:
        return [f"it is {longest:.4g} m long, as a mesh in millimetres read in metres would be: {cure}"]
    if longest < TYPICAL.size[0]:
        return [
            f"it is {1e6 * longest:.4g} um long, as a mesh in metres read in millimetres would be: correct its unit"
        ]
    return []


def materials_in(body: Body) -> list[AnyMaterial]:
    """The materials that a body is made of."""
    return [*body.material.values()] if isinstance(body.material, Mapping) else [body.material]


def check_materials(bodies: Iterable[Body]) -> list[str]:
    """Remarks on numbers of the materials of bodies that are outside the usual ranges of a scene's [materials]."""
    remarks = [
        remark
        for body in bodies
        for material in materials_in(body)
        for key, attribute in ELASTIC.items()
        if (usual := usual_range(SolidMaterial.model_fields[key])) is not None
        for remark in usual.remarks(f"{key} of body '{body.name}'", getattr(material, attribute, None))
    ]
    return list(dict.fromkeys(remarks))


def check_thickness(bodies: Iterable[Body]) -> list[str]:
    """Remarks on bodies of linear_reduced elements that are one element thick, where little resists their bending."""
    remarks = []
    for body in (b for b in bodies if any(material.elements == "linear_reduced" for material in materials_in(b))):
        mesh, sides = body.mesh, [set(side) for side in body.mesh.elem.refdom.facets]
        opposite = [pair for pair in combinations(range(6), 2) if not sides[pair[0]] & sides[pair[1]]]
        thin = (mesh.f2t[1][mesh.t2f[np.array(opposite)]] < 0).all(axis=1).any(axis=0).sum()
        share = "hourglass stiffness alone" if mesh.doflocs.shape[1] == mesh.nvertices else "three quarters of it"
        if thin:
            remarks.append(
                f"body '{body.name}' is one element thick at {thin} of {mesh.nelements}; of the bending stiffness "
                f"of linear_reduced elements {share} acts: mesh it finer there or with other elements"
            )
    return remarks


def check_speed(scene: MeshScene, line_error: float | None) -> list[str]:
    """Remarks on a speed that does not excite the frequencies of the response, and on stress between speeds."""
    wheel, (low, high) = scene.wheel, scene.response.range
    if line_error is not None and line_error > TYPICAL.line_error:
        return [
            f"the stress of the wheel changes abruptly along its speeds: frequencies between those at which it was "
            f"computed are right to {line_error:.1e} only; shorten the range"
        ]
    if wheel is None or not wheel.speed or not wheel.engine_order or wheel.sweep is not None:
        return []
    order = abs(wheel.engine_order)
    if low <= order * wheel.speed <= high:
        return []
    return [
        f"at {60 * wheel.speed:.5g} rpm engine order {order} excites {order * wheel.speed:.5g} Hz, not {low:.5g} to "
        f"{high:.5g} Hz, which it does from {60 * low / order:.5g} to {60 * high / order:.5g} rpm: leave wheel.speed "
        'out and set wheel.sweep = "speed", or set it to "frequency" if the speed is meant to stay'
    ]


def _free(system: SecondOrderSystem) -> bool:
    """Whether a reduced structure moves as a rigid body but for rounding."""
    if not isinstance(system.stiffness, np.ndarray):
        return False
    squares = lowest_squares(system.stiffness, system.mass, min(13, len(system.mass)))
    return bool(abs(squares[0]) < TYPICAL.rigid * squares[-1])


def check_deflection(
    scene: MeshScene, system: SecondOrderSystem, largest: Callable[[np.ndarray], float], size: float
) -> list[str]:
    """A remark where a load, alone and with the contact open, bends the part beyond a linear model.

    Static loads by their static deflection; harmonic ones by the resonances in the range of the response, with the
    modal damping of the scene. A structure that contact alone holds is not checked.
    system : full or reduced, without contact; largest : of its coordinates -> largest displacement [m]; size : [m]"""
    displacement: dict[str, tuple[float, str]] = {}
    try:
        solve = _solver(system.stiffness)
    except (SingularStiffness, LinAlgError):  # nothing holds it but the contact
        return []
    if _free(system):
        return []
    for name, load in {**scene.loads.static, **scene.loads.harmonic}.items():
        if name in system.loads:
            displacement[name] = (largest(solve(system.loads[name] * load.amplitude)), "at rest")
    ratio = np.min(scene.damping.modal or 0.0)
    if ratio > 0 and scene.response.frequency:
        omega, phi = modes(system.stiffness, system.mass, min(TYPICAL.modes, system.mass.shape[0]))
        low, high = (2 * np.pi * f for f in scene.response.frequency)
        for name, load in scene.loads.harmonic.items():
            force = system.loads[name] * load.amplitude if name in system.loads else 0.0 * phi[:, 0]
            for i in np.flatnonzero((omega * load.harmonic >= low) & (omega <= high * load.harmonic) & (omega > 0)):
                swing = largest(phi[:, i] * (phi[:, i] @ force) / (2 * ratio * omega[i] ** 2))
                displacement[name] = max(
                    displacement.get(name, (0.0, "")), (swing, f"at its resonance of {omega[i] / (2 * np.pi):.4g} Hz")
                )
    name, (most, where) = max(displacement.items(), key=lambda item: item[1][0], default=("", (0.0, "")))
    if most <= TYPICAL.bent * size:
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
