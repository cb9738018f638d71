"""Equations of a deck for the nodes that were added to its elements.

A deck that joins or holds a face by equations names the nodes it has. Where a face is computed with more of them, those
between would stay free. An added node of the surface gets an equation where all nodes between which it lies have one
of the same axes and factors, and where each further displacement is of the same node in all of them, or of nodes
between which another added one lies: then the equation is the mean of theirs.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from tribodyn.geometry.sources.deck import Equation
from tribodyn.geometry.sources.read import Source

Place = tuple[str, int]  # body and node, or point and -1
Form = tuple[tuple[int, float], ...]  # axis and factor of each term


def with_added_nodes(source: Source) -> Source:
    """The source with such equations, and a set of one node for each added node that they name."""
    tables = _tables(source)
    if not tables:
        return source
    between = {
        frozenset((name, end) for end in of): (name, node)
        for name, body in source.bodies.items()
        for added, ends in body.added
        for node, of in zip(added.tolist(), ends.tolist(), strict=True)
    }
    new = frozenset(between.values())
    names: dict[Place, str] = {place: f"{place[0]} added {place[1]}" for place in new}
    names |= {place: group for group, place in _places(source).items()}
    equations, used = [], set()
    for form, table in tables.items():
        for places in _means(form, table, source, between):
            equations.append(Equation(tuple((names[p], *term) for p, term in zip(places, form, strict=True))))
            used |= new.intersection(places)
    bodies = {
        name: replace(body, node_sets=body.node_sets | {names[p]: np.array([p[1]]) for p in used if p[0] == name})
        for name, body in source.bodies.items()
    }
    deck = replace(source.deck, equations=(*source.deck.equations, *equations))
    note = f"{len(equations)} equations more are for nodes added between those of its equations"
    return replace(source, bodies=bodies, deck=deck, notes=(*source.notes, *([note] if equations else [])))


def _places(source: Source) -> dict[str, Place]:
    """Where the groups of its equations are."""
    found = {}
    for group in {group for one in source.deck.equations for group, *_ in one.terms}:
        on = [(name, int(b.node_sets[group][0])) for name, b in source.bodies.items() if group in b.node_sets]
        found[group] = on[0] if on else (group, -1)
    return found


def _tables(source: Source) -> dict[Form, dict[Place, tuple[Place, ...]]]:
    """Form of equations -> the first place of each -> the others.

    Where two displacements are equal, the first is the one that fewer equations name
    """
    at = _places(source)
    found: dict[Form, list[list[Place]]] = {}
    for one in source.deck.equations:
        form = tuple((axis, factor / one.terms[0][2]) for _, axis, factor in one.terms if one.terms[0][2])
        found.setdefault(form, []).append([at[group] for group, *_ in one.terms])
    for form, rows in found.items():
        if _equal(form):
            count = Counter(place for row in rows for place in row)
            found[form] = [sorted(row, key=lambda place: (count[place], place)) for row in rows]
    return {form: {first: tuple(others) for first, *others in rows} for form, rows in found.items() if form}


def _equal(form: Form) -> bool:
    return len(form) == 2 and form[0][0] == form[1][0] and form[1][1] == -1


def _means(
    form: Form, table: dict[Place, tuple[Place, ...]], source: Source, between: dict[frozenset[Place], Place]
) -> Iterator[list[Place]]:
    """Places of the terms of each further equation of one form."""
    followed = {places[0] for places in table.values()} if _equal(form) else set()
    for name, body in source.bodies.items():
        inside = np.zeros(body.mesh.doflocs.shape[1], dtype=bool)
        inside[[node for where, node in {*table, *followed} if where == name]] = True
        outer = np.flatnonzero(body.mesh.f2t[1] < 0)
        facets = outer[inside[body.mesh.facets[:, outer]].all(axis=0)]
        near = body.mesh.dofs.get_facet_dofs(facets).flatten() if len(facets) else []
        for added, ends in body.added:
            chosen = inside[ends].all(axis=1) & np.isin(added, near)
            for node, of in zip(added[chosen].tolist(), ends[chosen].tolist(), strict=True):
                rows = [table.get((name, end), ((name, end),)) for end in of]  # what others follow equals itself
                columns = [set(column) for column in zip(*rows, strict=True)]
                others = [min(c) if len(c) == 1 else between.get(frozenset(c)) for c in columns]
                found = [place for place in others if place is not None]
                if len(found) == len(others) and (name, node) not in found:
                    yield [(name, node), *found]
