"""The bladed disk from its scene: wear to loss of contact, the field of the sector, its pictures, bad scenes."""

import numpy as np
import pytest
import scipy.linalg as sla

from tests.helpers.coarse_scenes import BLADE as COARSE
from tests.helpers.nodes_of_pairs import node_of_pair
from tests.helpers.pictures import assert_not_blank
from tribodyn.fem.constraints import find_group
from tribodyn.fem.elasticity import assemble
from tribodyn.geometry.placement import rotation
from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.hbm.linear.travelling_wave import at_sector
from tribodyn.hbm.outcome import WearEnd
from tribodyn.reduction.sector_reduction import nodal_diameters
from tribodyn.workflows.pictures import render, render_wheel
from tribodyn.workflows.report import text
from tribodyn.workflows.result import store
from tribodyn.workflows.result.faces import meetings_of
from tribodyn.workflows.run import modelling, part_reduction, pipeline, planning, sector
from tribodyn.workflows.run.progress import Progress
from tribodyn.workflows.scene import scene_file


def built(folder, *overrides):
    return modelling.build(scene_file.read("blade_thesis", (*COARSE, *overrides)), Progress())


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("blade")


@pytest.fixture(scope="module")
def finished(folder):
    return pipeline.run(scene_file.read("blade_thesis", COARSE), folder, Progress())


def test_wear_goes_on_until_the_blades_are_free(finished):
    wear, patch = finished.wear, finished.patch
    assert wear.ended in (WearEnd.LOST, WearEnd.FADED)
    assert wear.preload[-1] < 1e-6 * wear.preload[0]
    assert len(patch.area) == 20
    assert patch.area.sum() == pytest.approx(20e-3 * 30e-3)
    assert wear.depth[-1] @ patch.area == pytest.approx(2e-15 * wear.work.sum(), rel=1e-12)
    # delta_max is that of one face; both close, and what is left is the swing of free blades
    delta = finished.facts.delta_max
    assert delta == pytest.approx(0.5 * patch.free_deflection @ patch.area / patch.area.sum())
    assert delta == pytest.approx(2.7e-3, rel=0.05)
    assert 2 * delta < wear.depth[-1].max() < 4 * delta
    # wear of shrouds lowers the frequency and raises the response, to those of the free blade
    hertz = wear.omega / (2 * np.pi)
    assert hertz[0] > 1.5 * hertz[-1]
    assert hertz[-1] == pytest.approx(finished.facts.open_frequencies[0], rel=1e-3)
    assert wear.amplitude[-1] > 10 * wear.amplitude[0]
    assert wear.amplitude[-1] == pytest.approx(finished.references.free.max(), rel=0.1)  # on a grid of 0.6 Hz


def test_result_is_kept_and_told(finished, folder):
    loaded = store.load(folder / "result.h5")
    assert loaded.facts.around.sectors == 40
    assert "40 sectors, engine order 1" in text.brief(loaded)[1]


def test_field_of_the_sector_meets_its_neighbour(finished):
    """From the displacement of all nodes: what the right face sees of the left face of the blade behind is x."""
    wear, patch, part, fields = finished.wear, finished.patch, finished.part, finished.fields
    wheel = finished.facts.around
    remaining = node_of_pair(meetings_of(finished)[0].faces[1])
    assert part.points[remaining] == pytest.approx(wheel.sector(patch.points, 1), abs=1e-12)
    basis = HarmonicBasis((0, 1))
    for row, field in zip(fields.row, fields.displacement, strict=True):
        previous = at_sector(basis, field, 1, 40, -1)[remaining]
        relative = field[patch.nodes] - np.einsum("xy,pyc->pxc", wheel.turn.T, previous)
        local = np.einsum("pij,pjc->pic", patch.frames, relative)
        solved = wear.displacement[row].reshape(local.shape)
        assert np.abs(local - solved).max() < 1e-7 * np.abs(solved).max()


def test_left_and_right_face_agree(finished):
    """Item 5: the left contact is the right one a phase later, so preload, work and wear of the two are one."""
    basis = HarmonicBasis((0, 1))
    for row in range(len(finished.wear.cycles)):
        x, force = finished.wear.displacement[row], finished.wear.force[row]
        shifted, pushed = (at_sector(basis, values, 1, 40, 1) for values in (x, force))
        work = basis.work_per_cycle(force, x)
        rounding = 1e-9 * np.abs(work).max() + 1e-12
        assert basis.work_per_cycle(pushed, shifted) == pytest.approx(work, rel=1e-9, abs=rounding)
        assert pushed[:, 0] == pytest.approx(force[:, 0], abs=1e-12)


def test_forces_on_both_faces_balance_in_the_full_sector(finished, folder):
    """Item 5, from the unreduced stiffness and the static field alone: what the two shrouds of a blade are pushed with.

    Equal preload and shear on both faces; over the wheel the shrouds turn nothing, so the roots take no torque"""
    model = built(folder)
    wheel, patch, wear = finished.facts.around, finished.patch, finished.wear
    _, K = assemble(model.part.mesh, part_reduction.material(model_scene()))
    remaining = node_of_pair(meetings_of(finished)[0].faces[1])
    clamp = find_group(model.part.node_sets, "clamp")
    row = int(finished.fields.row[0])
    field = finished.fields.displacement[0, ..., 0]
    force = (K @ field.ravel()).reshape(field.shape)  # that acts on each node from outside
    frames = patch.frames
    on_right = np.einsum("pij,pj->pi", frames, force[patch.nodes])  # by the blade behind, in the frame of this face
    on_left = np.einsum("pij,pj->pi", frames, force[remaining] @ wheel.turn)  # by the next, turned back to it
    solved = wear.force[row].reshape(len(frames), 3, -1)[..., 0]
    scale = np.abs(solved).max()
    assert np.abs(on_right + solved).max() < 1e-6 * scale
    assert np.abs(on_left - solved).max() < 1e-6 * scale
    assert -on_right[:, 2].sum() == pytest.approx(on_left[:, 2].sum()) == pytest.approx(wear.preload[row])

    def torque(nodes):
        return np.cross(finished.part.points[nodes], force[nodes]).sum(axis=0) @ wheel.axis

    each = np.abs(np.cross(finished.part.points[patch.nodes], force[patch.nodes])).sum()
    assert abs(torque(patch.nodes)) > 0.1 * each
    assert abs(torque(patch.nodes) + torque(remaining)) < 1e-7 * each
    assert abs(torque(clamp)) < 1e-6 * each


def model_scene():
    return scene_file.read("blade_thesis", COARSE).mesh_scene


def test_every_blade_has_its_phase(finished):
    wheel, field = finished.facts.around, finished.fields.displacement[0]
    shifted = np.stack(list(render_wheel.instants(wheel, (0, 1), field)))
    assert shifted.shape == (40, *field.shape[:2])
    assert shifted[0] == pytest.approx(field[..., 1])  # cos at the start of the period
    assert shifted[10] == pytest.approx(-field[..., 2], abs=1e-12)  # a quarter of the wheel on, a quarter period late
    assert np.abs(shifted.sum(axis=0)).max() < 1e-12


def test_pictures(finished, tmp_path):
    written = render.draw(finished, tmp_path, dpi=60)
    assert {path.stem for path in written} == {"part", "contact", "wheel"}
    for path in written:
        assert_not_blank(path)


def test_worn_face_sinks_between_its_pairs_too(finished):
    patch, part = finished.patch, finished.part
    depth = 1e-3 + 0.1 * (patch.flat[:, 0] - patch.flat[:, 0].min())
    right = meetings_of(finished)[0].faces[0]
    shifted = 2 * right.worn_off(depth, len(part.points))  # half of the depth belongs to each face
    on_face = np.flatnonzero(shifted.any(axis=1))
    assert len(on_face) == (2 * 5 - 1) * (2 * 4 - 1)  # all nodes of the second-order face
    flat = (part.points[on_face] - patch.points.mean(0)) @ patch.frames[0, 0]
    expected = 1e-3 + 0.1 * (flat - patch.flat[:, 0].min())
    assert np.linalg.norm(shifted[on_face], axis=1) == pytest.approx(expected, rel=1e-6)


def test_damping_of_every_harmonic(folder):
    """1 % in the modes of the index that each harmonic sees, free or stuck."""
    for state in ("free", "stuck"):
        model = built(folder, f"damping.state={state}", "wheel.engine_order=5").reduced
        springs = model.interface.stiffness(93e6, 113e6).ravel() if state == "stuck" else np.zeros(60)
        for h in (0, 1):
            system, B = model.at_harmonic(h)
            K = system.stiffness + B.conj().T @ (springs[:, None] * B)
            lam, phi = sla.eigh(K, system.mass)
            modal = phi.conj().T @ system.damping @ phi
            assert np.abs(modal - np.diag(0.02 * np.sqrt(lam))).max() < 1e-6 * np.abs(modal).max()


def test_a_couple_is_two_opposite_forces(folder):
    force = 'group = "couple_leading", opposite = "couple_trailing", direction = "y", value = "60 kN"'
    couple = f"loads.static={{untwist = {{{force}}}}}"
    pair, item = built(folder), built(folder, couple)
    system, loads = pair.reduced.system, pair.balance.excitation.loads
    expected = sum(value * system.loads[name] for (h, name), value in loads.items() if h == 0)
    assert item.balance.excitation.loads[0, "untwist"] * item.reduced.system.loads["untwist"] == pytest.approx(expected)
    repeated = scene_file.from_json(scene_file.read("blade_thesis", (couple,)).scene.model_dump_json())
    assert repeated.loads.static["untwist"].opposite == "couple_trailing"


def test_spinning_wheel_is_stiffer_and_presses_harder(folder):
    still, spun = built(folder), built(folder, "wheel.speed=6000 rpm")
    assert "centrifugal" in spun.reduced.system.loads
    assert spun.balance.excitation.loads[0, "centrifugal"] == pytest.approx((2 * np.pi * 100) ** 2)
    free = [model.reduced.free_frequency[0] for model in (still, spun)]
    assert 1.05 * free[0] < free[1] < 2 * free[0]
    assert "centrifugal" not in still.reduced.system.loads


def test_flexible_disk_couples_through_its_seam(folder):
    """With a disk sector under the root the free frequencies depend on the nodal diameter."""
    disk = ("geometry.disk_radius=0.15", 'wheel.seam=["cyclic_right", "cyclic_left"]')
    scene = scene_file.read("blade_thesis", (*COARSE, *disk))
    mesh, nodes = modelling.make_mesh(scene, folder)
    assert len(find_group(nodes, "cyclic_left")) > 0
    part = modelling.make_part(scene.mesh_scene, mesh, nodes)
    reduced = sector.reduced(scene.mesh_scene, sector.sector(scene.mesh_scene, part))
    free = nodal_diameters(reduced.sector, (0, 5, 10), 1)[:, 0]
    assert np.ptp(free) > 0.1
    spinning = scene_file.read("blade_thesis", (*COARSE, *disk, "wheel.speed=6000 rpm")).mesh_scene
    spun = sector.reduced(spinning, sector.sector(spinning, modelling.make_part(spinning, mesh, nodes)))
    assert (nodal_diameters(spun.sector, (0, 5, 10), 1)[:, 0] > free).all()


def test_plan_of_a_wheel():
    plan = planning.plan(scene_file.read("blade_thesis", COARSE))
    assert plan.contact_pairs == 20
    assert plan.unknowns == 180


def test_rotation_leads_to_the_left(finished):
    wheel = finished.facts.around
    assert wheel.turn == pytest.approx(rotation((1, 0, 0), 2 * np.pi / 40))


@pytest.mark.parametrize(("override", "sentence"), [
    ("contact.opposite=", "the contact needs one group, the right face, and its opposite, the left one"),
    ("reduction.relative=true", "reduction.relative has no meaning for a sector of a wheel"),
    ("motion.shroud_right.direction=z", "motion has no meaning for a sector of a wheel"),
    ("wheel.sectors=1", "wheel.sectors: expected a value at least 2"),
    ("wheel.sectors=39", "2 pi / 39 does not bring .*: give wheel.sectors = 40"),
    ("wheel.axis=-x", "swap the two faces, or let wheel.axis point the other way"),
    ('loads.static={p = {group = "tip", opposite = "clamp", pressure = 1}}', "opposite only with value and direc"),
    ('loads.static={p = {group = "tip", opposite = "no", direction = "y", value = 1}}', "has no node set 'no'"),
    ("geometry.disk_radius=0.15", r"wheel.seam is missing, .* give wheel.seam = \["),
    ('loads.static.spin={direction = "x", speed = "9 Hz"}', "spin: a wheel turns at wheel.speed, .*: give that"),
    ('loads.static.weight={direction = "z", acceleration = 9.81}', "weight: .* across wheel.axis would turn"),
    ("wheel.speed=6000", "unstable at rest: its stress and spin softening"),
    ("wheel.engine=2", r"unknown key wheel.engine \(did you mean engine_order\?\)"),
    ('wheel.seam=["cyclic_right", "cyclic_left"]', "the mesh has no .*cyclic_right"),
])  # fmt: skip
def test_bad_scenes_end_with_one_sentence(override, sentence, folder):
    with pytest.raises(ValueError, match=sentence):
        built(folder, override)
