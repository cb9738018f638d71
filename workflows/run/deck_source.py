"""The file of a deck, read once, and the elements that its bodies are computed in."""

from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from tribodyn.geometry import subdivision
from tribodyn.geometry.sources import foreign_file
from tribodyn.workflows.scene.structure_tables import DeckTable


def source(path: Path, unit: str) -> foreign_file.Source:
    """What a file holds, read once as long as it does not change; raises Refusal as `read.read` does."""
    return _read(path, unit, path.stat().st_mtime_ns if path.is_file() else 0)


@lru_cache(maxsize=4)
def _read(path: Path, unit: str, stamp: int) -> foreign_file.Source:
    return foreign_file.read(path, unit)


def notes_of(source: foreign_file.Source, table: DeckTable) -> tuple[str, ...]:
    """Sentences on the conversion of a deck."""
    notes = []
    names_of: dict[str, list[str]] = {}
    for name in source.bodies:
        names_of.setdefault(elements_of(source, table, name), []).append(name)
    for form, names in names_of.items():
        if form:
            meshes = [source.bodies[name].mesh for name in names]
            linear, raised = (
                sum(counts) for counts in zip(*((m.nvertices, m.doflocs.shape[1]) for m in meshes), strict=True)
            )
            notes.append(
                f"the hexahedra of {', '.join(names)} are computed on their eight corners ({form}): {linear} nodes; "
                f'elements = "quadratic" raises them to second order, with {raised} nodes'
            )
    return (*notes, *(source.order_notes if "" in names_of else ()), *source.notes)


def elements_of(source: foreign_file.Source, table: DeckTable, body: str) -> str:
    """Formulation of the 8-node hexahedra of a body, "" for elements of second order."""
    forms = {"deck": source.formulations.get(body, ""), "quadratic": ""}
    return forms.get(table.elements, table.elements)


def with_elements(mesh: Any, node_sets: dict[str, np.ndarray], form: str, body: str) -> tuple[Any, Any]:
    """Mesh and node sets of a body in elements of a formulation.

    Raises  Refusal, which names the body, where it has others than those can stand for"""
    return subdivision.first_order(mesh, node_sets, body) if form else (mesh, node_sets)
