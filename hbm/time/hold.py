"""A mean displacement that is held in time, by a force that is constant within a period.

In the balance some coordinates have a given static displacement and vibrate freely. In time an unknown static force p
on them takes its place. In the mean over a motion that repeats itself, or over a long one that does not,

    K q + B^T f = F + p,      q_held = h,

which with springs s in place of the contact and what its force differs from theirs is

    (K + B^T s B) q = F + p + B^T (s (B q) - f),      q_held = h.

After a period with the mean displacement B q and force f at the contact that gives p for the next one. Springs only
say how the contact answers to a change of p: in a motion that repeats itself every choice gives the same p. With those
that fit the period best (the regression of f on B q) p is right at once where the contact sticks or is loose.
Source  the force at a prescribed coordinate: Tamatam 2021, eq. 5.4; the correction from period to period is ours"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.linalg as sla

from tribodyn.hbm.balance import HarmonicBalance, State
from tribodyn.hbm.time.time_step import Record
from tribodyn.reduction.prescribed import PrescribedModel

SOFTEST = 1e-3  # of the contact springs: a platform that nothing else carries has no height without any


@dataclass(frozen=True)
class Hold:
    """What holds the mean displacement of some coordinates.

    dofs : (k,) coordinates; target : (k,) their mean displacement [m]; height : that of the load it came from [m]
    stiffness : (n, n) of the structure without contact; B : (n_contact, n); springs : (n_contact,) of the contact
    load : (n,) static forces [N]; base : (n_contact,) static motion of the ground [m]"""

    dofs: np.ndarray
    target: np.ndarray
    height: float
    stiffness: np.ndarray
    B: np.ndarray
    springs: np.ndarray
    load: np.ndarray
    base: np.ndarray

    @classmethod
    def of(cls, balance: HarmonicBalance, load: np.ndarray, base: np.ndarray) -> Hold | None:
        """What a balance prescribes in harmonic 0, under static forces and ground motion; None where nothing."""
        model = balance.model
        if not isinstance(model, PrescribedModel) or not balance.basis.has_static:
            return None
        reaction = model.reaction
        height = float(np.real(balance.excitation.loads.get((0, reaction.name), 0.0)))
        K, B = np.asarray(model.system.stiffness), np.asarray(model.interface.B)
        return cls(reaction.dofs, np.full(len(reaction.dofs), height), height, K, B, balance.compliance.k, load, base)

    @property
    def at(self) -> np.ndarray:
        """(n, k) unit forces on the coordinates."""
        return np.asarray(np.eye(len(self.stiffness))[:, self.dofs])

    @cached_property
    def root(self) -> np.ndarray:
        """(k, k) L, with L L^T the compliance of the coordinates with the contact stuck: |L^T p|^2 is an energy."""
        root: np.ndarray = np.linalg.cholesky(self._shapes(self.springs)[self.dofs])
        return root

    def _shapes(self, springs: np.ndarray) -> np.ndarray:
        """(n, k) displacement under unit forces on the coordinates, springs in place of the contact."""
        shapes: np.ndarray = sla.solve(self.stiffness + self.B.T @ (springs[:, None] * self.B), self.at, assume_a="pos")
        return shapes

    def force(self, x: np.ndarray, f: np.ndarray, springs: np.ndarray | None = None) -> np.ndarray:
        """(k,) force that holds the coordinates [N].

        x, f : (n_contact,) mean displacement [m] and force [N] of the contact
        springs : (n_contact,) in place of the contact, by default those of the stuck one [N/m]"""
        springs = self.springs if springs is None else springs
        shapes = self._shapes(springs)
        pull = self.load + self.B.T @ (springs * (x + self.base) - f)
        mean_force: np.ndarray = np.linalg.solve(shapes[self.dofs], self.target - shapes.T @ pull)
        return mean_force

    def in_balance(self, state: State) -> np.ndarray:
        """(k,) force that a solved state of the balance takes there [N]."""
        return self.force(state.flat[:, 0], state.cycle.force.reshape(len(self.springs), -1)[:, 0])

    def after(self, record: Record) -> np.ndarray:
        """(k,) force that holds the coordinates in the mean of a period that was marched [N]."""
        x, f = (part.reshape(len(part), -1) for part in (record.x, record.f))
        mean_x, mean_f = x.mean(axis=0), f.mean(axis=0)
        swing = x - mean_x
        size, common = (swing**2).sum(axis=0), (swing * (f - mean_f)).sum(axis=0)
        slope = np.divide(common, size, out=self.springs.copy(), where=size > 0)
        return self.force(mean_x, mean_f, np.clip(slope, SOFTEST * self.springs, self.springs))
