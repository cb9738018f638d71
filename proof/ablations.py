"""What each tuned rule of the solver is worth: it is switched off, and proofs are run without it.

Every rule is a field of a frozen dataclass. Its neutral value takes its default's place, one rule at a time, and the
outcomes are held against those of the program as it is.
"""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np

from proof import branches
from tests.helpers import coarse_scenes
from tribodyn.workflows.run import pipeline
from tribodyn.workflows.run.progress import Progress
from tribodyn.workflows.scene.scene_file import read

NEVER = math.inf

# class -> its rules with their neutral values
RULES: dict[str, dict[str, Any]] = {
    "continuation.curve_segment.CurveRules": {
        "fold_newton_share": 1.0, "fold_turn": 0.0, "turn_at_fold": NEVER, "largest_slant": NEVER,
    },
    "continuation.curve_stepper.CurveStepRules": {
        "least_length_ratio": 0.0, "fold_reach": NEVER, "largest_miss": NEVER,
    },
    "continuation.methods.arc_length.ArcLengthRules": {"max_gaps": 0, "max_rewinds": 0, "max_landings": 0},
    "continuation.methods.adaptive.AdaptiveRules": {
        "least_error_share": 0.0, "jump_error": NEVER, "snap_steps": 1.0, "crawled": 10**9, "rejected_error": 1.0,
    },
    "continuation.methods.natural.NaturalRules": {
        "least_spacing": 0.0, "max_fold_points": 10**9, "abrupt": NEVER, "max_corner_points": 200,
    },
    "continuation.resonance_peak.AtPeak": {
        "scan_miss": 0.0, "dominance": 1.0, "near_peak": NEVER, "outside_reach": 1e9, "max_refined": 1,
    },
    "wear.balance_step.StepRules": {
        "error_trend_power": 0.0, "unexpected": NEVER,
    },
    "wear.sdirk_stages.StageRules": {"retreats": 0},
    "time.period_search.SearchRules": {"thrown_off": NEVER, "lost": NEVER, "progress": 1.0},
}  # fmt: skip
SCENES = {
    "beam": (*coarse_scenes.BEAM, "verdict.enabled=false", "wear.max_steps=40"),
    "beam with harmonics 0 to 5": (
        *coarse_scenes.BEAM, "harmonics.kept=[0, 1, 2, 3, 4, 5]", "verdict.enabled=false", "wear.max_steps=12",
    ),
    "blade": coarse_scenes.BLADE,
    "rig": coarse_scenes.QUICK_RIG,
}  # fmt: skip
RELATIVE_ROUNDING = 1e-9  # relative, of numbers


@dataclass(frozen=True)
class Ablation:
    """A rule without which proofs were run. changed : sentences, one for each outcome that is another one"""

    rule: str
    neutral: float
    changed: tuple[str, ...]


@contextmanager
def without(place: str, rule: str, neutral: Any) -> Iterator[None]:
    """The program with a neutral value in place of the default of a field.

    place : of its class below `tribodyn.hbm`, such as "continuation.curve_segment.CurveRules"
    """
    name, _, kind = place.rpartition(".")
    module = import_module(f"tribodyn.hbm.{name}")
    owner = getattr(module, kind)
    parameters = inspect.signature(owner.__init__).parameters.values()
    fields = [p.name for p in parameters if p.default is not p.empty]
    before, value, rules = owner.__init__.__defaults__, getattr(owner, rule), getattr(module, "RULES", None)
    after = list(before)
    after[fields.index(rule)] = neutral
    try:
        owner.__init__.__defaults__ = tuple(after)
        setattr(owner, rule, neutral)
        if isinstance(rules, owner):
            module.RULES = owner()  # type: ignore[attr-defined]
        yield
    finally:
        owner.__init__.__defaults__ = before
        setattr(owner, rule, value)
        if rules is not None:
            module.RULES = rules  # type: ignore[attr-defined]


def outcomes(seeds: Sequence[int], scenes: Sequence[str]) -> dict[str, tuple[Any, ...]]:
    """What the branch problems of some seeds and coarse scenes come to, by name."""
    by_name: dict[str, tuple[Any, ...]] = {}
    for seed in seeds:
        curve = branches.judged(seed)
        by_name[f"problem {seed}"] = (curve.outcome, curve.folds)
    for name in scenes:
        result = pipeline.run(read(name.split()[0], SCENES[name]), None, Progress())
        wear, response = result.wear, result.response
        assert wear is not None
        size = 0.0 if response is None else float(np.abs(response.response).sum())
        by_name[name] = (wear.ended.name, len(wear.cycles), float(wear.cycles[-1]), float(wear.depth[-1].max()), size)
    return by_name


def run(chosen: Sequence[str], seeds: int, scenes: Sequence[str], say: Callable[[str], None]) -> list[Ablation]:
    """Each rule switched off in turn; chosen : names of fields, all where there are none."""
    base, rows = outcomes(range(seeds), scenes), []
    for place, rules in RULES.items():
        for rule, neutral in rules.items():
            if chosen and rule not in chosen:
                continue
            with without(place, rule, neutral):
                ablated = outcomes(range(seeds), scenes)
            changed = tuple(
                f"{name}: {base[name]} -> {ablated[name]}" for name in base if not _agree(base[name], ablated[name])
            )
            rows.append(Ablation(f"{place}.{rule}", neutral, changed))
            say(f"{rule}: {len(changed)} of {len(base)} outcomes change")
    return rows


def _agree(a: tuple[Any, ...], b: tuple[Any, ...]) -> bool:
    numbers = [(x, y) for x, y in zip(a, b, strict=True) if isinstance(x, float)]
    texts = [(x, y) for x, y in zip(a, b, strict=True) if not isinstance(x, float)]
    return all(x == y for x, y in texts) and all(abs(x - y) <= RELATIVE_ROUNDING * abs(x) for x, y in numbers)


def as_text(rows: Sequence[Ablation]) -> str:
    """The rows for people."""
    lines = []
    for row in rows:
        lines.append(f"{row.rule} = {row.neutral:g}: {len(row.changed) or 'no'} outcomes change")
        lines += [f"    {sentence}" for sentence in row.changed]
    return "\n".join(lines)
