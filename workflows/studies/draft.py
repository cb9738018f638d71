"""A scene begun from a file: its bodies, its groups, faces that may touch, all that is guessed said so in a comment."""

import json
import os
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import scipy

from tribodyn.consent import asks_consent
from tribodyn.fem.assembly import group_name
from tribodyn.geometry.sources import cad, foreign_file as sources
from tribodyn.geometry.sources.face_rules import outline
from tribodyn.output_file import write_text
from tribodyn.refusal import Refusal
from tribodyn.workflows.scene.json_schema import json_schema
from tribodyn.workflows.scene.scene_file import AnyPath
from tribodyn.workflows.studies.study_result import StudyResult

SCHEMA = "scene.schema.json"


@dataclass(frozen=True)
class Limits:
    """What is taken for a contact, and for a file in metres.

    distance : distance over the size of the whole; opposed : cosine of the normals; share : of the facets of a face
    longest : of a part in metres [m], beyond which a file is taken to be in millimetres"""

    distance: float = 0.01
    opposed: float = -0.7
    share: float = 0.1
    longest: float = 3.0


LIMITS = Limits()


@dataclass(frozen=True)
class Candidate:
    """Two faces that may touch: "body.face" of each, least distance [m], share of the smaller one that is near.

    normal : of the first face, outward; declared : whether the deck has them as a contact pair; friction : of it"""

    first: str
    second: str
    distance: float
    share: float
    normal: tuple[float, float, float]
    declared: bool = False
    friction: float | None = None


@dataclass(frozen=True, repr=False)
class Draft(StudyResult):
    """A scene and what it is made of.

    text, name : of the scene; unit : of length in the file, unit_reason : where it comes from
    candidates : pairs of faces that may touch, best first"""

    file: Path
    text: str
    name: str
    unit: str
    unit_reason: str
    bodies: Mapping[str, Sequence[str]]
    candidates: tuple[Candidate, ...]

    def record(self) -> dict[str, Any]:
        pairs = [vars(candidate) for candidate in self.candidates]
        return {"unit": self.unit, "bodies": dict(self.bodies), "candidates": pairs, "scene": self.text}

    def lines(self) -> list[str]:
        texts = [f"unit      {self.unit}: {self.unit_reason}"]
        texts += [f"body      {name}: groups {', '.join(groups) or 'none'}" for name, groups in self.bodies.items()]
        texts += [f"contact   {_describe(candidate)}" for candidate in self.candidates]
        return texts if self.candidates else [*texts, "contact   no two faces of different bodies are near each other"]

    def write(self, folder: Path) -> list[Path]:
        """Write the scene and, beside it, the schema by which editors complete and check its keys."""
        scene, schema = folder / f"{self.name}.toml", folder / SCHEMA
        if scene.exists():
            raise Refusal(f"{scene} is there already: move it, or give another folder with --out")
        folder.mkdir(parents=True, exist_ok=True)
        place = Path(os.path.relpath(self.file, folder)).as_posix()
        write_text(scene, self.text.replace(json.dumps(self.file.name), json.dumps(place)))
        write_text(schema, json.dumps(json_schema(), indent=1))
        return [scene, schema]


@asks_consent
def draft(file: AnyPath, *, unit: str | None = None, allow_scripts: bool = False) -> Draft:
    """Write a commented scene that begins from a mesh, a deck or a CAD file, and the schema of scenes for editors.

    file : file of a mesh, a deck or a CAD program
    unit : unit of length of the file: m, mm, cm, um, in, ft; guessed and said by default
    allow_scripts : run a drawing (.geo)
    Raises  Refusal: the file cannot be read, one sentence"""
    path = Path(file)
    if path.suffix.lower() not in sources.ENDINGS:
        raise Refusal(f'"{file}" is no mesh, deck or CAD file: its ending is none of {", ".join(sources.ENDINGS)}')
    raw = sources.read(path, "m" if unit is None else unit)
    reason = "as given"
    if unit is None:
        unit, reason = _guessed(raw, path)
    source = raw if unit == "m" else sources.read(path, unit)
    candidates = tuple(_candidates(source))
    groups = {name: sorted(body.node_sets) for name, body in source.bodies.items()}
    is_deck = bool(source.deck.materials or source.deck.supports)
    text = "\n".join(_text(path, source, unit, reason, candidates, is_deck)) + "\n"
    return Draft(path, text, path.stem.replace(".", "_"), unit, reason, groups, candidates)


def _guessed(source: Any, path: Path) -> tuple[str, str]:
    """The unit of length of a file and why, from its kind and its size."""
    points = np.concatenate([body.mesh.doflocs for body in source.bodies.values()], axis=1)
    longest = float(np.ptp(points, axis=1).max())
    if path.suffix.lower() in cad.ENDINGS:
        return "mm", f"guessed, as CAD files are in mm; the whole is then {longest:.4g} mm long"
    if longest > LIMITS.longest:
        return "mm", f"guessed: in metres the whole would be {longest:.4g} m long"
    return "m", f"guessed: the whole is then {longest:.4g} m long"


def _candidates(source: Any) -> Iterator[Candidate]:
    """Pairs of named faces of different bodies that are near each other and look at each other, nearest first."""
    points = np.concatenate([body.mesh.doflocs for body in source.bodies.values()], axis=1)
    reach = LIMITS.distance * float(np.linalg.norm(np.ptp(points, axis=1)))
    faces = []
    for body, solid in source.bodies.items():
        facets, centre, normal = outline(solid.mesh)
        corners = solid.mesh.p[:, solid.mesh.facets[:, facets]]
        wide = np.linalg.norm(np.ptp(corners, axis=1), axis=0)
        for name, facets_of_group in (solid.mesh.boundaries or {}).items():
            of = np.isin(facets, facets_of_group)
            if of.any():
                faces.append((body, name, {*facets[of].tolist()}, centre[of], normal[of], wide[of], of.all()))
    contacts = {frozenset((contact.slave, contact.master)): contact for contact in source.deck.contacts}
    matches = []
    for first, second in combinations(faces, 2):
        contact, match = contacts.get(frozenset((first[1], second[1]))), _meet(first[3:6], second[3:6], reach)
        is_guess = match is not None and first[0] != second[0] and not (first[6] or second[6])  # a whole skin is none
        if contact is not None or is_guess:
            matches.append((match, contact, first, second))
    meeting = [contact for match, contact, *_ in matches if match is not None]
    pairs = []
    for match, contact, first, second in matches:
        if match is None and contact not in meeting:  # where no two faces meet by these limits, all that the deck means
            match = _meet(first[3:6], second[3:6], np.inf, 0.0)
        if match is not None:
            names = [group_name(body, face, source.bodies[body].node_sets) for body, face, *_ in (first, second)]
            friction = None if contact is None else contact.friction
            pairs.append((Candidate(names[0], names[1], *match, contact is not None, friction), first, second))
    used_facets: dict[tuple[str, str], set[int]] = defaultdict(set)  # bodies that touch -> facets of the first one
    for pair, first, second in sorted(pairs, key=lambda p: (not p[0].declared, -round(p[0].share, 2), p[0].distance)):
        ends = ((used_facets[first[0], second[0]], first[2]), (used_facets[second[0], first[0]], second[2]))
        if pair.declared or all(used.isdisjoint(facets_of_group) for used, facets_of_group in ends):
            for used, facets_of_group in ends:  # groups that overlap it are no further guess
                used |= facets_of_group
            yield pair


def _meet(first: Any, second: Any, distance: float, least: float = LIMITS.share) -> tuple[float, float, Any] | None:
    """Least distance of two faces [m], share of the smaller one near, normal there; None where they are apart.

    least : share that must be near"""
    (centre, normal, wide), (places, normals, widths) = first, second
    _, at = scipy.spatial.cKDTree(places).query(centre)
    offset = places[at] - centre
    gap = np.abs((offset * normal).sum(axis=1))
    sideways = np.linalg.norm(offset - (offset * normal).sum(axis=1)[:, None] * normal, axis=1)
    good = (
        ((normal * normals[at]).sum(axis=1) < LIMITS.opposed)
        & (gap < distance)
        & (sideways < np.maximum(wide, widths[at]))
    )
    share = good.sum() / min(len(centre), len(places))
    if share < least:
        return None
    good = good if good.any() else np.ones(len(centre), bool)
    mean = normal[good].mean(axis=0)
    return float(gap[good].min()), float(min(share, 1.0)), tuple((mean / np.linalg.norm(mean)).round(3).tolist())


def _describe(pair: Candidate) -> str:
    return f"{pair.first} and {pair.second}: {1e3 * pair.distance:.3g} mm apart, {pair.share:.0%} of it near" + (
        ", a contact pair of the deck" if pair.declared else ""
    )


def _text(
    path: Path, source: Any, unit: str, reason: str, candidates: Sequence[Candidate], is_deck: bool
) -> Iterator[str]:
    yield f"#:schema ./{SCHEMA}"
    yield f"# Begun from {path.name} by tribodyn new. What is marked GUESS is a place holder: replace it by your own."
    yield from ("", "[scene]", f"title = {json.dumps(path.stem)}", "")
    if is_deck:
        yield from (f"[decks.{_key(path.stem)}]", f"file = {json.dumps(path.name)}")
        yield f'unit = "{unit}"  # {reason}'
        yield "# its bodies, materials, ties, supports and loads come along; groups are named as follows"
    else:
        yield from ("[materials.steel]  # GUESS", 'young = "210 GPa"', 'density = "7850 kg/m3"')
    first_face = _far(source, candidates)
    for at, (name, body) in enumerate(source.bodies.items()):
        faces = sorted(body.mesh.boundaries or {}) or sorted(body.node_sets)
        if is_deck:
            named = [group_name(name, group, body.node_sets) for group in body.node_sets if group != name]
            named = [group for group in named if not group.removeprefix(f"{name}.").startswith("_")]  # Abaqus's own
            yield f"# {name}: {', '.join(named) or 'no group'}"
            continue
        yield from ("", f"[bodies.{_key(name)}]", f"mesh = {json.dumps(path.name)}")
        if len(source.bodies) > 1:
            yield f"volume = {json.dumps(name)}"
        yield from (f'unit = "{unit}"  # {reason}', 'material = "steel"')
        if at == 0 and faces:
            yield f"fixed = [{json.dumps(first_face[name])}]  # GUESS; its groups: {', '.join(body.node_sets)}"
        else:
            yield f"# its groups: {', '.join(body.node_sets) or 'none'}"
    for number, pair in enumerate(candidates, 1):
        yield from ("", f"[contacts.joint_{number}]  # {_describe(pair)}")
        yield from (f"first = {json.dumps(pair.first)}", f"second = {json.dumps(pair.second)}")
        yield from ('tangential_stiffness = "100 N/um"  # GUESS', 'normal_stiffness = "100 N/um"  # GUESS')
        yield "friction = 0.5  # GUESS" if pair.friction is None else f"friction = {pair.friction}  # of the deck"
    fixed = {name for name, body in source.bodies.items() for s in source.deck.supports if s.group in body.node_sets}
    loaded = [*fixed, *(name for name in source.bodies if name not in fixed)][-1]
    face = json.dumps(group_name(loaded, first_face[loaded], source.bodies[loaded].node_sets))
    ends = [(pair, end) for pair in candidates for end in (pair.first, pair.second) if end.startswith(f"{loaded}.")]
    if ends and not (source.deck.forces or source.deck.pressures):
        pair, end = ends[0]
        towards = [(1 if end == pair.first else -1) * component + 0.0 for component in pair.normal]
        yield from ("", "[loads.static.press]  # GUESS: presses the faces together, the drive shall not lift them")
        yield from (f"group = {json.dumps(end)}", f"direction = {towards}", 'value = "1 kN"')
    yield from ("", "[loads.harmonic.drive]  # GUESS", f"group = {face}", 'direction = "x"', 'value = "10 N"')
    yield from ("", "[response]", 'frequency = ["100 Hz", "1 kHz"]  # GUESS; a run says its modes, open and stuck')
    yield from ("", "[damping]", 'modal = "1 %"  # GUESS', "", "# [wear]  # take the marks off to let it wear")
    yield from ('# coefficient = "2e3 um3/J"', '# step = "1 um"', "# max_steps = 20", '# at = "peak"')


def _key(name: str) -> str:
    return name if name.replace("_", "").replace("-", "").isalnum() else json.dumps(name)


def _far(source: Any, candidates: Sequence[Candidate]) -> dict[str, str]:
    """Of each body the face that is farthest from what touches, to hold or to shake it."""
    touching = {name for pair in candidates for name in (pair.first, pair.second)}
    farthest = {}
    for body, solid in source.bodies.items():
        mesh, groups = solid.mesh, solid.node_sets
        names = {name: group_name(body, name, groups) for name in groups}
        touching_points = [mesh.doflocs[:, nodes] for name, nodes in groups.items() if names[name] in touching]
        centre = np.concatenate(touching_points, axis=1).mean(axis=1) if touching_points else mesh.doflocs.mean(axis=1)
        far = {
            name: np.linalg.norm(mesh.doflocs[:, groups[name]].mean(axis=1) - centre)
            for name in mesh.boundaries or groups
            if name in groups and names[name] not in touching
        }
        farthest[body] = max(far, key=lambda name: far[name], default=next(iter(groups), "NAME"))
    return farthest
