"""Stress at rest and in a steady vibration against CalculiX 2.20, on three shapes, in bricks and in tetrahedra.

`python -m tests.fem.test_calculix_stress FOLDER` solves the decks by ccx again and records the stress at some nodes.
Its bricks are C3D20R, whose 2 x 2 x 2 points are those of fem.stress. Extrapolated from the 3 x 3 x 3 points of C3D20
the stress of nodes is another one, on an arch by 1.4 % of the largest where that at the points agrees to 0.1 %.
"""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import scipy

from tests.helpers.bent_blocks import STEEL, brick
from tribodyn.fem.constraints import Clamp
from tribodyn.fem.elements import connectivity
from tribodyn.fem.factor import factorise
from tribodyn.fem.load_vectors import BodyForce
from tribodyn.fem.modes import modes
from tribodyn.fem.part import build
from tribodyn.fem.stress import nodal_stress
from tribodyn.geometry.numbering import REFERENCE_POINTS, permutation

RECORDS = Path(__file__).parent / "calculix_stress.npz"
N_MODES, DAMPING, SHARE = 10, 0.01, 0.9  # of the first frequency, at which it vibrates
PUSH = np.array([3e4, 5e4, -1e5])  # acceleration [m/s2]
MIRROR = {
    10: [1, 0, 2, 3, 4, 6, 5, 8, 7, 9],
    20: [1, 0, 3, 2, 5, 4, 7, 6, 8, 11, 10, 9, 12, 15, 14, 13, 17, 16, 19, 18],
}


def twisted(x):
    turn = 2.5 * np.pi * x[0]
    return np.stack([x[0], x[1] * np.cos(turn) - x[2] * np.sin(turn), x[1] * np.sin(turn) + x[2] * np.cos(turn)])


def arched(x):
    return np.stack([-x[2] * np.cos(x[0]), x[1], x[2] * np.sin(x[0])])


def holed(x):
    """A quarter of a square of 0.1 with a hole of 0.02 about z."""
    outer = 0.05 / np.maximum(np.abs(np.cos(x[1])), np.abs(np.sin(x[1])))
    radius = 0.01 * (outer / 0.01) ** x[0]
    return np.stack([radius * np.cos(x[1]), radius * np.sin(x[1]), x[2]])


# axes, numbers of elements, bend; clamps; distance from a clamp up to which stress is left out [m]
SHAPES = {
    "twisted bar": (((0, 0.2), (-0.01, 0.01), (-0.005, 0.005)), (18, 4, 3), twisted, [("x_min",)], 0.04),
    "plate with a hole": (
        ((0, 1), (0, np.pi / 2), (0, 0.01)), (20, 24, 2), holed, [("y_min", "y"), ("y_max", "x"), ("z_min", "z")], 0.0,
    ),
    "arch": (((0, np.pi / 2), (0, 0.02), (0.06, 0.09)), (24, 2, 6), arched, [("x_min",)], 0.04),
}  # fmt: skip
FORMS = {True: "C3D10", False: "C3D20R"}  # by whether it has tetrahedra
SLOW = pytest.mark.slow


@pytest.mark.parametrize("tetrahedra", [False, True])
@pytest.mark.parametrize("shape", ["twisted bar", *(pytest.param(name, marks=SLOW) for name in [*SHAPES][1:])])
def test_stress_of_calculix(shape, tetrahedra):
    """Tetrahedra are the same elements: 0.5 % static and 1 % in vibration of every component that is above a tenth of
    the largest. Our bricks have 27 nodes, those of CalculiX 20: 0.7 % and 1 % of the largest."""
    with np.load(RECORDS) as records:
        nodes, theirs = (records[f"{shape}, {FORMS[tetrahedra]}, {name}"] for name in ("nodes", "stress"))
    own = stresses(shape, tetrahedra)[2][nodes]
    static, of_largest, vibration, vibration_of_largest = compare(own, theirs.astype(float))
    assert of_largest < 7e-3
    assert vibration_of_largest < 1e-2
    if tetrahedra:
        assert static < 5e-3
        assert vibration < 1e-2


def model(shape, tetrahedra):
    """Mesh, and part with an acceleration of 1 m/s2 along PUSH as its load."""
    ends, counts, bend, clamps, _ = SHAPES[shape]
    axes = [np.linspace(*end, n + 1) for end, n in zip(ends, counts, strict=True)]
    mesh, sets = brick(*axes, tetrahedra=tetrahedra, bent=bend)
    part = build(mesh, sets, STEEL, [Clamp(*clamp) for clamp in clamps], [], {"load": BodyForce(tuple(PUSH))}, {})
    return mesh, part


def stresses(shape, tetrahedra):
    """Mesh, frequency [Hz] and stress (n_node, 3, 6) [Pa], static, real and imaginary."""
    mesh, part = model(shape, tetrahedra)
    system, force = part.system, np.linalg.norm(PUSH) * part.system.loads["load"]
    omega, phi = modes(system.stiffness, system.mass, N_MODES)[:2]
    at = SHARE * omega[0]
    q = (phi.T @ force) / (omega**2 - at**2 + 2j * DAMPING * omega * at)
    u = np.stack([factorise(system.stiffness).solve(force), phi @ q.real, phi @ q.imag], axis=1)
    field = np.stack([part.field(column) for column in u.T], axis=-1)
    return mesh, at / (2 * np.pi), np.moveaxis(nodal_stress(mesh, STEEL, field).tensor, 1, 2)


def ccx_cells(mesh, tetrahedra):
    """Elements in the order of CalculiX (n, 10 or 20), each of positive volume."""
    reference = np.asarray(mesh.elem().doflocs, float)
    kind, count = ("tetra10", 10) if tetrahedra else ("hexahedron27", 20)
    cells = connectivity(mesh)[:, permutation(reference, REFERENCE_POINTS[kind])[:count]]
    edges = mesh.doflocs.T[cells[:, [1, 2, 3] if tetrahedra else [1, 3, 4]]] - mesh.doflocs.T[cells[:, :1]]
    return np.where((np.linalg.det(edges) > 0)[:, None], cells, cells[:, MIRROR[count]])


def deck(shape, tetrahedra, form, step):
    """The input of CalculiX with the steps of an analysis, at its end a step with the load."""
    mesh, part = model(shape, tetrahedra)
    cells = ccx_cells(mesh, tetrahedra)
    lines = ["*NODE", *(f"{n + 1}, {', '.join(f'{x:.12e}' for x in mesh.doflocs[:, n])}" for n in np.unique(cells))]
    lines.append(f"*ELEMENT, TYPE={form}, ELSET=ALL")
    for number, cell in enumerate(cells, 1):
        row = [str(number), *(str(node + 1) for node in cell)]
        lines += [", ".join(row[:11]) + ("" if tetrahedra else ","), *([] if tetrahedra else [", ".join(row[11:])])]
    lines += ["*MATERIAL, NAME=STEEL", "*ELASTIC", f"{STEEL.E}, {STEEL.nu}", "*DENSITY", str(STEEL.rho)]
    lines += ["*SOLID SECTION, ELSET=ALL, MATERIAL=STEEL", "*BOUNDARY"]
    for group, *axes in SHAPES[shape][3]:
        held = [1 + "xyz".index(axis) for axis in axes[0]] if axes else [1, 2, 3]
        nodes = np.intersect1d(part.node_sets[group], cells)
        lines += [f"{n + 1}, {axis}, {axis}" for n in nodes for axis in held]
    direction = ", ".join(f"{x:.12e}" for x in PUSH / np.linalg.norm(PUSH))
    load = f"ALL, GRAV, {np.linalg.norm(PUSH):.12e}, {direction}"
    return "\n".join([*lines, "*STEP", *step, "*DLOAD", load, "*EL FILE", "S", "*END STEP", ""])


def by_calculix(folder, *case):
    """Nodes (n,) and stress (n, 6) [Pa] of each result that a deck has."""
    (folder / "case.inp").write_text(deck(*case), encoding="utf-8")
    subprocess.run(["ccx", "-i", "case"], cwd=folder, capture_output=True, check=True, timeout=600)
    tables, rows = [], None
    for line in (folder / "case.frd").read_text(encoding="utf-8").splitlines():
        if line.startswith(" -4  STRESS"):
            tables.append(rows := [])
        elif line.startswith(" -3"):
            rows = None
        elif rows is not None and line.startswith(" -1"):
            rows.append(
                [float(line[at : at + width]) for at, width in [(3, 10), *((13 + 12 * i, 12) for i in range(6))]]
            )
    return [(np.array(t)[:, 0].astype(int) - 1, np.array(t)[:, [1, 2, 3, 5, 6, 4]]) for t in tables]


def record(folder, most=100):
    """Solve all decks, keep the stress of some nodes that are not near a clamp; most : nodes of each."""
    records = {}
    for shape, (*_, clamps, near) in SHAPES.items():
        for tetrahedra, form in FORMS.items():
            mesh, hertz, own = stresses(shape, tetrahedra)
            band, damping = f"{hertz:.9g}, {hertz * (1 + 1e-7):.12g}, 2", f"1, {N_MODES}, {DAMPING}"
            steady = ["*FREQUENCY, STORAGE=YES", str(N_MODES), "*END STEP", "*STEP", "*STEADY STATE DYNAMICS", band]
            steady += ["*MODAL DAMPING", damping]
            (nodes, static), *_ = by_calculix(folder, shape, tetrahedra, form, ["*STATIC"])
            *_, (_, real), (_, imaginary) = by_calculix(folder, shape, tetrahedra, form, steady)
            table = np.stack([static, real, imaginary], axis=1)
            clamped = mesh.doflocs.T[model(shape, tetrahedra)[1].node_sets[clamps[0][0]]]
            far = scipy.spatial.cKDTree(clamped).query(mesh.doflocs.T[nodes])[0] >= near
            nodes, table = nodes[far], table[far]
            print(shape, form, *(f"{error:.2%}" for error in compare(own[nodes], table)))
            kept = np.unique(np.linspace(0, len(nodes) - 1, most).astype(int))
            kept = np.union1d(kept, np.abs(table).max(axis=(1, 2)).argsort()[-most // 10 :])
            records[f"{shape}, {form}, nodes"] = nodes[kept].astype(np.int32)
            records[f"{shape}, {form}, stress"] = table[kept].astype(np.float32)
    np.savez_compressed(RECORDS, **records)


def compare(own, theirs):
    """Largest error of a component, over itself where it is above a tenth of the largest stress, and over that: of the
    static stress, and of the vibration."""
    errors = []
    for part in (slice(0, 1), slice(1, 3)):
        size, error = (np.linalg.norm(each[:, part], axis=1) for each in (theirs, own - theirs))
        large = size > 0.1 * size.max()
        errors += [(error[large] / size[large]).max(), error.max() / size.max()]
    return errors


if __name__ == "__main__":
    record(Path(sys.argv[1]))
