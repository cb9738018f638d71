"""Jenkins elements stepped through the cycle, to hold the solver's contact forces and friction energy against.

Plain and slow on purpose: nothing is shared with hbm.contact. Where the solver takes samples, the march takes the same
ones. Where it locates its transitions, the march steps from instant to instant: equidistant ones, those at which a pair
touches, separates or turns from slip to stick (roots of what is prescribed, found by bisection), and some close to
each, because a stiff contact slips again at once, and slips before it separates."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tribodyn.hbm.balance import HarmonicBalance, State

# equidistant instants where the solver locates its transitions; more where too little is known
FINE = (1024, 4096, 16384)
PRECISE = 0.9  # of SMALLEST: doubt of a force that is little enough
CLOSER = 12  # instants beside a transition, each half as far from it as the one before
LONGEST = 50  # cycles after which the sliders must repeat
ROUNDING = 1e-11  # of all that adds up to a force
EPSILON = float(np.finfo(float).eps)
SMALLEST = 5e-4  # largest relative difference allowed; what the march does not know so well is held to its doubt
PAIRS = 128  # marched at a time, for the memory


@dataclass(frozen=True)
class MarchCheck:
    """A quantity beside the marched one: difference relative to it, and what the march itself may be off by.

    Both are relative to the size of the quantity. Where that is so small (zero where nothing touches) that the march
    does not know it to SMALLEST, they are relative to its doubt over SMALLEST: the difference may be the doubt."""

    name: str
    off: float
    allowed: float


def march_checks(balance: HarmonicBalance, state: State) -> list[MarchCheck]:
    """Friction forces, normal forces and friction energy of a state beside those of the march.

    Each is relative to its own size over the whole contact: an error of 0.1 % of the friction forces is seen also where
    the normal ones, or stiffness times displacement, are a thousand times larger."""
    for fine in FINE:
        checks = _checks_at(balance, state, fine)
        is_precise = all(check.off <= check.allowed < PRECISE * SMALLEST for check in checks[:2])
        if is_precise or balance.basis.transitions != "located":
            break
    return checks


def _checks_at(balance: HarmonicBalance, state: State, fine: int) -> list[MarchCheck]:
    force, doubt, work, work_doubt = _marched(balance, state, fine)
    p = balance.contact.single("this check").parameters
    across = np.linalg.norm(state.x, axis=2)
    across[:, -1] += np.abs(p.gap)
    spring = p.stiffness * across  # [N] what adds up to a force, and rounds
    theirs = state.cycle.force
    tangential, normal = slice(None, -1), slice(-1, None)
    checks = [
        _march_check(name, force[:, part] - theirs[:, part], force[:, part], doubt[:, part], spring[:, part])
        for name, part in (("friction", tangential), ("normal", normal))
    ]
    travel = np.maximum(balance.basis.order, 1) * state.x[:, tangential]
    moving = balance.basis.order * state.x[:, tangential]
    force_of, way, motion = (np.linalg.norm(array, axis=2) for array in (force[:, tangential], travel, moving))
    # the solver's forces are of double precision and round with their springs, and the work with them
    bound = np.pi * (force_of * way + EPSILON / ROUNDING * spring[:, tangential] * motion).sum(axis=1)
    energy = balance.energy(state)
    return [*checks, _march_check("work", work - energy, work, work_doubt, bound)]


def _march_check(
    name: str, difference: np.ndarray, size: np.ndarray, doubt: np.ndarray, rounds: np.ndarray
) -> MarchCheck:
    least = float(np.linalg.norm(doubt)) + ROUNDING * float(np.linalg.norm(rounds))
    size_of = max(float(np.linalg.norm(size)), least / SMALLEST, 1e-300)
    return MarchCheck(name, float(np.linalg.norm(difference)) / size_of, least / size_of)


def _marched(
    balance: HarmonicBalance, state: State, fine: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Coefficients of the forces [N] as the solver's, their doubt (n_pair, n_component), work [J] and its doubt."""
    law = _Law.of(balance)
    located, order = balance.basis.transitions == "located", balance.basis.order
    if not located:
        # in extended precision: springs of 1e15 N/m round the friction work of a march in double by 2e-10
        turn, n = 8 * np.arctan(np.longdouble(1)), balance.basis.n_samples
        angle = np.broadcast_to(turn * np.arange(n) / n, (len(state.x), n))
        means, doubt, work, slack = law.extended().through(angle, state.x.astype(np.longdouble), order, exact=True)
        return means.astype(float), doubt, work.astype(float), slack
    parts = []
    for first in range(0, len(state.x), PAIRS):
        pairs = slice(first, first + PAIRS)
        block, x = law.of_pairs(pairs), state.x[pairs]
        parts.append(block.through(_instants(block, x, order, fine), x, order, exact=False))
    force, doubt, work, work_doubt = (np.concatenate(array) for array in zip(*parts, strict=True))
    return force, doubt, work, work_doubt


def _columns(angle: np.ndarray, order: np.ndarray) -> np.ndarray:
    """(..., n_coeff) 1, cos h a, sin h a as the coefficients stand."""
    columns = []
    for position, h in enumerate(order):
        first = list(order).index(h) == position
        columns.append(np.cos(h * angle) if first else np.sin(h * angle))  # cos 0 = 1
    return np.stack(columns, axis=-1)


def _slope(x: np.ndarray, order: np.ndarray) -> np.ndarray:
    """Coefficients of the derivative by the angle: (a cos + b sin)' = h b cos - h a sin."""
    rate = np.zeros_like(x)
    for h in set(order[order > 0].tolist()):
        cosine, sine = np.flatnonzero(order == h)
        rate[..., cosine], rate[..., sine] = h * x[..., sine], -h * x[..., cosine]
    return rate


def _instants(law: _Law, x: np.ndarray, order: np.ndarray, fine: int) -> np.ndarray:
    """(n_pair, n) angles in rising order at which the pairs are stepped, transitions that the motion tells among them.

    A pair touches or separates where k_n (u_n - gap) is zero. A slider is at rest, and slip ends, where
    k_t u_t -+ mu k_n u_n is at its extreme."""
    n = max(fine, 16 * int(order[-1]))
    even = 2 * np.pi * np.arange(n + 1) / n
    pressed = law.k_n[:, None] * x[:, -1]
    drag, pull = law.k_t[:, :, None] * x[:, :-1], (law.mu[:, None] * pressed)[:, None]
    turns = np.concatenate([_slope(drag - pull, order), _slope(drag + pull, order)], axis=1)
    curves = np.concatenate([turns, pressed[:, None]], axis=1)
    shift = np.zeros(curves.shape[:2])
    shift[:, -1] = law.k_n * law.gap
    sign = curves @ _columns(even, order).T > shift[:, :, None]
    pair, curve, step = np.nonzero(sign[:, :, 1:] != sign[:, :, :-1])
    low, high, rising = even[step], even[step + 1], sign[pair, curve, step + 1]
    for _ in range(50):
        middle = 0.5 * (low + high)
        above = np.einsum("ik,ik->i", curves[pair, curve], _columns(middle, order)) > shift[pair, curve]
        high, low = np.where(above == rising, middle, high), np.where(above == rising, low, middle)
    ahead, back = (np.minimum(way, even[1]) for way in _to_neighbours(pair, high))  # a contact may be this short
    offsets = np.concatenate([0.5 ** np.arange(1, CLOSER), np.arange(1, 8) / 8])
    parts = np.concatenate([offsets, [0.0], -offsets])
    extra = (high[:, None] + np.where(parts > 0, ahead[:, None], back[:, None]) * parts) % (2 * np.pi)
    n_crossings = np.bincount(pair, minlength=len(x)).max(initial=0)
    angles = np.zeros((len(x), n + n_crossings * len(parts)))  # those that are left over are at 0, steps of no length
    angles[:, :n] = even[:-1]
    place = np.arange(len(pair)) - np.searchsorted(pair, pair)
    angles[pair[:, None], n + place[:, None] * len(parts) + np.arange(len(parts))] = extra
    return np.sort(angles, axis=1)


def _to_neighbours(pair: np.ndarray, angle: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Angles from each instant to the next and to the previous one of the same pair, round the cycle; pair rises."""
    order = np.lexsort((angle, pair))
    place = np.arange(len(pair))
    first = np.searchsorted(pair, pair)
    last = np.searchsorted(pair, pair, side="right") - 1
    sorted_angle = angle[order]
    following = np.where(place == last, sorted_angle[first] + 2 * np.pi, np.roll(sorted_angle, -1))
    before = np.where(place == first, sorted_angle[last] - 2 * np.pi, np.roll(sorted_angle, 1))
    ahead, back = np.empty_like(angle), np.empty_like(angle)
    ahead[order], back[order] = following - sorted_angle, sorted_angle - before
    return ahead, back


@dataclass(frozen=True)
class _Law:
    """Jenkins elements with a unilateral normal spring, for each pair: k_t (n_pair, n_t), the others (n_pair,)."""

    k_t: np.ndarray
    k_n: np.ndarray
    mu: np.ndarray
    gap: np.ndarray
    slider: np.ndarray

    @classmethod
    def of(cls, balance: HarmonicBalance) -> _Law:
        p = balance.contact.single("this check").parameters
        return cls(p.stiffness[:, :-1], p.stiffness[:, -1], p.numbers["friction"], p.gap, balance.memory)

    def extended(self) -> _Law:
        """The same in extended precision, where the machine has it."""
        return _Law(
            *(np.asarray(array, np.longdouble) for array in (self.k_t, self.k_n, self.mu, self.gap, self.slider))
        )

    def of_pairs(self, pairs: slice) -> _Law:
        return _Law(self.k_t[pairs], self.k_n[pairs], self.mu[pairs], self.gap[pairs], self.slider[pairs])

    def through(
        self, angle: np.ndarray, x: np.ndarray, order: np.ndarray, exact: bool
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Force coefficients, doubt, work and doubt; exact : the sums over these very samples are what is wanted."""
        phi = _columns(angle, order)
        weighted = phi * np.where(order == 0, 1.0, 2.0)
        u = np.einsum("pck,pnk->pcn", x, phi)
        force, slider = self._march(u)
        if exact:
            step = np.full(angle.shape, angle[0, 1])
            rate = np.einsum("pck,pnk->pcn", _slope(x, order)[:, :-1], phi)
            work = np.einsum("pcn,pcn,pn->p", force[:, :-1], rate, step)
            means = np.einsum("pcn,pnk->pck", force, weighted) / angle.shape[1]
            return means, np.zeros(force.shape[:2]), work, np.zeros(len(work))
        means, work, kinks, slack = self._integrals(angle, u, force, slider, weighted)
        second_samples = (angle[:, ::2], u[..., ::2], force[..., ::2], slider[..., ::2], weighted[:, ::2])
        rough, rough_work, _, _ = self._integrals(*second_samples)
        doubt, slack = 2 * np.linalg.norm(means - rough, axis=2) + kinks, 2 * np.abs(work - rough_work) + slack
        return means, doubt, work, slack  # twice: where a kink lies in its step is chance

    def _integrals(
        self, angle: np.ndarray, u: np.ndarray, force: np.ndarray, slider: np.ndarray, columns: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Means of force times columns, work on the sliders [J], and what kinks within a step change in each.

        By the trapezoidal rule; slip begins where drag and friction, both straight within a step, are equal."""
        step = np.diff(angle, axis=1, append=angle[:, :1] + 2 * np.pi)
        weight = 0.5 * (step + np.roll(step, 1, axis=1))
        f, after = force[:, :-1], np.roll(force, -1, axis=2)[:, :-1]
        slip = np.roll(slider, -1, axis=2) - slider
        drag = self.k_t[:, :, None] * (np.roll(u[:, :-1], -1, axis=2) - slider)
        way = np.where(slip >= 0, 1.0, -1.0)
        limit = self.mu[:, None, None] * force[:, -1:]
        margin, excess = limit - way * f, way * drag - np.roll(limit, -1, axis=2)
        begins = (margin > 0) & (excess > 0) & (after != 0)
        share = np.where(begins, margin / np.where(begins, margin + excess, 1.0), 0.0)
        kink = f + share * (drag - f)
        lift = 0.5 * (kink - f - share * (after - f)) * step[:, None]  # of the area under the force
        work, correction = 0.5 * (f + after) * slip, 0.5 * (kink - f) * slip
        means = np.einsum("pcn,pnk->pck", force * weight[:, None], columns)
        means[:, :-1] += np.einsum("pcn,pnk->pck", lift, columns)
        kinks = np.zeros(force.shape[:2])
        kinks[:, :-1] = np.abs(lift).sum(axis=2) / np.pi
        return means / (2 * np.pi), (work + correction).sum(axis=(1, 2)), kinks, np.abs(correction).sum(axis=(1, 2))

    def _march(self, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Forces (n_pair, n_component, n) [N] of a cycle that repeats under displacements u of the same shape [m].

        Also the sliders (n_pair, n_t, n) [m]."""
        normal = np.maximum(self.k_n[:, None] * (u[:, -1] - self.gap[:, None]), 0.0)
        touches = normal > 0
        force, sliders = np.empty_like(u), np.empty_like(u[:, :-1])
        force[:, -1] = normal
        slider = self.slider.copy()
        for _ in range(LONGEST):
            before = slider.copy()
            for j in range(u.shape[2]):
                drag = self.k_t * (u[:, :-1, j] - slider)
                limit = (self.mu * normal[:, j])[:, None]
                friction = np.clip(drag, -limit, limit)
                slips = np.abs(drag) > limit
                force[:, :-1, j] = friction
                with np.errstate(divide="ignore", invalid="ignore"):
                    slid = np.where(slips, u[:, :-1, j] - friction / self.k_t, slider)
                slider = np.where(touches[:, j, None], slid, u[:, :-1, j])
                sliders[..., j] = slider
            if np.abs(slider - before).max() <= 1e-13 * np.abs(u).max():
                break
        return force, sliders
