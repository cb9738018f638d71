"""What a file or a scene holds, before it is computed: sizes, masses, groups, gaps, free modes, sanity checks."""

from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from itertools import product
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np

from tribodyn.consent import asks_consent
from tribodyn.fem.assembly import Assembly, Body, group_name
from tribodyn.fem.couplings import Tie
from tribodyn.fem.elasticity import assemble, densities
from tribodyn.fem.material import Material
from tribodyn.fem.modes import StaticDivergence, modes, stiffest
from tribodyn.geometry.mesh import area, facts
from tribodyn.geometry.sources import foreign_file as sources
from tribodyn.geometry.sources.deck import Deck
from tribodyn.reduction.sector_reduction import wave_frequencies
from tribodyn.refusal import Refusal
from tribodyn.workflows.pictures import groups as group_pictures
from tribodyn.workflows.result.number_format import named_lines
from tribodyn.workflows.run import deck_bodies, decks, modelling, sanity_checks, scene_assembly, sector
from tribodyn.workflows.run.progress import Progress
from tribodyn.workflows.scene import scene_file
from tribodyn.workflows.scene.fields import Number, Pressure, quantity
from tribodyn.workflows.scene.scene_file import AnyPath, Overrides, read_scene
from tribodyn.workflows.scene.schema import has_wheel
from tribodyn.workflows.scene.structure_tables import DeckTable
from tribodyn.workflows.studies.study_result import StudyResult


@dataclass(frozen=True, repr=False)
class Inspection(StudyResult):
    """What was found, in SI units; see `record` for the fields. solids : the bodies, material {} where none is known"""

    solids: tuple[Body, ...]
    size: np.ndarray
    volume: float
    mass: float | None
    centre: np.ndarray
    bodies: Mapping[str, Mapping[str, Any]]
    groups: Mapping[str, Mapping[str, Any]]
    worst: Mapping[str, Any]
    unused: tuple[str, ...] = ()
    refused: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    pairs: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    gaps: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    frequencies: tuple[float, ...] = ()
    remarks: tuple[str, ...] = ()

    def record(self) -> dict[str, Any]:
        return {
            "size_m": self.size.tolist(),
            "mass_kg": self.mass,
            "volume_m3": self.volume,
            "centre_m": self.centre.tolist(),
            "bodies": dict(self.bodies),
            "groups": dict(self.groups),
            "unused": list(self.unused),
            "refused": list(self.refused),
            "worst_element": dict(self.worst),
            "pairs": dict(self.pairs),
            "gaps": dict(self.gaps),
            "frequencies_hz": list(self.frequencies),
            "notes": list(self.notes),
            "remarks": list(self.remarks),
        }

    def lines(self) -> list[str]:
        mass = "not known, no density is given" if self.mass is None else f"{self.mass:.6g} kg"
        lines = [
            ("size", " x ".join(f"{1e3 * x:.6g}" for x in self.size) + " mm"),
            ("volume", f"{1e6 * self.volume:.6g} cm3"),
            ("mass", mass),
            ("centre", f"({', '.join(f'{1e3 * x:.5g}' for x in self.centre)}) mm"),
        ]
        lines += [("body", f"{n}: {b['elements']} {b['kind']}, {b['nodes']} nodes") for n, b in self.bodies.items()]
        for name, group in self.groups.items():
            wide = f", {1e6 * group['area_m2']:.5g} mm2" if group["area_m2"] else ""
            lines.append(("group", f"{name}: {group['nodes']} nodes{wide}"))
        at = ", ".join(f"{1e3 * x:.4g}" for x in self.worst["centre_m"])
        lines.append(("worst element", f"scaled Jacobian {self.worst['scaled_jacobian']:.3g} at ({at}) mm"))
        for name, pair in self.pairs.items():
            shared, area = (1e6 * pair[key] for key in ("shared_m2", "area_m2"))
            low, high = (1e3 * pair[key] for key in ("least_m", "largest_m"))
            gap = f"opening {low:.3g} to {high:.3g} mm, overlap where negative"
            turned = f"{pair['angle_deg']:.3g} degrees off face to face"
            lines.append(("pair", f"{name}: {shared:.4g} of {area:.4g} mm2 shared, {gap}; {turned}"))
        for name, between in self.gaps.items():
            lines.append(("gap", f"{name}: {1e6 * between['least_m']:.4g} to {1e6 * between['largest_m']:.4g} um"))
        if self.frequencies:
            lines.append(("modes", ", ".join(f"{f:.5g}" for f in self.frequencies) + " Hz"))
        lines += [("done", sentence) for sentence in self.notes]
        lines += [("not used", clause) for clause in self.unused]
        lines += [("refused", clause) for clause in self.refused]
        return named_lines(lines + [("warning", sentence) for sentence in self.remarks])

    def write(self, folder: Path) -> list[Path]:
        """Write groups.png: the groups in colour."""
        folder.mkdir(parents=True, exist_ok=True)
        group_pictures.draw(self.solids, folder / "groups.png")
        return [folder / "groups.png"]


@asks_consent
def inspect(
    source: AnyPath, *, unit: str = "m", young: Pressure | None = None, poisson: Number = 0.3,
    density: Annotated[float | None, quantity("kg/m3")] = None, modes: int = 0, free: bool = False,
    elements: Literal["deck", "quadratic", "linear_bbar", "linear_reduced"] = "deck", allow_scripts: bool = False,
    overrides: Overrides = (), progress: Progress | None = None,
) -> Inspection:  # fmt: skip
    """Show what a mesh, a deck, a CAD file or a scene holds: size, mass, bodies, groups, worst element, gaps, warnings.

    source : a file of a mesh, a deck or a CAD program, a scene's name, or a .toml file
    unit : unit of length of a file: m, mm, cm, um, in, ft
    young : Young's modulus of a file that gives no material, such as 210GPa
    poisson : Poisson's ratio likewise
    density : density likewise, such as "7860 kg/m3"
    modes : number of natural frequencies to compute, free of contact; what a deck or a scene says joins and holds
    free : of the bodies of a file by themselves, each free in space
    elements : how hexahedra of first order are computed: as a deck names them, raised to second order, with the mean
        dilatation, or reduced
    allow_scripts : run a drawing (.geo), or a Python file that makes the part of a scene
    Raises  Refusal: what cannot be, one sentence"""
    if modes < 0:
        raise Refusal(f"--modes {modes}: give a number of modes, 0 for none")
    if (young is None) != (density is None):
        raise Refusal("--young and --density go together: give both or none")
    material = None if young is None or density is None else Material(young, poisson, density)
    if Path(source).suffix.lower() in sources.ENDINGS:
        return _of_file(Path(source), unit, elements, material, modes, free, progress or Progress())
    scene = read_scene(source, overrides)
    if unit != "m" or material is not None or elements != "deck":
        raise Refusal("--unit, --young, --poisson, --density and --elements are for files: a scene has its own")
    return _of_scene(scene, modes, progress or Progress())


def _of_file(
    path: Path, unit: str, elements: Any, material: Material | None, n_modes: int, free: bool, progress: Progress
) -> Inspection:
    with progress.stage("reading"):
        source = deck_bodies.source(path, unit)
    named = {"given": material} if material is not None else {}
    material_name = next(iter(named), None)
    table = DeckTable(file=path.name, unit=sources.UNITS[unit][0], material=material_name, elements=elements)
    solids, lacking = [], ""
    for name, body in source.bodies.items():
        form = deck_bodies.elements_of(source, table, name)
        mesh, node_sets = deck_bodies.with_elements(body.mesh, dict(body.node_sets), form, name)
        try:
            material_of_body = deck_bodies.material(source.deck, name, mesh, table, named, form)
        except Refusal as sentence:  # no or no whole material
            material_of_body, lacking = {}, str(sentence)
        solids.append(Body(name, mesh, node_sets, material_of_body))
    inspection = measured(solids, deck_bodies.notes_of(source, table), source.unused)
    pairs, separate, remarks = _pairs_of(source.deck, solids)
    ignored = (f"{clause}, which a scene has to ignore by name" for clause in source.refused.values())
    inspection = replace(inspection, pairs=pairs, refused=(*ignored, *separate))
    if n_modes:
        if material is None and not any(entry.groups for entry in source.deck.materials):
            raise Refusal(f"{path} gives no material to compute modes with: give --young, --poisson and --density")
        if lacking:
            raise Refusal(f"{path}: {lacking}")
        if free or replace(source.deck, contacts=()) == Deck(materials=source.deck.materials):
            inspection = replace(inspection, frequencies=_free_frequencies(solids, n_modes, progress))
        else:
            with progress.stage("mass and stiffness"):
                part = decks.part(path.stem, table, named, path.parent)
            with progress.stage("modes"):
                inspection = replace(
                    inspection, frequencies=_frequencies(part.system.mass, part.system.stiffness, n_modes)
                )
    hint = 'give --unit mm (in a scene: unit = "mm")'
    remarks += [*sanity_checks.check_size(inspection.size, hint), *sanity_checks.check_materials(solids)]
    remarks += sanity_checks.check_thickness(solids)
    remarks += scene_assembly.overlaps(solids)
    if not free:
        remarks += sanity_checks.check_modes(inspection.frequencies)
    return replace(inspection, remarks=tuple(remarks))


def _pairs_of(of: Deck, solids: Sequence[Body]) -> tuple[dict[str, dict[str, float]], list[str], list[str]]:
    """How the faces of ties and contact pairs of a deck meet.

    Returns for each pair the area that is shared and that of the first face [m2], the least and largest opening [m],
        negative where they overlap, the angle between them [degrees]; sentences on pairs that share nothing; remarks
        on those that are an opening apart"""
    assembly = Assembly(solids)
    meetings: dict[str, dict[str, float]] = {}
    refused: list[str] = []
    remarks: list[str] = []
    for kind, pair in [*(("tie", tie) for tie in of.ties), *(("contact", c) for c in of.contacts)]:
        name = f"{kind} '{pair.name}'"
        first, second = (
            [
                face
                for solid in solids
                if (face := group_name(solid.name, group, solid.node_sets)) in assembly.boundaries
                and group in solid.node_sets
            ]
            for group in (pair.slave, pair.master)
        )
        slaves = [solid.mesh for solid in solids if pair.slave in (solid.mesh.boundaries or {})]
        matches, trouble = [], f"{name}: its sets are no faces of elements: give surfaces"
        for ends in product(first, second):
            try:
                matches.append(Tie(name, *ends, pair.tolerance).meeting(assembly))
            except Refusal as sentence:
                trouble = str(sentence)
        if not matches:
            (refused if kind == "tie" else remarks).append(trouble)
            continue
        gaps = np.concatenate([shared.gap for *_, shared in matches])
        facing = [(a.normal[s.first] * b.normal[s.second]).sum(axis=1) @ s.weight for a, b, s in matches]
        shared = sum(float(match.weight.sum()) for *_, match in matches)
        meetings[name] = {
            "shared_m2": shared,
            "area_m2": sum(area(mesh, mesh.boundaries[pair.slave]) for mesh in slaves),
            "least_m": float(gaps.min()),
            "largest_m": float(gaps.max()),
            "angle_deg": float(np.degrees(np.arccos(np.clip(-sum(facing) / shared, -1.0, 1.0)))),
        }
        remarks += sanity_checks.check_opening(name, gaps, matches[0][0].length)
    return meetings, refused, remarks


def _frequencies(M: Any, K: Any, count: int) -> tuple[float, ...]:
    """The lowest natural frequencies of mass and stiffness [Hz]; 0 where they are rounding."""
    shift = 1e-9 * stiffest(K, M)  # K alone is singular where something can move rigidly
    omega, _ = modes(K, M, min(count, M.shape[0]), sigma=-shift)
    omega[omega**2 < 1e-5 * shift] = 0.0
    return tuple((omega / (2 * np.pi)).tolist())


def _free_frequencies(solids: Sequence[Body], count: int, progress: Progress) -> tuple[float, ...]:
    """The lowest natural frequencies of bodies that nothing holds [Hz]."""
    frequencies: list[float] = []
    for solid in solids:
        with progress.stage(f"modes of {solid.name}"):
            frequencies += _frequencies(*assemble(solid.mesh, solid.material), count)
    return tuple(sorted(frequencies)[:count])


def _of_scene(file: scene_file.SceneFile, n_modes: int, progress: Progress) -> Inspection:
    part = modelling.part_of(file, progress)
    inspection = of_part(file, part)
    if n_modes:
        with progress.stage("modes"):
            scene, at_rest = file.mesh_scene, True
            if has_wheel(scene) and scene.wheel.speed:
                with suppress(StaticDivergence):  # rotation carries away what only the contact holds
                    frequencies = tuple(wave_frequencies(sector.sector(scene, part).system, n_modes).tolist())
                    at_rest = False
            if at_rest:
                frequencies = _frequencies(part.system.mass, part.system.stiffness, n_modes)
        remarks = (*inspection.remarks, *sanity_checks.check_modes(frequencies))
        if at_rest and scene.wheel is not None and scene.wheel.speed:
            remarks += ("modes are those at rest: at wheel.speed only the contact holds some body, see wheel modes",)
        inspection = replace(inspection, frequencies=frequencies, remarks=remarks)
    return inspection


def of_part(file: scene_file.SceneFile, part: Any) -> Inspection:
    """The facts of a part of a scene that is assembled already."""
    scene = file.mesh_scene
    solids = [replace(body, name=body.name or file.name) for body in part.mesh.bodies]
    inspection = measured(solids, sanity_checks.notes(file, part))
    gap = np.asarray(part.interface.gap)
    gaps = {
        name: {"least_m": float(gap[pairs].min()), "largest_m": float(gap[pairs].max())}
        for name, pairs in part.pairs.items()
        if gap[pairs].size
    }
    remarks = [
        *sanity_checks.remarks_on_part(file, part),
        *sanity_checks.check_deflection(scene, part.system, part.largest, float(np.linalg.norm(inspection.size))),
    ]
    return replace(inspection, gaps=gaps, remarks=tuple(remarks))


def measured(solids: Sequence[Body], sentences: Iterable[str] = (), unused: Iterable[str] = ()) -> Inspection:
    """Sizes, volumes, masses, groups and the worst element of bodies."""
    all_facts = {s.name: facts(s.mesh, densities(s.mesh, s.material) if s.material else None) for s in solids}
    volume = sum(body_facts.volume for body_facts in all_facts.values())
    masses = [body_facts.mass for body_facts in all_facts.values() if body_facts.mass is not None]
    mass = sum(masses) if len(masses) == len(solids) else None
    weights = masses if mass else [all_facts[s.name].volume for s in solids]
    centre = np.average([all_facts[s.name].centre for s in solids], axis=0, weights=weights)
    low = np.min([body_facts.low for body_facts in all_facts.values()], axis=0)
    high = np.max([body_facts.high for body_facts in all_facts.values()], axis=0)
    bodies, groups = {}, {}
    for solid in solids:
        body_facts = all_facts[solid.name]
        bodies[solid.name] = {
            "elements": solid.mesh.nelements,
            "kind": "hexahedra" if solid.mesh.t.shape[0] == 8 else "tetrahedra",
            "nodes": solid.mesh.doflocs.shape[1],
            "volume_m3": body_facts.volume,
            "mass_kg": body_facts.mass,
            "centre_m": body_facts.centre.tolist(),
        }
        faces = solid.mesh.boundaries or {}
        for name, nodes in solid.node_sets.items():
            key = name if len(solids) == 1 or name not in groups else f"{solid.name}.{name}"
            wide = area(solid.mesh, faces[name]) if name in faces else 0.0
            groups[key] = {"area_m2": wide, "nodes": len(nodes)}
    name = min(all_facts, key=lambda key: all_facts[key].scaled_jacobian)
    worst = {
        "body": name,
        "scaled_jacobian": all_facts[name].scaled_jacobian,
        "centre_m": all_facts[name].worst_centre.tolist(),
    }
    return Inspection(
        tuple(solids), high - low, volume, mass, centre, bodies, groups, worst, tuple(unused), notes=tuple(sentences)
    )
