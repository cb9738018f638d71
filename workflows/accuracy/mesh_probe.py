"""Contributions of mesh, contact grid and modes to the errors of a result, from the unworn contact on other ones."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from time import process_time

import numpy as np

from tribodyn.fem.interface import ContactInterface
from tribodyn.hbm.wear.even_wear import depth_to_loss
from tribodyn.hbm.wear.history import LIFE_SHARE, WearHistory, cycles_to_preload, cycles_to_share
from tribodyn.workflows.accuracy import convergence, other_meshes, probes
from tribodyn.workflows.accuracy.at_once import LEAST, MESH
from tribodyn.workflows.accuracy.convergence import Difference
from tribodyn.workflows.accuracy.other_meshes import Other
from tribodyn.workflows.accuracy.probes import State, compared, relative
from tribodyn.workflows.accuracy.statement import LARGEST, QUANTITIES, Contribution
from tribodyn.workflows.accuracy.time_limit import TimeUp, processor_seconds
from tribodyn.workflows.result import summary
from tribodyn.workflows.result.result import Result
from tribodyn.workflows.run import modelling, wear_run
from tribodyn.workflows.run.modelling import Model
from tribodyn.workflows.run.progress import Progress
from tribodyn.workflows.scene.scene_file import SceneFile
from tribodyn.workflows.scene.wear import Wear

ANSWERS = ("peak_frequency", "amplitude", "energy", "preload")
# no better known than the frequency of the peak they belong to: its stiffness limits the motion, too, as in
# F / (2 zeta m omega^2); differences that cancel between two meshes say nothing of a third
AT_A_PEAK = ("amplitude", "energy")
STEEPENING = ("amplitude", "energy", "preload")  # that may change faster on finer meshes than other ones tell
# least error of the energy over that of the amplitude: what slips is what moves, and the friction work is the work of
# the drive, which goes with the amplitude; where both differ otherwise on two meshes, that is taken for chance
ENERGY_OVER_AMPLITUDE = 0.5
PLATEAU = 1 / 3  # of the error of the amplitude: where it falls by less, the peak of another mesh may lie as well
ONE_ELEMENT = 4  # pairs of a contact face that a single element covers: too coarse for any order
FOR_MESHES = 0.9  # of the seconds; the rest is for frequencies beside the peak
SAME_GRID = 0.95  # size of the contact elements over that of the scene's, above which they are the same


@dataclass
class Seen:
    """What other meshes have answered.

    differences : by what is changed and by quantity; refused : by what is changed
    moved : by quantity, relative changes that more harmonics make on the other meshes
    grid_kept : whether the finer one has contact elements as long as the scene's along some direction
    models : of the meshes that have answered
    """

    differences: dict[str, dict[str, list[Difference]]] = field(default_factory=dict)
    refused: dict[str, str] = field(default_factory=dict)
    said: list[str] = field(default_factory=list)
    grid_kept: bool = False
    moved: dict[str, float] = field(default_factory=dict)
    models: list[tuple[Other, Model]] = field(default_factory=list)


@dataclass(frozen=True)
class Probe:
    """The unworn state that other meshes are compared with.

    seconds : of the processor, for all of a source; skipped : the sentence where they are used up
    more_harmonics : whether to look at what they change on a finer mesh, too. Where a resonance of a higher harmonic is
        near it may be more than on the scene's own: the error is at most the sum of the mesh's, with the harmonics of
        the scene, and of what more of them change on a mesh without error
    """

    result: Result
    first: State
    seconds: float
    skipped: str
    more_harmonics: bool = False

    def of_mesh(self, file: SceneFile) -> Iterator[Contribution]:
        """On a coarser and a finer mesh; where the finer one is too large or fails, on coarser ones."""
        facts, seen, start = self.result.facts, Seen(), process_time()
        end = start + FOR_MESHES * self.seconds
        both = other_meshes.around(file, facts.full_dofs, facts.unknowns)
        self._solve(both, seen, end)
        if other_meshes.A_FINER_MESH not in seen.said:
            try:
                more = other_meshes.coarser(file, facts.full_dofs)
            except ValueError as refusal:
                return unknown(MESH, str(refusal))
            seen.refused.clear()
            self._solve([other for other in more if not (both and other.file == both[0].file)], seen, end)
        fine_enough = not self._single_element and not seen.grid_kept
        return self._contributions(MESH, seen, fine_enough, start + self.seconds)

    def of_modes(self, other: Other) -> Iterator[Contribution]:
        """With more modes."""
        seen = Seen()
        self._solve([other], seen, process_time() + self.seconds)
        return self._contributions("modes", seen)

    @property
    def _single_element(self) -> bool:
        """Whether a single element covers the contact faces."""
        contact = self.first.balance.contact
        return contact.n_pair <= ONE_ELEMENT * len(contact.joints)

    @property
    def _joint(self) -> str | None:
        """The joint whose life is the life of the run, None where that is of the whole contact."""
        return summary.first_lost(self.result)

    def _solve(self, others: Sequence[Other], seen: Seen, end: float) -> None:
        ours, on_curve = self.first.answers, isinstance(self.first.site, probes.OnCurve)
        for other in others:
            try:
                with processor_seconds(end - process_time()):
                    taken, model = self._built(other, seen)
                    there = probes.unworn(taken.file, model, self.first.site)
                    deepest = probes.deepest(taken.file, there, self._joint)
            except (TimeUp, ValueError, RuntimeError) as refusal:
                why = self.skipped if isinstance(refusal, TimeUp) else f"{other.how}: {refusal}"
                seen.refused[other.along] = why
                continue
            seen.said.append(taken.how)
            seen.models.append((taken, model))
            of = seen.differences.setdefault(other.along, {})
            pairs = {name: (a, b) for name, a, b in compared(there.answers, ours)}
            if self.result.wear_steps:
                reach = self.result.facts.delta_max_m
                if reach is None:
                    reach = depth_to_loss(self.first.balance, self.first.here.state, self._joint)
                pairs["depth"] = (deepest, reach)
            for name, (a, b) in pairs.items():
                of.setdefault(name, []).append(convergence.difference(taken.size, a, b))
            if self.more_harmonics and taken.size < 1 and not on_curve:
                seen.moved = moved_by_more_harmonics(there, end - process_time())

    def _built(self, other: Other, seen: Seen) -> tuple[Other, Model]:
        """The model of another mesh; of the one instead, where this one leaves the contact grid in a direction.

        A pad of one row of elements may keep it on a mesh of 1.5 times as many: what its pressure is off by is then
        the same on both, and their difference says nothing of it
        """
        model = modelling.build(other.file, None, Progress(), self.result.harmonics)
        if other.how == other_meshes.A_FINER_MESH and self._keeps_grid(model):
            if other.instead is not None:
                return self._built(other.instead, seen)
            seen.grid_kept = True
        return other, model

    def _keeps_grid(self, model: Model) -> bool:
        """Whether contact elements of a finer mesh are as long as the scene's own along t1 or t2."""
        own, theirs = (element_lengths(balance.model.interface) for balance in (self.first.balance, model.balance))
        return bool((theirs > SAME_GRID * own).any())

    def _contributions(
        self, source: str, seen: Seen, fine_enough: bool = True, beside: float | None = None
    ) -> Iterator[Contribution]:
        """What is seen, as errors.

        fine_enough : whether the scene's own mesh may have an order; beside : processor time until which frequencies
        beside a peak are looked at, None looks at none
        Errors of different kinds are added: they are of different directions, and their signs are not known.

        One mesh of several that change the same is enough where the others have no solution or the seconds are used up
        """
        lacking = [why for along, why in seen.refused.items() if along not in seen.differences]
        if lacking:
            yield from unknown(source, lacking[0])
            return
        how, errors = ", ".join(dict.fromkeys(seen.said)), dict[str, float]()
        settled = fine_enough
        for of in seen.differences.values():
            settled = fine_enough and convergence.has_settled([one for name in ANSWERS for one in of[name]])
            for name, differences in of.items():
                weight = convergence.RESULTANT if name == "preload" else 1.0
                steep = convergence.STEEPER if name in STEEPENING and convergence.steepens(differences) else 1.0
                errors[name] = errors.get(name, 0.0) + steep * convergence.bound(differences, settled, weight)
        if max(seen.moved.values(), default=0.0) > 0 and beside is not None:
            own = moved_by_more_harmonics(self.first, beside - process_time())
            for name, moved in seen.moved.items():
                errors[name] += max(moved - own.get(name, 0.0), 0.0)
        if source == MESH:
            errors |= {name: max(error, LEAST) for name, error in errors.items() if error > 0}
        for name in AT_A_PEAK:
            errors[name] = max(errors[name], errors["peak_frequency"])
        plateau = 0.0 if beside is None else self._on_a_plateau(errors, beside)
        errors["energy"] = max(plateau, errors["energy"], ENERGY_OVER_AMPLITUDE * errors["amplitude"])
        if "depth" in errors:  # wear passes a depth in cycles that are inverse to the energy
            errors["life"] = errors["depth"] + errors["energy"]
            if errors["life"] > LARGEST and beside is not None and summary.life(self.result):
                errors |= self._worn_out(seen, settled, beside)
        worn = self.result.wear
        survives = worn is not None and worn.ended.survived
        for name, error in errors.items():
            if name == "depth" and survives:  # it ends where slip ends, not where the static deflection is worn off
                yield Contribution(
                    source, name, None, "the depth of a contact that survives is measured on no other mesh"
                )
            elif name == "preload" and source == MESH and self._single_element:  # off by up to twice what meshes tell
                yield Contribution(source, name, None, "a single element on a contact face tells nothing of pressure")
            elif np.isfinite(error):
                yield Contribution(source, name, error, how)
            elif not np.isfinite(errors["energy"]) and name in ("energy", "life"):
                yield Contribution(source, name, None, self.skipped)
            else:
                yield Contribution(source, name, None, "no preload says how deep the contact can wear")

    def _worn_out(self, seen: Seen, settled: bool, end: float) -> dict[str, float]:
        """Errors of depth and life from wear to its end on the other meshes; none where it does not come there.

        settled : of the unworn state; end : processor time
        For a life of which the unworn state says nothing: pressures that differ at first wear even
        """
        own = {"depth": float(self.result.depth_after(-1).max()), "life": summary.life(self.result)}
        found: dict[str, list[Difference]] = {}
        for other, model in sorted(seen.models, key=lambda one: -one[0].size):  # the coarser one is the cheaper one
            wear = other.file.scene.wear
            assert wear is not None
            try:
                with processor_seconds(end - process_time()):
                    worn = wear_run.worn_out(other.file, model, wear.lost_below)
            except (TimeUp, ValueError, RuntimeError):
                continue
            life = life_on(worn, model, wear)
            if worn.ended.failed or life is None:
                return {}
            there = {"depth": float((worn.depth[-1] + worn.worn[-1]).max()), "life": life}
            for name, value in there.items():
                found.setdefault(name, []).append(convergence.difference(other.size, value, own[name] or 0.0))
        settled = settled and convergence.has_settled([one for of in found.values() for one in of])
        return {name: convergence.bound(differences, settled) for name, differences in found.items()}

    def _on_a_plateau(self, errors: dict[str, float], end: float) -> float:
        """Error of the energy where a flat top of the response leaves open where its peak lies; inf if it takes longer.

        end : processor time
        """
        try:
            with processor_seconds(end - process_time()):
                return probes.energy_beside(self.first, errors["peak_frequency"], PLATEAU * errors["amplitude"])
        except TimeUp:
            return np.inf
        except (ValueError, RuntimeError):
            return 0.0


def life_on(worn: WearHistory, model: Model, wear: Wear) -> float | None:
    """Life [cycles] of a run on another mesh as `summary.life` has that of a result; None where it has not ended."""
    if wear.lost_of != "any":
        return cycles_to_preload(worn)
    share = wear.lost_below or LIFE_SHARE
    forces = (worn.normal_force[:, pairs].sum(axis=1) for pairs in model.reduced.info.joints.values())
    lives = [cycles_to_share(worn.cycles, force, share) for force in forces]
    return min((life for life in lives if life is not None), default=None)


def moved_by_more_harmonics(state: State, seconds: float) -> dict[str, float]:
    """Relative change of every answer by the first harmonics beyond those of a state; empty where that is not found."""
    try:
        with processor_seconds(seconds):
            finer = probes.with_more_harmonics(state, 1)
    except (TimeUp, ValueError, RuntimeError):
        return {}
    return {} if finer is None else {name: relative(a, b) for name, a, b in compared(state.answers, finer.answers)}


def element_lengths(interface: ContactInterface) -> np.ndarray:
    """(2,) mean extent [m] of the contact's faces along t1 and t2, nan where it has none."""
    if not len(interface.faces):
        return np.full(2, np.nan)
    tangents = interface.frames[interface.faces[:, 0], :2]
    along = np.einsum("fkj,fcj->fkc", interface.points[interface.faces], tangents)
    return np.asarray(np.ptp(along, axis=1).mean(axis=0))


def unknown(source: str, why: str) -> Iterator[Contribution]:
    """A source whose contribution to no quantity is known."""
    for quantity in QUANTITIES:
        yield Contribution(source, quantity, None, why)
