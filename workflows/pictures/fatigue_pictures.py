"""Pictures of fatigue: the Haigh diagram with what moves in it as the joint wears, and utilisation against cycles."""

from typing import Any

import numpy as np

from tribodyn.hbm.fatigue import Strength, haigh_point
from tribodyn.workflows.pictures.figures import axes_of, heading, present, titled
from tribodyn.workflows.pictures.matplotlib_names import Figure
from tribodyn.workflows.pictures.theme import CYCLE, INK, RED
from tribodyn.workflows.pictures.wear_plots import cycle_axis
from tribodyn.workflows.result.answers import cycles_of, worn_contact
from tribodyn.workflows.result.contact_states import shown_states
from tribodyn.workflows.result.result import Result
from tribodyn.workflows.run.stresses import strength_of
from tribodyn.workflows.scene.schema import MeshScene

DASHES = ("-", "--", ":", "-.")
MARKS = "os^Dv"


def haigh(result: Result) -> Figure:
    """Amplitude against mean stress: limits of the materials, hot spots and places from before wear to its end."""
    scene = result.scene
    assert isinstance(scene, MeshScene)
    strengths = {name: strength_of(table) for name, table in scene.fatigue.items()}
    courses = {label: 1e-6 * points for label, points in _courses(result).items() if np.isfinite(points).all()}
    points = np.concatenate([np.zeros((1, 2)), *courses.values()])
    with axes_of(9.0, 4.6, columns=2) as (figure, panes):
        for axes in panes:
            for (name, strength), dash in zip(strengths.items(), DASHES * len(strengths), strict=False):
                x = np.linspace(1.1 * points[:, 0].min(), max(1e-6 * strength.strength, points[:, 0].max()), 200)
                axes.plot(x, 1e-6 * _limit(strength, 1e6 * x), dash, color=INK, lw=1.2, label=f"limit of {name}")
            for number, (label, course) in enumerate(courses.items()):
                look = {"color": CYCLE[number % len(CYCLE)], "marker": MARKS[number % len(MARKS)], "ms": 5}
                axes.plot(*course.T, lw=1.2, markevery=[-1], label=label, **look)
                if len(course) > 1:
                    axes.plot(*course[:1].T, mfc="white", ls="", **look)
            axes.axvline(0.0, color=INK, lw=0.5)
            axes.set_xlabel("mean stress / MPa")
        panes[0].set(ylabel="stress amplitude / MPa", ylim=(0, None))
        low, high = points[1:].min(axis=0), points[1:].max(axis=0)
        room = 0.15 * (high - low) + 0.02 * high[1]
        (left, bottom), (right, top) = low - room, high + room
        panes[1].set(xlim=(left, right), ylim=(bottom, top), title="enlarged")
        worn = ", hollow before wear, full at its end" if result.wear_steps else ""
        heading(figure, result, f"Haigh diagram{worn}")
        figure.legend(*panes[0].get_legend_handles_labels(), loc="outside lower center", ncols=3)
    return figure


def _limit(strength: Strength, mean: np.ndarray) -> np.ndarray:
    """Amplitude (...) of uniaxial stress that is endured at a mean (...) [Pa]."""
    if strength.torsion_limit is None:
        return strength.permissible(mean)
    slope = 3 * strength.torsion_limit / strength.endurance_limit - np.sqrt(3)  # of Crossland, over the pressure
    return np.maximum((strength.torsion_limit - slope * mean / 3) / (1 / np.sqrt(3) + slope / 3), 0.0)


def _courses(result: Result) -> dict[str, np.ndarray]:
    """Label -> (n_state, 2) mean and amplitude [Pa] of what a state has as a hot spot, in all states, and of places."""
    stress, courses = result.stress_field, dict[str, np.ndarray]()
    if stress is not None:
        labels = [state.label for state in shown_states(result)]
        for state, spots in enumerate(stress.spot):
            for rank, node in enumerate(spots, 1):
                if any((earlier == node).any() for earlier in stress.spot[:state]):
                    continue
                name = f"hot spot {rank}" + (f" ({labels[state]})" if state else "")
                courses[name] = np.column_stack([stress.mean[:, node], stress.amplitude[:, node]])
    worn = worn_contact(result)
    cycles = [cycle for cycle, _ in cycles_of(result).values()]
    for place in result.facts.places:
        if place.strength is not None and cycles:
            responses = np.stack([cycle.response for cycle in cycles[:1]]) if worn is None else worn.history.response
            basis = cycles[0].basis
            tensor = place.stress(responses, basis) / place.weakening
            courses[f"place {place.name}"] = np.column_stack(haigh_point(tensor, basis))
    return courses


def utilisation_against_cycles(result: Result) -> Figure:
    """Utilisation of the places, the largest of the duties, and that of the part where it was computed."""
    worn, stress = present(worn_contact(result)), result.stress_field
    with axes_of() as (figure, axes):
        scale = cycle_axis(axes, worn.history)
        for number, (name, place) in enumerate(worn.fatigue.items()):
            axes.plot(
                scale * place.cycles, place.utilisation.max(axis=1), marker=MARKS[number % len(MARKS)], ms=3,
                color=CYCLE[number % len(CYCLE)], label=f"place {name}",
            )  # fmt: skip
        if stress is not None and np.isfinite(stress.utilisation).any():
            largest = np.nanmax(stress.utilisation, axis=1)
            axes.plot(scale * worn.history.cycles[stress.row], largest, "D", color=INK, ms=5, label="hottest spot")
        axes.axhline(1.0, color=RED, lw=1.2, label="endurance limit")
        axes.set(ylabel="utilisation, 1 is the limit", title=titled(result, "utilisation in fatigue under wear"))
        axes.set_ylim(bottom=0)
        figure.legend(loc="outside lower center", ncols=3)
    return figure


def figures(result: Result) -> dict[str, Any]:
    """Those that a result has data for, by name."""
    is_judged = isinstance(result.scene, MeshScene) and bool(result.scene.fatigue)
    if not is_judged:
        return {}
    return {"haigh": haigh} | ({"fatigue": utilisation_against_cycles} if result.wear_steps else {})
