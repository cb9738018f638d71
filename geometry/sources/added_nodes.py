"""Equations of a deck for the nodes that were added to its elements.

A deck that joins or holds a face by equations names the nodes it has. Where a face is computed with more of them, those
between would stay free. An added node of the surface gets an equation where all nodes between which it lies have one
of the same axes and factors, and where each further displacement is of the same node in all of them, or of nodes
between which another added one lies: then the equation is the mean of theirs."""

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np

from tribodyn.geometry.sources.deck import DeckEquation
from tribodyn.geometry.sources.foreign_file import Source

Place = tuple[str, int]  # body and node, or point and -1
Form = tuple[tuple[int, float], ...]  # axis and factor of each term


def with_added_nodes(source: Source) -> Source:
    """The source with such equations, and a set of one node for each added node that they name."""
    if not source.deck.equations:
        return source
    at, between = _places(source), {}
    for name, body in source.bodies.items():
        for added, ends in body.added:
            for node, of in zip(added.tolist(), ends.tolist(), strict=True):
                between[frozenset((name, end) for end in of)] = (name, node)
    added_at = set(between.values())
    names = {place: f"{place[0]} added {place[1]}" for place in added_at} | {
        place: group for group, place in at.items()
    }
    equations, used = [], set()
    for form, table in _tables(source, at).items():
        for places in _means(form, table, source, between):
            equations.append(DeckEquation(tuple((names[p], *term) for p, term in zip(places, form, strict=True))))
            used |= added_at.intersection(places)
    bodies = {
        name: replace(body, node_sets=body.node_sets | {names[p]: np.array([p[1]]) for p in used if p[0] == name})
        for name, body in source.bodies.items()
    }
    notes = [f"{len(equations)} more equations are for nodes that were added to its elements"] if equations else []
    deck = replace(source.deck, equations=(*source.deck.equations, *equations))
    return replace(source, bodies=bodies, deck=deck, notes=(*source.notes, *notes))


def _places(source: Source) -> dict[str, Place]:
    """Where the groups of its equations are."""
    place_of: dict[str, Place] = {}
    for group in {group for equation in source.deck.equations for group, *_ in equation.terms}:
        on = [(name, int(b.node_sets[group][0])) for name, b in source.bodies.items() if group in b.node_sets]
        place_of[group] = on[0] if on else (group, -1)
    return place_of


def _tables(source: Source, at: Mapping[str, Place]) -> dict[Form, dict[Place, list[Place]]]:
    """Form of equations -> the first place of each -> all places; of two that are equal that with fewer equations."""
    rows_of_form: dict[Form, list[list[Place]]] = {}
    for equation in source.deck.equations:
        if equation.terms and equation.terms[0][2]:
            form = tuple((axis, factor / equation.terms[0][2]) for _, axis, factor in equation.terms)
            rows_of_form.setdefault(form, []).append([at[group] for group, *_ in equation.terms])
    for form in filter(_equal, rows_of_form):
        count = Counter(place for row in rows_of_form[form] for place in row)
        rows_of_form[form] = [sorted(row, key=lambda place: (count[place], place)) for row in rows_of_form[form]]
    return {form: {row[0]: row[1:] for row in rows} for form, rows in rows_of_form.items()}


def _equal(form: Form) -> bool:
    return [axis for axis, _ in form] == [form[0][0]] * 2 and form[1][1] == -1


def _means(
    form: Form, table: Mapping[Place, list[Place]], source: Source, between: Mapping[frozenset[Place], Place]
) -> Iterator[list[Place]]:
    """Places of the terms of each further equation of one form."""
    places = {*table, *(row[0] for row in table.values() if _equal(form))}  # what others follow equals itself
    for name, body in source.bodies.items():
        inside = np.zeros(body.mesh.doflocs.shape[1], dtype=bool)
        inside[[node for where, node in places if where == name]] = True
        outer = np.flatnonzero(body.mesh.f2t[1] < 0)
        facets = outer[inside[body.mesh.facets[:, outer]].all(axis=0)]
        boundary_nodes = body.mesh.dofs.get_facet_dofs(facets).flatten() if len(facets) else []
        for added, ends in body.added:
            chosen = inside[ends].all(axis=1) & np.isin(added, boundary_nodes)
            for node, of in zip(added[chosen].tolist(), ends[chosen].tolist(), strict=True):
                rows = [table.get((name, end), [(name, end)]) for end in of]
                columns = [set(column) for column in zip(*rows, strict=True)]
                following_places = [min(c) if len(c) == 1 else between.get(frozenset(c)) for c in columns]
                if None not in following_places and (name, node) not in following_places:
                    yield [(name, node), *(place for place in following_places if place)]
