"""A wheel of eight coarse shrouded blades, small enough to be solved as a whole."""

import numpy as np

from tribodyn.fem import cyclic_symmetry
from tribodyn.fem.constraints import Clamp
from tribodyn.fem.contact_faces import ContactFaces
from tribodyn.fem.load_vectors import NodalForce, Sum
from tribodyn.fem.material import Material
from tribodyn.fem.part import build
from tribodyn.geometry import mesh as mesh_file
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.contact.contact_law import ContactParameters
from tribodyn.hbm.contact.joint import Joint
from tribodyn.hbm.excitation import Excitation
from tribodyn.hbm.harmonics import HarmonicBasis
from tribodyn.hbm.linear import travelling_wave as waves
from tribodyn.reduction.linear_damping import modal_damping
from tribodyn.reduction.sector_reduction import reduce_sector
from tribodyn.reduction.wave_model import travelling_wave, wheel_model
from tribodyn.workflows.cases.blade import blade

N = 8
STEEL = Material(210e9, 0.3, 7860.0)
CIRCUMFERENCE = (0.0, 1.0, 0.0)
STIFFNESS = (93e6, 113e6)  # tangential and normal, of a whole face
CONTACT = ContactFaces("shroud_right", (1, 0, 0), "shroud_left", vertices_only=True)
FORCES = (NodalForce("couple_trailing", CIRCUMFERENCE), 1.0), (NodalForce("couple_leading", CIRCUMFERENCE), -1.0)
LOADS = {"couple": Sum(FORCES), "shaker": NodalForce("excitation", CIRCUMFERENCE)}
OUTPUTS = {"tip": NodalForce("tip", CIRCUMFERENCE), "driven": NodalForce("excitation", CIRCUMFERENCE)}
CLAMPS = (Clamp("clamp"),)
SEAM = ("cyclic_right", "cyclic_left")


def parameters(disk_radius=0.0):
    """A blade of 80 mm on a wheel of eight."""
    return blade.Parameters(
        n_blades=N, hub_radius=0.06, span=0.08, root_chord=0.035, tip_chord=0.024, root_thickness=0.01,
        tip_thickness=0.008, camber=0.04, edge=0.65, tip_stagger=0.6, contact_length=0.02, contact_height=0.012,
        shroud_length=0.035, root_height=0.015, root_length=0.05, disk_radius=disk_radius,
        n_along=3, n_up=2, n_span=3, n_side=1, n_root=1, n_disk=1,
    )  # fmt: skip


def read(path, disk_radius=0.0):
    """Mesh and node sets of a sector."""
    blade.build(parameters(disk_radius), path)
    return mesh_file.read(path)


def full_sector(path, disk_radius=0.0, clamps=CLAMPS, contact=CONTACT):
    """Part and sector of a blade on a rigid disk, or on a flexible one."""
    mesh, node_sets = read(path, disk_radius)
    seam = SEAM if disk_radius else None
    return sector_of(mesh, node_sets, clamps, [contact], N, seam)


def sector_of(mesh, node_sets, clamps, contacts, n_sectors, seam=None, axis=(1.0, 0.0, 0.0)):
    """Part and sector of any mesh; all contacts are those of neighbours."""
    right = cyclic_symmetry.with_neighbours(contacts, n_sectors, axis)
    part = build(mesh, node_sets, STEEL, clamps, right, LOADS, OUTPUTS)
    return part, cyclic_symmetry.cut_sector(part, right, n_sectors, seam, axis)


def reduced_sector(path, disk_radius=0.0):
    """The same, reduced."""
    return reduce_sector(full_sector(path, disk_radius)[1], n_modes=10)


def excitation(static=4e3, harmonic=2e3 + 1e3j):
    """Couple and shaker of sector 0."""
    return Excitation.of({"couple": static}, {1: {"shaker": harmonic}})


def wave_and_wheel(reduced, engine_order, harmonics=(0, 1, 2, 3), damping=0.01, load=None, stiffness=None):
    """The same problem twice: one sector under a travelling wave, and the whole wheel."""
    basis = HarmonicBasis(harmonics, 128)
    load = load or excitation()
    item, wheel = travelling_wave(reduced, engine_order), wheel_model(reduced, stiffness)
    if damping:
        item, wheel = (model.with_damping(lambda system, B: modal_damping(system, damping)) for model in (item, wheel))
    k = reduced.sector.interface.stiffness(*STIFFNESS)
    highest = 2 * np.pi * 1000

    def balance(model, copies, loads):
        contact = ContactParameters.of(model.interface.components, np.tile(k, (copies, 1)), friction=0.3)
        return HarmonicBalance.of(model, Joint("contact", "jenkins", contact), basis, loads, highest)

    return balance(item, 1, load), balance(wheel, N, waves.on_wheel(load, engine_order, N))
