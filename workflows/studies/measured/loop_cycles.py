"""Time series of a friction test as cycles: frequency, phase of every sample, slow drift, sums over blocks of cycles.

A displacement is x(t) = x_0(t) + sum_h a_h cos(2 pi h phase) + b_h sin(2 pi h phase), phase = f t from where its first
harmonic is largest. The constant of each cycle, interpolated over time, is the drift: of displacement and tangential
force it is taken off, of the normal force it is the preload (a transducer's drift is corrected by static readings
before and after: Tamatam 2021, C.5)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property
from itertools import pairwise

import numpy as np

from tribodyn.refusal import Refusal


@dataclass(frozen=True)
class ForceSeries:
    """Displacement and forces over time, (n,) in SI units; time rises."""

    time: np.ndarray
    displacement: np.ndarray
    tangential: np.ndarray
    normal: np.ndarray


@dataclass(frozen=True)
class LoopCycles:
    """Samples of whole cycles.

    frequency : of the cycles [Hz]; count : of cycles; n_block : of blocks of consecutive cycles
    phase : (n,) cycles since the first reversal from above; displacement, tangential : (n,) without their slow part
    normal : (n,); preload : (count,) mean normal force of each cycle [N]
    drift : (2,) by how much the means of displacement and tangential force wander from first to last cycle [m], [N]"""

    frequency: float
    count: int
    n_block: int
    phase: np.ndarray
    displacement: np.ndarray
    tangential: np.ndarray
    normal: np.ndarray
    preload: np.ndarray
    drift: tuple[float, float]

    @classmethod
    def of(
        cls, series: ForceSeries, frequency: float | None = None, reading: Sequence[float] | None = None
    ) -> LoopCycles:
        """Whole cycles of a series.

        frequency : about that of the cycles, by default that of the largest peak of the displacement's spectrum
        reading : static normal force before and after; the mean of the record runs from the first to the second
        Raises  Refusal: fewer than two cycles, or fewer than eight samples in each"""
        rate = len(series.time) / (series.time[-1] - series.time[0])
        f = refined_frequency(series.time, series.displacement, frequency or _guess(series, rate))
        phase = f * series.time - np.angle(_first_harmonic(f, series.time, series.displacement)) / (2 * np.pi)
        phase = phase - np.ceil(phase[0])
        count = int(np.floor(phase[-1]))
        inside = (phase >= 0) & (phase < count)
        if count < 2 or inside.sum() < 8 * count:
            raise Refusal(
                f"{max(count, 0)} whole cycles at {f:.5g} Hz with {rate / f:.3g} samples each: "
                "give at least two cycles of eight samples, or their --frequency"
            )
        cycles = cls(
            f, count, min(count, 64), phase[inside], series.displacement[inside], series.tangential[inside],
            series.normal[inside], np.empty(0), (0.0, 0.0),
        )  # fmt: skip
        return cycles._without_drift(reading)

    def _without_drift(self, reading: Sequence[float] | None) -> LoopCycles:
        means = self._means(np.stack([self.displacement, self.tangential, self.normal], axis=1))
        ends = 1.5 * means[0] - 0.5 * means[1], 1.5 * means[-1] - 0.5 * means[-2]
        places = np.concatenate([[0.0], 0.5 + np.arange(self.count), [self.count]])
        slow = np.stack([np.interp(self.phase, places, mean) for mean in np.vstack([ends[0], means, ends[1]]).T])
        normal, preload = self.normal, means[:, 2]
        if reading is not None:
            line = np.linspace(reading[0], reading[1], self.count)
            centre = np.arange(self.count)
            trend = np.polyval(np.polyfit(centre, preload, 1), centre)
            preload = preload - trend + line
            normal = normal - np.interp(self.phase, 0.5 + centre, trend - line)
        x, tangential = self.displacement - slow[0], self.tangential - slow[1]
        drift = float(np.ptp(means[:, 0])), float(np.ptp(means[:, 1]))
        return replace(self, displacement=x, tangential=tangential, normal=normal, preload=preload, drift=drift)

    def _means(self, values: np.ndarray) -> np.ndarray:
        """(count, k) constant of each cycle, free of its harmonics where samples do not divide it evenly."""
        order = max(1, min(8, len(self.phase) // self.count // 3))
        ends = np.searchsorted(self.phase, np.arange(self.count + 1))
        means = []
        for first, last in pairwise(ends):
            columns = harmonic_columns(self.phase[first:last], order)
            means.append(np.linalg.lstsq(columns, values[first:last], rcond=None)[0][0])
        return np.array(means)

    def over_contact(self, compliance: float, turn: float) -> LoopCycles:
        """The cycles with the displacement over the contact alone, without that of the fixture.

        compliance : of the fixture [m/N]; turn : delay of the forces [cycles]"""
        force = np.interp(self.phase + turn, self.phase, self.tangential)
        return replace(self, displacement=self.displacement - compliance * force)

    @cached_property
    def cycle(self) -> np.ndarray:
        """(n,) cycle of each sample."""
        return np.floor(self.phase).astype(int)

    @cached_property
    def block(self) -> np.ndarray:
        """(n,) block of each sample."""
        return self.block_of_cycle[self.cycle]

    @cached_property
    def block_of_cycle(self) -> np.ndarray:
        """(count,) block of each cycle."""
        return np.arange(self.count) * self.n_block // self.count

    @property
    def order(self) -> int:
        """Harmonics that the samples of a cycle determine, 20 at the most."""
        return max(1, min(20, len(self.phase) // self.count // 3))

    @cached_property
    def columns(self) -> np.ndarray:
        """(n, 1 + 2 order) constant, cosines and sines at the samples."""
        return harmonic_columns(self.phase, self.order)

    @cached_property
    def _normal_equations(self) -> tuple[np.ndarray, np.ndarray]:
        """(n_block, m, m) and (n_block, m, 3): those of each block, for displacement, tangential and normal force."""
        both = np.stack([self.displacement, self.tangential, self.normal], axis=1)
        ends = np.searchsorted(self.block, np.arange(self.n_block + 1))
        parts = [(self.columns[a:b], both[a:b]) for a, b in pairwise(ends)]
        return np.array([c.T @ c for c, _ in parts]), np.array([c.T @ v for c, v in parts])

    def harmonics(self, weight: np.ndarray) -> np.ndarray:
        """(m, 3) coefficients of displacement, tangential and normal force. weight : (n_block,) of each block"""
        left, right = self._normal_equations
        return np.linalg.solve(np.tensordot(weight, left, 1), np.tensordot(weight, right, 1))


def harmonic_columns(phase: np.ndarray, order: int) -> np.ndarray:
    """(n, 1 + 2 order) constant, then cosine and sine of each harmonic."""
    turns = np.outer(2 * np.pi * phase, np.arange(1, order + 1))
    return np.hstack([np.ones((len(phase), 1)), np.cos(turns), np.sin(turns)])


@cache
def phase_grid(order: int, count: int) -> np.ndarray:
    """Columns at equal steps of phase."""
    return harmonic_columns(np.arange(count) / count, order)


def refined_frequency(time: np.ndarray, x: np.ndarray, frequency: float) -> float:
    """The frequency at which the phase of the first harmonic does not turn from one part of the record to the next."""
    for _ in range(4):
        n_part = int(np.clip((time[-1] - time[0]) * frequency / 2, 1, 16))
        if n_part < 2:
            break
        parts = [(time[i], x[i]) for i in np.array_split(np.arange(len(time)), n_part)]
        phase = np.unwrap([np.angle(_first_harmonic(frequency, t, values)) for t, values in parts])
        frequency -= np.polyfit([t.mean() for t, _ in parts], phase, 1)[0] / (2 * np.pi)
    return float(frequency)


def _first_harmonic(frequency: float, time: np.ndarray, x: np.ndarray) -> complex:
    """a + i b of x = a cos + b sin + higher harmonics, about a straight line."""
    order = 3
    columns = np.column_stack([time - time.mean(), harmonic_columns(frequency * time, order)])
    solution = np.linalg.lstsq(columns, x, rcond=None)[0]
    return complex(solution[2], solution[2 + order])


def _guess(series: ForceSeries, rate: float) -> float:
    even = np.linspace(series.time[0], series.time[-1], len(series.time))
    x = np.interp(even, series.time, series.displacement)
    x = x - np.polyval(np.polyfit(even - even[0], x, 1), even - even[0])
    size = np.abs(np.fft.rfft(x * np.hanning(len(x))))
    return max(int(size[1:].argmax()) + 1, 1) * rate / len(x)
