"""Small decks of Abaqus and CalculiX, their natural frequencies here and by CalculiX (ccx)."""

import re
import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np

from tribodyn.geometry.numbering import REFERENCE_POINTS
from tribodyn.workflows.studies import inspection

Shape = Callable[[np.ndarray], np.ndarray]

ENDING = """*MATERIAL, NAME=PLY
*ELASTIC, TYPE=ENGINEERING CONSTANTS
140000., 9000., 10000., .3, .28, .4, 5000., 4500.,
3500.
*DENSITY
1.6e-9
*SOLID SECTION, ELSET=ALL, MATERIAL=PLY, ORIENTATION=OWN
*BOUNDARY
FOOT, 1, 3
"""


def straight(x: np.ndarray) -> np.ndarray:
    return x * [100.0, 20.0, 10.0]


def cut(counts: tuple[int, int, int], shape: Shape) -> tuple[np.ndarray, list[list[int]], list[int]]:
    """The unit cube in bricks of twenty nodes, mapped by a function of points, and the nodes, from 1, at x = 0.

    Nodes that meet after mapping are one, so that a cube may be bent to a ring. Returns points, bricks, foot"""
    local = 2 * REFERENCE_POINTS["hexahedron27"][:20]
    number: dict[tuple[float, ...], int] = {}
    foot, cells = set(), []
    for corner in np.ndindex(*counts):
        unit = (local + 2 * np.array(corner)) / (2 * np.array(counts))
        labels = []
        for at, x in zip(unit, shape(unit), strict=True):
            labels.append(number.setdefault(tuple(np.round(x, 9) + 0.0), len(number) + 1))
            if at[0] == 0:
                foot.add(labels[-1])
        cells.append(labels)
    return np.array(list(number)), cells, sorted(foot)


def bricks(counts: tuple[int, int, int], shape: Shape) -> str:
    """Nodes and elements C3D20 of Abaqus with the sets ALL and FOOT."""
    points, cells, foot = cut(counts, shape)
    lines = ["*NODE", *(f"{n}, {', '.join(f'{c:.9f}' for c in x)}" for n, x in enumerate(points, 1))]
    lines.append("*ELEMENT, TYPE=C3D20, ELSET=ALL")
    for e, labels in enumerate(cells, 1):
        row = [str(n) for n in labels]
        lines += [f"{e}, {', '.join(row[:12])},", ", ".join(row[12:])]
    return "\n".join([*lines, "*NSET, NSET=FOOT", *map(str, foot), ""])


def bulk(counts: tuple[int, int, int], shape: Shape, support: str = "", system: str = "") -> str:
    """The same for Nastran: GRID, held at the foot by its PS field along a system, and CHEXA of property 1."""
    points, cells, foot = cut(counts, shape)
    lines = []
    for n, (x, y, z) in enumerate(points, 1):
        lines.append(f"GRID,{n},,{x:.9f},{y:.9f},{z:.9f},{system},{support if n in foot else ''}")
    for e, c in enumerate(cells, 1):
        row = [str(n) for n in [*c[:12], *c[16:], *c[12:16]]]
        lines += [f"CHEXA,{e},1,{','.join(row[:6])}", f"+,{','.join(row[6:14])}", f"+,{','.join(row[14:])}"]
    return "\n".join([*lines, ""])


def archive(
    counts: tuple[int, int, int], shape: Shape, angles: tuple[float, ...] = (), system: int = 0, support: str = "ALL"
) -> str:
    """The same for ANSYS: NBLOCK, whose nodes are turned by angles, EBLOCK in a local system, D at the foot."""
    points, cells, foot = cut(counts, shape)
    lines = ["/PREP7", "ET,1,186", f"NBLOCK,6,SOLID,{len(points)},{len(points)}", "(3i9,6e21.13e3)"]
    for n, x in enumerate(points, 1):
        lines.append(f"{n:9d}{0:9d}{0:9d}" + "".join(f"{value:21.13E}" for value in [*x, *angles]))
    lines += ["N,R5.3,LOC,       -1,", f"EBLOCK,19,SOLID,{len(cells)},{len(cells)}", "(19i9)"]
    for e, c in enumerate(cells, 1):
        head = [1, 1, 1, 1, system, 0, 0, 0, 20, 0, e]
        lines += ["".join(f"{n:9d}" for n in [*head, *c[:8]]), "".join(f"{n:9d}" for n in c[8:])]
    lines.append("       -1")
    return "\n".join([*lines, *(f"D,{n:8d},{support},  0.00000000" for n in foot if support), ""])


def frequencies(deck: str, count: int, folder: Path, ending: str = "inp", unit: str = "mm") -> np.ndarray:
    """The lowest natural frequencies (count,) [Hz] of a deck as `inspect --modes` gives them."""
    path = folder / f"own.{ending}"
    path.write_text(deck, encoding="utf-8")
    return np.array(inspection.inspect(path, unit=unit, modes=count).frequencies)


def by_calculix(deck: str, count: int, folder: Path) -> np.ndarray:
    """The same by CalculiX, which ends the deck with its step."""
    (folder / "ccx.inp").write_text(f"{deck}*STEP\n*FREQUENCY\n{count}\n*END STEP\n", encoding="utf-8")
    done = subprocess.run(["ccx", "-i", "ccx"], cwd=folder, capture_output=True, text=True, timeout=600, check=False)
    if "Job finished" not in done.stdout:
        raise RuntimeError(done.stdout[-2000:])
    table = (folder / "ccx.dat").read_text().split("E I G E N V A L U E")[1].split("P A R T I C")[0]
    rows = re.findall(r"^\s+\d+\s+(\S+)\s+(\S+)\s+(\S+)\s+\S+\s*$", table, re.M)
    return np.array([float(hertz) for *_, hertz in rows])[:count]
