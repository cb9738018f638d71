"""Evaluation of measured loops: numbers, their intervals of 95 %, and how they change over the cycles.

An interval holds the scatter over cycles, by a bootstrap over blocks of them (Efron and Tibshirani 1993) widened by
Student's t and by 1.4, as planted loops ask for, and, as squares, what no number of cycles removes: the rule, the
window, the delay, the compliance of the fixture, the drift of a preload without static readings. An error of
calibration is in none of them."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy import stats

from tribodyn.refusal import Refusal
from tribodyn.workflows.studies.measured.loop_cycles import LoopCycles
from tribodyn.workflows.studies.measured.loop_rules import MeanLoop, Numbers, loop_numbers, slides

FRICTION_RULES = ("largest", "plateau", "energy_sliding", "energy_travel")
STIFFNESS_RULES = ("reversal", "window")


@dataclass(frozen=True)
class LoopInterval:
    """A value with an interval of 95 %. parts : half widths, by what they come from"""

    value: float
    parts: Mapping[str, float]

    @property
    def half(self) -> float:
        """Half of its width."""
        return float(np.sqrt(sum(part**2 for part in self.parts.values())))

    @property
    def ends(self) -> tuple[float, float]:
        """Lower and upper end."""
        return self.value - self.half, self.value + self.half


@dataclass(frozen=True)
class LoopEvaluation:
    """Loops of one run. running_in : cycles left out at the beginning; history : columns over groups of cycles"""

    loop: MeanLoop
    numbers: Numbers
    intervals: Mapping[str, LoopInterval]
    running_in: int
    history: Mapping[str, np.ndarray]

    @property
    def rules(self) -> dict[str, float]:
        """Friction and tangential stiffness by all rules; nan for those that need a contact that slides."""
        needs = () if slides(self.numbers) else FRICTION_RULES[1:]
        return {rule: np.nan if rule in needs else self.numbers[rule] for rule in (*FRICTION_RULES, *STIFFNESS_RULES)}

    @cached_property
    def samples(self) -> np.ndarray:
        """(4, k) phase, displacement over the contact, forces T and N of samples that count, at most some 4000."""
        loop, chosen = self.loop, self.loop.chosen[:: max(1, len(self.loop.chosen) // 4000)]
        chosen = chosen[np.argsort(loop.cycles.phase[chosen] % 1)]
        phase, force = loop.cycles.phase[chosen], loop.cycles.tangential[chosen]
        return np.stack([phase % 1, loop.at(0, phase - loop.turn), force, loop.at(2, phase)])


@dataclass(frozen=True)
class LoopEvaluator:
    """compliance, compliance_error : of the fixture and its standard error [m/N]; window : shares of the elastic travel
    skip : cycles left out, None for those of the running-in; has_reading : whether static readings have taken the drift
    of the preload off"""

    compliance: float
    compliance_error: float
    window: tuple[float, float]
    skip: int | None
    has_reading: bool

    def runs(self, cycles: Mapping[str, LoopCycles], delay: float | None) -> dict[str, LoopEvaluation]:
        """Evaluations of all runs; without a given delay [s] all have that of the run with the largest displacement."""
        first = max(cycles, key=lambda run: float(np.ptp(cycles[run].displacement)))
        governing = self._evaluation(cycles[first], delay, 0.0)
        common = governing.intervals["delay"]
        return {
            run: governing if run == first else self._evaluation(of, common.value, common.half)
            for run, of in cycles.items()
        }

    def _evaluation(self, measured: LoopCycles, delay: float | None, uncertainty: float) -> LoopEvaluation:
        """delay : None to find it; uncertainty : half of its interval"""
        seek, turn = delay is None, (delay or 0.0) * measured.frequency
        for _ in range(2 if self.compliance and seek else 1):
            cycles = measured.over_contact(self.compliance, turn)
            weight = np.ones(cycles.n_block)
            numbers, loop = loop_numbers(MeanLoop.of(cycles, weight, turn), self.window, seek)
            turn = loop.turn
        history = self._history(loop)
        running_in = _running_in(history) if self.skip is None else self.skip
        if running_in >= cycles.count - 1:
            raise Refusal(f"--skip {running_in}: the record has {cycles.count} cycles, leave fewer out")
        if running_in:
            weight = np.bincount(cycles.block_of_cycle[running_in:], minlength=cycles.n_block).clip(max=1) * 1.0
            numbers, loop = loop_numbers(MeanLoop.of(cycles, weight, turn), self.window, seek)
        width = loop.range - numbers["sliding"]

        def again(weights: np.ndarray, start: float, is_sought: bool) -> Numbers:
            similar = replace(MeanLoop.of(cycles, weights, start), limit=loop.limit, leash=loop.leash)
            return loop_numbers(similar, self.window, is_sought, width)[0]

        rng, counted = np.random.default_rng(1), np.flatnonzero(weight)
        draws = [
            again(np.bincount(rng.choice(counted, len(counted)), minlength=cycles.n_block) * 1.0, loop.turn, seek)
            for _ in range(40)
        ]
        wide = 1.4 * float(stats.t.ppf(0.975, len(counted) - 1)) * np.sqrt(len(counted) / (len(counted) - 1))
        random = {name: wide * float(np.std([draw[name] for draw in draws])) for name in numbers}
        if seek:  # over half of the flank, where what bends it else is a quarter; as if all sliders turned with x
            narrow = loop.aligned(self.window[1] * width / 2).turn
            plain = replace(loop, leash=0.0, limit=np.nan).aligned(self.window[1] * width).turn
            uncertainty = float(np.hypot(4 * (narrow - loop.turn), plain - loop.turn)) / cycles.frequency
        late, early = (again(weight, loop.turn + s * uncertainty * cycles.frequency, False) for s in (1, -1))
        shift = {name: (late[name] - early[name]) / 2 for name in numbers}
        return LoopEvaluation(loop, numbers, self._intervals(loop, numbers, random, shift), running_in, history)

    def _intervals(
        self, loop: MeanLoop, n: Numbers, random: Mapping[str, float], shift: Mapping[str, float]
    ) -> dict[str, LoopInterval]:
        preload = loop.cycles.preload[loop.weight[loop.cycles.block_of_cycle] > 0]
        trend = 0.0 if self.has_reading else np.polyfit(np.arange(len(preload)), preload, 1)[0] * len(preload) / 2
        soft = 1.96 * self.compliance_error

        def interval(name: str, **parts: float) -> LoopInterval:
            all_parts = {"cycles": random[name], **parts, "delay": shift[name]}
            return LoopInterval(n[name], {part: abs(float(size)) for part, size in all_parts.items()})

        friction = interval("plateau", window=0.75 * n["rise"] * n["plateau"], rule=n["energy_sliding"] - n["plateau"])
        return {
            "friction": friction if slides(n) else LoopInterval(np.nan, {}),
            "stiffness": interval("reversal", window=n["reversal"] - n["window"], fixture=soft * n["reversal"] ** 2),
            "energy": interval("energy"),
            "preload": interval("preload", drift=trend),
            "sliding": interval("sliding"),
            "travel": interval("travel", fixture=soft * np.ptp(loop.series[1])),
            "delay": interval("delay"),
        }

    def _history(self, loop: MeanLoop) -> dict[str, np.ndarray]:
        """Columns over groups of cycles; cycle : the last one of each; work_J : friction work up to there."""
        cycles, blocks = loop.cycles, np.arange(loop.cycles.n_block)
        groups = np.array_split(blocks, min(len(blocks), 24))
        loops = [MeanLoop.of(cycles, np.isin(blocks, group) * 1.0, loop.turn) for group in groups]
        parts = [loop_numbers(of, self.window, seek=False)[0] for of in loops]
        last = np.array([np.flatnonzero(cycles.block_of_cycle == group[-1])[-1] + 1 for group in groups])
        names = {"energy_J": "energy", "friction": "plateau", "tangential_stiffness_N_per_m": "window",
                 "sliding_m": "sliding", "preload_N": "preload"}  # fmt: skip
        columns = {column: np.array([part[name] for part in parts]) for column, name in names.items()}
        return {"cycle": last, "work_J": np.cumsum(columns["energy_J"] * np.diff(last, prepend=0)), **columns}


def _running_in(history: Mapping[str, np.ndarray]) -> int:
    """Cycles before the energy stays within four times the scatter of the second half of the record."""
    first, second = np.array_split(history["energy_J"], 2)
    scatter = 1.4826 * np.median(np.abs(second - np.median(second)))
    outside = np.flatnonzero(np.abs(first - np.median(second)) > 4 * scatter)
    return int(history["cycle"][outside[-1]]) if len(second) > 3 and len(outside) and outside[0] == 0 else 0
