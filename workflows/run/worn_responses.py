"""Response curves of the worn contact, on request, beside the one of the unworn contact."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.continuation.branch import Branch
from tribodyn.workflows.result.result import Result, WornResponses


def curves(
    result: Result,
    balance: HarmonicBalance,
    count: int,
    follow: Callable[[HarmonicBalance], Branch],
    advance: Callable[[float, str], None],
) -> WornResponses:
    """Response curves of the contact as worn as at `count` rows, evenly spread over what is worn, the last included.

    balance : of the unworn contact; follow : what makes a curve of a balance
    """
    assert result.wear is not None
    assert result.patch is not None
    wear, patch = result.wear, result.patch
    volume = wear.depth @ patch.area
    wanted = volume[-1] * np.arange(1, count + 1) / count
    rows = np.unique([int(np.argmin(np.abs(volume - v))) for v in wanted])
    branches = []
    for i, row in enumerate(rows):
        worn = balance.with_gap(balance.contact.gap + wear.depth[row])
        advance(i / len(rows), f"{i + 1} of {len(rows)}")
        branches.append(follow(worn))
    size = max(len(curve.omega) for curve in branches)

    def padded(values: np.ndarray) -> np.ndarray:
        return np.concatenate([values, np.full(size - len(values), np.nan)])

    return WornResponses(
        rows,
        np.stack([padded(curve.omega) for curve in branches]),
        np.stack([padded(_amplitude(curve)) for curve in branches]),
    )


def _amplitude(curve: Branch) -> np.ndarray:
    good = curve.converged
    return np.where(good, curve.amplitude(curve.output_names[0]), np.nan)
