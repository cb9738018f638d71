"""Small decks of Abaqus and CalculiX, their natural frequencies here and by CalculiX (ccx)."""

from __future__ import annotations

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


def bricks(counts: tuple[int, int, int], shape: Shape) -> str:
    """Nodes and elements C3D20 of the unit cube, cut and mapped by a function of points; sets ALL, FOOT at x = 0.

    Nodes that meet after mapping are one, so that a cube may be bent to a ring
    """
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
    lines = ["*NODE", *(f"{n}, {', '.join(f'{c:.9f}' for c in x)}" for x, n in number.items())]
    lines.append("*ELEMENT, TYPE=C3D20, ELSET=ALL")
    for e, labels in enumerate(cells, 1):
        row = [str(n) for n in labels]
        lines += [f"{e}, {', '.join(row[:12])},", ", ".join(row[12:])]
    return "\n".join([*lines, "*NSET, NSET=FOOT", *map(str, sorted(foot)), ""])


def frequencies(deck: str, count: int, folder: Path, unit: str = "mm") -> np.ndarray:
    """The lowest natural frequencies (count,) [Hz] of a deck as `inspect --modes` gives them."""
    (folder / "own.inp").write_text(deck, encoding="utf-8")
    return np.array(inspection.inspect(folder / "own.inp", unit=unit, modes=count).frequencies)


def by_calculix(deck: str, count: int, folder: Path) -> np.ndarray:
    """The same by CalculiX, which ends the deck with its step."""
    (folder / "ccx.inp").write_text(f"{deck}*STEP\n*FREQUENCY\n{count}\n*END STEP\n", encoding="utf-8")
    done = subprocess.run(["ccx", "-i", "ccx"], cwd=folder, capture_output=True, text=True, timeout=600, check=False)
    if "Job finished" not in done.stdout:
        raise RuntimeError(done.stdout[-2000:])
    table = (folder / "ccx.dat").read_text().split("E I G E N V A L U E")[1].split("P A R T I C")[0]
    rows = re.findall(r"^\s+\d+\s+(\S+)\s+(\S+)\s+(\S+)\s+\S+\s*$", table, re.M)
    return np.array([float(hertz) for *_, hertz in rows])[:count]
