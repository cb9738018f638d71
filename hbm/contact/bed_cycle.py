"""The cycle of pairs of rough faces, each a bed of springs at its deepest approach.

Springs are Jenkins elements. What does not depend on the cycle of the others is summed at once: a spring that sticks
all through the cycle is linear, and all such springs of a pair are one."""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np

from tribodyn.hbm.contact import jenkins_cycle
from tribodyn.hbm.contact.asperity import tangential_ratio
from tribodyn.hbm.contact.bed_table import SPRINGS, bed_springs
from tribodyn.hbm.contact.contact_law import SEPARATES, STICKS, ContactCycle, ContactParameters
from tribodyn.hbm.contact.laws import jenkins
from tribodyn.hbm.harmonics import HarmonicBasis


@dataclass(frozen=True)
class Bed:
    """The springs of all pairs in a cycle.

    k, g, dk, dg : (n_pair, SPRINGS), see `bed_springs`
    peak, angle : (n_pair,) deepest approach of the cycle [m] and where it is
    grows : (n_pair,) whether that is deeper than any approach before the cycle
    sliders : (n_pair, SPRINGS, n_component - 1) their memory [m]; ratio : (n_pair,) tangential over normal stiffness"""

    parameters: ContactParameters
    k: np.ndarray
    g: np.ndarray
    dk: np.ndarray
    dg: np.ndarray
    peak: np.ndarray
    angle: np.ndarray
    grows: np.ndarray
    sliders: np.ndarray
    ratio: np.ndarray

    @classmethod
    def of(cls, x, parameters: ContactParameters, memory: np.ndarray, basis: HarmonicBasis, located: bool) -> Bed:
        """The bed at the deepest approach of the cycle x (n_pair, n_component, n_coeff) [m] and its past."""
        peak, angle = deepest_of(x[:, -1], basis, located)
        peak = peak - parameters.gap
        grows = peak > memory[:, 0]
        springs = bed_springs(parameters.packed(), np.where(grows, peak, memory[:, 0]))
        sliders = memory[:, 1:].reshape(len(x), -1, SPRINGS).transpose(0, 2, 1)
        ratio = tangential_ratio(parameters.numbers["poisson"])
        return cls(parameters, *springs, peak, angle, grows, sliders, ratio)

    @property
    def friction(self) -> np.ndarray:
        """(n_pair,) coefficient."""
        return self.parameters.numbers["friction"]

    @property
    def touch(self) -> np.ndarray:
        """(n_pair, SPRINGS) normal displacement at which a spring touches [m]."""
        return self.g + self.parameters.gap[:, None]

    def elements(self, pair: np.ndarray, spring: np.ndarray) -> ContactParameters:
        """Some of the springs as Jenkins elements."""
        k = self.k[pair, spring]
        tangential = [self.ratio[pair] * k] * self.sliders.shape[2]
        stiff = np.stack([*tangential, k], axis=1)
        numbers = {"friction": self.friction[pair]}
        return ContactParameters(self.parameters.components, stiff, self.touch[pair, spring], numbers)

    def at_rest(self, x: np.ndarray, basis: HarmonicBasis) -> tuple[np.ndarray, np.ndarray]:
        """(n_pair, SPRINGS) whether a spring sticks all through the cycle x, and whether it never touches.

        Where all springs of a pair start from one slider, neither asks for the stiffness: one bound serves them all."""
        samples = basis.to_time(x)
        n, t, start = samples[:, -1], samples[:, :-1], self.sliders[:, -1]
        mu, ratio = self.friction, self.ratio
        off = np.abs(t - start[:, :, None]).max(axis=1, initial=0.0)
        slips_below = (ratio[:, None] * off - mu[:, None] * n).max(axis=1)  # sticks if below - mu touch
        opens_below = n.min(axis=1)
        if basis.transitions == "located":  # between samples a curve leaves its chord by its bend
            bend = (np.abs(x) * basis.order**2).sum(axis=2) * (2 * np.pi / basis.n_samples) ** 2 / 8
            slips_below = slips_below + ratio * bend[:, :-1].max(axis=1, initial=0.0) + mu * bend[:, -1]
            opens_below = opens_below - bend[:, -1]
        same_start = (self.sliders == start[:, None]).all(axis=(1, 2))
        sticks = slips_below[:, None] < -mu[:, None] * self.touch
        sticks &= (opens_below[:, None] > self.touch) & same_start[:, None]
        return sticks, (self.peak + self.parameters.gap)[:, None] < self.touch


def slider_positions(
    x: np.ndarray, parameters: ContactParameters, memory: np.ndarray, basis: HarmonicBasis
) -> tuple[np.ndarray, np.ndarray]:
    """Positions of the sliders of all springs over the periodic cycle x (n_pair, n_component, n_coeff), and their load.

    Returns (n_pair, SPRINGS, n_component - 1, n_samples) [m], (n_pair, SPRINGS, n_samples) normal force [N]"""
    bed = Bed.of(x, parameters, memory, basis, located=False)
    motion = basis.to_time(x)
    pressed = np.maximum(motion[:, None, -1] - bed.touch[:, :, None], 0.0)
    reach = (bed.friction / bed.ratio)[:, None, None] * pressed  # at which one slips
    at, positions = bed.sliders, np.empty((*bed.sliders.shape, basis.n_samples))
    for _ in range(2):  # the memory of Jenkins elements repeats after the first
        for i in range(basis.n_samples):
            point, off = motion[:, None, :-1, i], reach[:, :, None, i]
            at = positions[..., i] = np.clip(at, point - off, point + off)
    return positions, bed.k[:, :, None] * pressed


def cycle(x, parameters, memory, basis, jacobian=True, *, located: bool) -> ContactCycle:
    """The bed at the deepest approach of the cycle and its past.

    Springs that stick all through it are one spring; the others go by the cycle of Jenkins elements.
    x : (n_pair, n_component, n_coeff) [m]; memory : (n_pair, n_state) at the start"""
    bed = Bed.of(x, parameters, memory, basis, located)
    sticks, open_ = bed.at_rest(x, basis)
    force, slope = _stuck(bed, bed.k * sticks, x, basis, jacobian)
    add = _add_located if located else _add_sampled
    grows = bed.grows & (bed.peak > 0)
    status = np.where(sticks.any(axis=1), STICKS, 0)
    by_deepest, _ = _stuck(bed, bed.dk * sticks, x, basis, False)
    add(bed, ~(sticks | open_), x, basis, force, slope, by_deepest, status)
    status[open_[:, -1]] = SEPARATES
    if slope is not None and grows.any() and basis.has_static:
        m = slope.shape[1]
        still = m - basis.n_coeff  # the mean normal displacement: a later touch is as a wider gap
        by_deepest[:, -1, 0] -= (bed.k * bed.dg * sticks).sum(axis=1)
        functions = basis.functions(bed.angle[grows])
        slope[grows, :, still:] += by_deepest.reshape(-1, m)[grows, :, None] * functions[:, None, :]
    return ContactCycle(force, slope, status)


def _add_located(bed, active, x, basis, force, slope, by_deepest, status):
    """Add what active springs (n_pair, SPRINGS) do, their transitions located, to what the others do.

    force, by_deepest : (n_pair, n_component, n_coeff), its derivative along the deepest approach; slope : the
        Jacobian, None where not asked for; status : (n_pair,)"""
    n_pair, n_comp, n_coeff = x.shape
    pair, spring = np.nonzero(active)
    start = np.ascontiguousarray(bed.sliders[pair, spring])
    elements = bed.elements(pair, spring)
    each = jenkins_cycle.cycle(np.ascontiguousarray(x[pair]), elements, start, basis, slope is not None)
    force += _by_pair(each.force, pair, n_pair)
    np.bitwise_or.at(status, pair, each.status & ~SEPARATES)
    # the deepest spring is the last to let go: only where it opens the pair does
    deepest = spring == SPRINGS - 1
    status[pair[deepest]] |= each.status[deepest] & SEPARATES
    jac = each.jacobian
    if slope is None or jac is None:
        return
    slope += _by_pair(jac, pair, n_pair)
    k, dk, dg = (v[pair, spring, None, None] for v in (bed.k, bed.dk, bed.dg))
    relative = np.divide(dk, k, out=np.zeros_like(k), where=k > 0)
    column = jac[:, :, (n_comp - 1) * n_coeff].reshape(each.force.shape)
    by_deepest += _by_pair(relative * each.force - dg * column, pair, n_pair)


def _add_sampled(bed, active, x, basis, force, slope, by_deepest, status):
    """As `_add_located`, at the samples of the basis."""
    samples = basis.to_time(x)
    sums, weighted = np.zeros_like(samples), np.zeros_like(samples)
    jac = np.zeros((0, 0, 0)) if slope is None else slope
    column = np.zeros(x.shape)
    springs = (bed.k, bed.touch, bed.dk, bed.dg, bed.ratio, bed.friction)
    start = np.ascontiguousarray(bed.sliders)
    _sum(samples, *springs, start, active, basis.synthesis, *basis.prefix_sums, sums, weighted, jac, column, status)
    force += basis.from_time(sums)
    if slope is not None:
        by_deepest += basis.from_time(weighted) + column


@numba.njit(cache=True)
def _sum(x, k, touch, dk, dg, ratio, mu, sliders, active, phi, product, single, force, weighted, jac, column, status):
    """Forces of the active springs (n_pair, n_component, n_samples), the same times dk / k, and their derivatives."""
    n_pair, n_comp, n_time = x.shape
    n_coeff, has_slope = phi.shape[1], jac.shape[0] > 0
    m, still = n_comp * n_coeff, (n_comp - 1) * n_coeff
    kind, slider = np.empty(n_time, np.int8), np.empty(n_time)
    f, stiff = np.empty((n_comp, n_time)), np.empty(n_comp)
    slope = np.zeros((m, m)) if has_slope else np.zeros((0, 0))
    for i in range(n_pair):
        for q in range(SPRINGS):
            if not active[i, q]:
                continue
            stiff[: n_comp - 1], stiff[n_comp - 1] = ratio[i] * k[i, q], k[i, q]
            if has_slope:
                slope[:] = 0.0
            bits = jenkins.element(
                stiff, mu[i], touch[i, q], sliders[i, q], x[i], phi, product, single, f, slope, kind, slider
            )
            # the deepest spring is the last to let go: only where it opens the pair does
            status[i] |= bits if q == SPRINGS - 1 else bits & ~SEPARATES
            share = dk[i, q] / k[i, q] if k[i, q] > 0.0 else 0.0
            for c in range(n_comp):  # in loops: sums of arrays take numba seconds to compile
                for j in range(n_time):
                    force[i, c, j] += f[c, j]
            if not has_slope:
                continue
            for a in range(m):
                for b in range(m):
                    jac[i, a, b] += slope[a, b]
            for c in range(n_comp):
                for j in range(n_time):
                    weighted[i, c, j] += share * f[c, j]
            for c in range(n_comp):
                for a in range(n_coeff):
                    column[i, c, a] -= dg[i, q] * slope[c * n_coeff + a, still]


def _stuck(
    bed: Bed, k: np.ndarray, x: np.ndarray, basis: HarmonicBasis, jacobian: bool
) -> tuple[np.ndarray, np.ndarray | None]:
    """Force of springs k (n_pair, SPRINGS) [N/m] that stick all through the cycle x, and its derivative."""
    normal = k.sum(axis=1)
    stiff = np.concatenate([(bed.ratio * normal)[:, None]] * (x.shape[1] - 1) + [normal[:, None]], axis=1)
    force = stiff[:, :, None] * x
    if basis.has_static:
        force[:, :-1, 0] -= stiff[:, :-1] * bed.sliders[:, -1]
        force[:, -1, 0] -= (k * bed.touch).sum(axis=1)
    if not jacobian:
        return force, None
    m = force[0].size
    slope = np.zeros((len(x), m, m))
    slope[:, np.arange(m), np.arange(m)] = np.repeat(stiff, x.shape[2], axis=1)
    return force, slope


def _by_pair(values: np.ndarray, pair: np.ndarray, n_pair: int) -> np.ndarray:
    """Sums (n_pair, ...) of values (n, ...) whose pairs (n,) rise."""
    sums = np.zeros((n_pair, *values.shape[1:]))
    starts = np.flatnonzero(np.diff(pair, prepend=-1))
    if len(starts):
        sums[pair[starts]] = np.add.reduceat(values, starts, axis=0)
    return sums


def deepest_of(x: np.ndarray, basis: HarmonicBasis, located: bool) -> tuple[np.ndarray, np.ndarray]:
    """Largest value (n_pair,) of displacements (n_pair, n_coeff) over the period, and the angle at which it is met."""
    samples = basis.to_time(x)
    at = samples.argmax(axis=1)
    angle = 2 * np.pi * at / basis.n_samples
    value = samples[np.arange(len(x)), at]
    if not located:
        return value, angle
    first = x @ basis.rate
    for _ in range(4):  # Newton on the slope, from the highest sample
        functions = basis.functions(angle)
        slope = (first * functions).sum(axis=1)
        bend = ((first @ basis.rate) * functions).sum(axis=1)
        angle = angle - np.divide(slope, bend, out=np.zeros_like(slope), where=bend < 0)
    finer = (x * basis.functions(angle)).sum(axis=1)
    better = finer > value
    return np.where(better, finer, value), np.where(better, angle, 2 * np.pi * at / basis.n_samples)
