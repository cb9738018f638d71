"""Numbers of a hysteresis loop by the rules of laboratories.

D being the distance along the displacement from a reversal, taken a delay before the force T,

    before  T = T_0 - k_1 D        after  T = T_0 - k D + c D^2.

A rate-independent contact has no delay of its own, so that at which these fit best is that of the channels. k is
the tangential stiffness at the reversal; the slope of a line over a window of the flank is another. R being the sum of
|T_0| at both ends, the contact slides over the range of the displacement less R / k, and where it slides,
T = T_off +- mu N. With a varying N it begins and ends to slide where x - T / k turns, not x."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.optimize import minimize_scalar

from tribodyn.refusal import Refusal
from tribodyn.workflows.studies.measured.loop_cycles import LoopCycles, phase_grid

Numbers = dict[str, float]
"""Of a mean loop, in SI units, nan where it does not determine one: delay of the forces; energy; travel, the range of
the displacement, and sliding, that of the slider; reversal and window, stiffness by its rules; preload, mean normal
force; offset of T; largest, plateau, energy_sliding, energy_travel, friction by its rules; rise of |T| / N over the
plateau, relative."""


@dataclass(frozen=True)
class MeanLoop:
    """The mean loop of weighted blocks of cycles.

    weight : (n_block,) how often each block counts; series : (3, m) smooth displacement, tangential and normal force at
    m equal steps of phase; turn : delay of the forces [cycles]
    limit : T_off where the contact slides, so that T - T_off is in proportion to N before a reversal, nan elsewhere
    leash : mu / k where it slides [m/N], 0 elsewhere"""

    cycles: LoopCycles
    weight: np.ndarray
    series: np.ndarray
    turn: float
    limit: float = np.nan
    leash: float = 0.0

    @classmethod
    def of(cls, cycles: LoopCycles, weight: np.ndarray, turn: float = 0.0) -> MeanLoop:
        """The mean loop with a first guess of the delay."""
        return cls(cycles, weight, (phase_grid(cycles.order, 4096) @ cycles.harmonics(weight)).T, turn)

    @cached_property
    def ends(self) -> tuple[int, int]:
        """Places in `series` of both reversals of the slider, which is at x - T / k: where T = mu N, before or after
        those of x."""
        x, normal = self.series[0], np.roll(self.series[2], -round(self.turn * 4096))
        return int((x - self.leash * normal).argmax()), int((x + self.leash * normal).argmin())

    @cached_property
    def range(self) -> float:
        """Range of the measured displacement."""
        return float(np.ptp(self.series[0]))

    @cached_property
    def chosen(self) -> np.ndarray:
        """Samples of the blocks that count."""
        return np.flatnonzero(self.weight[self.cycles.block] > 0)

    def at(self, row: int, phase: np.ndarray) -> np.ndarray:
        """Smooth displacement, tangential or normal force at some phases."""
        return np.interp(phase % 1 * 4096, np.arange(4097), np.append(self.series[row], self.series[row][0]))

    def distance(self, samples: np.ndarray, turn: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Sense of the slider, 1 where it goes up, and distances of x since the last reversal and up to the next."""
        phase = self.cycles.phase[samples] - turn
        top, bottom = self.ends
        rises = (4096 * phase - top) % 4096 >= (bottom - top) % 4096
        x = self.at(0, phase)
        below, above = x - self.series[0, bottom], self.series[0, top] - x
        return np.where(rises, 1.0, -1.0), np.where(rises, below, above), np.where(rises, above, below)

    def flank(self, turn: float, near: tuple[np.ndarray, np.ndarray], end: int) -> tuple[np.ndarray, float]:
        """T_0, k_1, k, c at an end, 1 the upper and -1 the lower one, and the weighted sum of squares.

        turn : delay [cycles]; near : samples beside reversals, and the end that each is at"""
        samples = near[0][near[1] == end]
        sense, since, until = self.distance(samples, turn)
        after, weight = sense != end, self.weight[self.cycles.block[samples]]
        d = np.where(after, since, until) / self.range
        offset, start = 0.0, np.ones_like(d)
        if np.isfinite(self.limit):
            reversal = self.at(2, np.array([self.ends[0 if end == 1 else 1] / 4096 + turn]))
            offset, start = self.limit, np.where(after, 1.0, self.at(2, self.cycles.phase[samples]) / reversal)
        columns = np.stack([start, np.where(after, 0, -d), np.where(after, -d, 0), np.where(after, d * d, 0)])
        force, weighted = end * (self.cycles.tangential[samples] - offset), columns * weight
        solution = np.linalg.lstsq(weighted @ columns.T, weighted @ force, rcond=None)[0]
        square = float(weight @ (force - solution @ columns) ** 2)
        return solution / self.range ** np.array([0, 1, 1, 2]), square

    def near(self, width: float) -> tuple[np.ndarray, np.ndarray]:
        """Samples within a distance of a reversal, and the end that each is at."""
        sense, since, until = self.distance(self.chosen, self.turn)
        after, before = since < width, until < width
        return self.chosen[after | before], np.where(after, -sense, sense)[after | before]

    def aligned(self, width: float) -> MeanLoop:
        """The loop with the delay at which its flanks fit best, sought about its own."""
        near, reach = self.near(width), 0.02

        def misfit(turn: float) -> float:
            return sum(self.flank(turn, near, end)[1] for end in (1, -1))

        bounds = self.turn - reach, self.turn + reach
        return replace(self, turn=float(minimize_scalar(misfit, bounds=bounds, options={"xatol": 3e-5}).x))

    def line(self, end: int, low: float, high: float) -> float:
        """Slope of a straight line through the flank after an end, between two distances from it."""
        sense, since, _ = self.distance(self.chosen, self.turn)
        samples = self.chosen[inside := (sense != end) & (since > low) & (since < high)]
        if len(samples) < 3:
            return np.nan
        root = np.sqrt(self.weight[self.cycles.block[samples]])
        return float(np.polyfit(since[inside], -end * self.cycles.tangential[samples], 1, w=root)[0])

    def energy(self) -> float:
        """Of a cycle, from the harmonics of displacement and force."""
        h = np.arange(1, 1 + self.cycles.order)
        x, force = np.fft.rfft(self.series[:2])[:, h] / 4096
        return float(-4 * np.pi * h @ (x * (force * np.exp(2j * np.pi * h * self.turn)).conj()).imag)

    def largest(self, offset: float, preload: float) -> float:
        """Mean over cycles of the largest |T - T_off| / N, where N is above a tenth of the preload."""
        cycles, normal = self.cycles, self.at(2, self.cycles.phase)
        pressed, ratios = normal > 0.1 * preload, np.zeros(self.cycles.count)
        np.maximum.at(ratios, cycles.cycle[pressed], np.abs(cycles.tangential[pressed] - offset) / normal[pressed])
        return float(np.average(ratios, weights=self.weight[cycles.block_of_cycle]))

    def plateau(self, elastic: float) -> Numbers:
        """Friction in the longest part before a reversal where |T| / N rests, and mean N there. elastic : R / k"""
        sense, since, _ = self.distance(self.chosen, self.turn)
        first, numbers = 1.3 * elastic, dict.fromkeys(("offset", "plateau", "rise", "normal"), np.nan)
        for later in (0.0, 0.25, 0.5) if self.range > 1.5 * elastic else ():
            start = first + later * (self.range - first)
            samples, s = self.chosen[since > start], sense[since > start]
            n, root = self.at(2, self.cycles.phase[samples]), np.sqrt(self.weight[self.cycles.block[samples]])
            share = (since[since > start] - start) / (self.range - start) - 0.5
            columns, force = (
                np.stack([root, root * s * n, root * s * n * share], axis=1),
                self.cycles.tangential[samples],
            )
            slope = np.linalg.lstsq(columns, force * root, rcond=None)[0][2]
            offset, friction = np.linalg.lstsq(columns[:, :2], force * root, rcond=None)[0]
            numbers = {"offset": offset, "plateau": friction, "rise": slope / friction, "normal": n.mean()}
            if abs(slope / friction) < 0.01:
                break
        return {name: float(value) for name, value in numbers.items()}


def slides(numbers: Numbers) -> bool:
    """Whether |T| / N rises by less than 5 % over what is taken for its plateau: the contact slides as a whole."""
    return bool(abs(numbers["rise"]) < 0.05)


def loop_numbers(
    loop: MeanLoop, window: tuple[float, float], seek: bool = True, elastic: float | None = None
) -> tuple[Numbers, MeanLoop]:
    """Numbers of a loop, and the loop with its delay.

    window : shares of the elastic travel R / k, between which a line is laid; the flank is fitted up to the second one
    seek : whether to look for the delay; elastic : about R / k, None to look for it"""
    turned = np.roll(loop.series, -int(loop.series[0].argmax()), axis=1)
    half = int(np.argmax(turned[1].max() - turned[1] > 0.5 * np.ptp(turned[1])))
    travel = 2 * float(turned[0, 0] - turned[0, half]) if elastic is None else elastic
    for _ in range(4 if elastic is None else 1):
        loop = loop.aligned(window[1] * travel) if seek else loop
        near = loop.near(window[1] * travel)
        flanks = np.array([loop.flank(loop.turn, near, end)[0] for end in (1, -1)])
        stiffness, drop = float(flanks[:, 2].mean()), float(flanks[:, 0].sum())
        if stiffness <= 0:
            raise Refusal("force and displacement turn at other times, or a flank has few samples: give more of them")
        travel = float(np.clip(drop / stiffness, 0.02 * loop.range, loop.range))
        plateau, (top, bottom) = loop.plateau(travel), loop.ends
        slider_limit = (plateau["offset"], plateau["plateau"] / stiffness) if slides(plateau) else (np.nan, 0.0)
        loop = replace(loop, limit=slider_limit[0], leash=slider_limit[1])
    slid = float(loop.series[0, top] - loop.series[0, bottom] - drop / stiffness)
    energy, normal = loop.energy(), plateau.pop("normal")
    preload = float(np.average(loop.cycles.preload, weights=loop.weight[loop.cycles.block_of_cycle]))
    offset = plateau["offset"] if slides(plateau) else float(flanks[0, 0] - flanks[1, 0]) / 2
    return plateau | {
        "delay": loop.turn / loop.cycles.frequency, "energy": energy, "travel": loop.range, "sliding": slid,
        "preload": preload, "offset": offset, "reversal": stiffness, "largest": loop.largest(offset, preload),
        "window": float(np.mean([loop.line(end, window[0] * travel, window[1] * travel) for end in (1, -1)])),
        "energy_sliding": energy / (2 * normal * slid), "energy_travel": energy / (2 * preload * loop.range),
    }, loop  # fmt: skip
