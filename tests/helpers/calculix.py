"""The bodies of a scene and their contacts as a deck of CalculiX (ccx), an independent solution of the contact at rest.

Bodies are of 20-node hexahedra over the corner and edge nodes of ours; contact is of surfaces, with the same springs
per area and friction."""

import re
import subprocess
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from tribodyn.fem.elements import connectivity
from tribodyn.geometry.numbering import REFERENCE_POINTS, permutation

FACES = ((0, 1, 2, 3), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7))  # S1 to S6, corners


@dataclass(frozen=True)
class Pair:
    """A contact: group of the slave and of the master; springs per area [N/m3], friction (None for none)."""

    slave: str
    master: str
    normal: float
    tangential: float
    friction: float | None


def deck(
    assembly: Any, materials: dict[str, tuple[float, float, float]], fixed: list[str], pairs: list[Pair], speed: float
) -> str:
    """The input file. materials : body -> E [Pa], nu, density [kg/m3]; speed : about the x axis [rad/s]"""
    points = assembly.doflocs.T
    lines = ["*NODE, NSET=ALL"]
    used: set[int] = set()
    elements, start = [], 0
    for body, piece in zip(assembly.bodies, assembly.pieces, strict=True):
        cells = connectivity(piece.mesh)[:, _order(piece.mesh)] + piece.node
        used.update(cells.ravel().tolist())
        elements.append((body.name, start, cells))
        start += len(cells)
    lines += [f"{n + 1}, {x:.12e}, {y:.12e}, {z:.12e}" for n in sorted(used) for x, y, z in (points[n],)]
    for name, first, cells in elements:
        lines.append(f"*ELEMENT, TYPE=C3D20, ELSET={name.upper()}")
        for e, cell in enumerate(cells):
            row = [str(n + 1) for n in cell]
            lines += [f"{first + e + 1}, {', '.join(row[:10])},", ", ".join(row[10:])]
    for name, _, _ in elements:
        E, nu, rho = materials[name]
        lines += [f"*MATERIAL, NAME={name.upper()}", "*ELASTIC", f"{E:.12e}, {nu}", "*DENSITY", f"{rho}"]
        lines.append(f"*SOLID SECTION, ELSET={name.upper()}, MATERIAL={name.upper()}")
    constrained = sorted({int(n) for group in fixed for n in assembly.node_sets[group]} & used)
    lines += ["*BOUNDARY", *(f"{n + 1}, 1, 3" for n in constrained)]
    for i, pair in enumerate(pairs):
        for side, group in (("S", pair.slave), ("M", pair.master)):
            lines.append(f"*SURFACE, NAME={side}{i}, TYPE=ELEMENT")
            lines += [f"{e + 1}, S{f + 1}" for e, f in _faces(assembly, elements, group)]
        lines += [
            f"*SURFACE INTERACTION, NAME=I{i}",
            "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR",
            f"{pair.normal:.9e}",
        ]
        if pair.friction is not None:
            lines += ["*FRICTION", f"{pair.friction}, {pair.tangential:.9e}"]
        lines += [f"*CONTACT PAIR, INTERACTION=I{i}, TYPE=SURFACE TO SURFACE", f"S{i}, M{i}"]
    lines += ["*STEP, INC=1000", "*STATIC", "0.25, 1."]
    for name, _, _ in elements:
        lines += ["*DLOAD", f"{name.upper()}, CENTRIF, {speed**2:.12e}, 0., 0., 0., 1., 0., 0."]
    for i in range(len(pairs)):
        lines += [f"*CONTACT PRINT, SLAVE=S{i}, MASTER=M{i}, FREQUENCY=1000", "CF"]
    lines += ["*NODE FILE, FREQUENCY=1000", "U", "*CONTACT FILE, FREQUENCY=1000", "CDIS, CSTR", "*END STEP", ""]
    return "\n".join(lines)


def _order(mesh: Any) -> np.ndarray:
    """Which of the 27 nodes of our elements are the 20 of CalculiX's, in its order."""
    return permutation(np.asarray(mesh.elem().doflocs), REFERENCE_POINTS["hexahedron27"])[:20]


def _faces(assembly: Any, elements: list[tuple[str, int, np.ndarray]], group: str) -> list[tuple[int, int]]:
    """Elements and faces (from 0) whose four corners are nodes of a group."""
    nodes = set(assembly.node_sets[group].tolist())
    rows = []
    for _, first, cells in elements:
        for e, cell in enumerate(cells):
            rows += [(first + e, f) for f, corners in enumerate(FACES) if nodes.issuperset(cell[list(corners)])]
    return rows


def run(text: str, folder: Path) -> tuple[list[np.ndarray], np.ndarray]:
    """Solve a deck; returns numbers of every contact print, and rows node, CPRESS, shear 1, shear 2 of slave nodes."""
    (folder / "case.inp").write_text(text, encoding="utf-8")
    done = subprocess.run(["ccx", "-i", "case"], cwd=folder, capture_output=True, text=True, timeout=600, check=False)
    if "Job finished" not in done.stdout:
        raise RuntimeError(done.stdout[-2000:])
    return _printed((folder / "case.dat").read_text(encoding="utf-8")), _contact((folder / "case.frd").read_text())


def _printed(text: str) -> list[np.ndarray]:
    return [
        np.array([float(v) for v in re.findall(r"[-+]?\d\.\d+E[-+]\d+", part)]) for part in text.split("statistics")[1:]
    ]


def _contact(text: str) -> np.ndarray:
    rows, inside = [], False
    for line in text.splitlines():
        if line.startswith(" -4  CONTACT"):
            inside, rows = True, []
        elif line.startswith(" -3"):
            inside = False
        elif inside and line.startswith(" -1"):
            values = [float(line[13 + 12 * k : 25 + 12 * k]) for k in range(6)]
            rows.append([int(line[3:13]) - 1, *values[3:6]])
    return np.array(rows)
