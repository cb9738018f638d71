"""Graded positions along a line."""

from __future__ import annotations

import numpy as np


def towards_ends(start: float, end: float, n_elements: int, grading: float = 1.0) -> np.ndarray:
    """Split a line symmetrically, element lengths in geometric progression from both ends to the middle.

    grading : length of a middle element over that of an end element; above 1 is finer towards the ends
    Returns (n_elements + 1,) increasing positions [m], first and last exactly start and end
    """
    from_end = np.minimum(np.arange(n_elements), np.arange(n_elements)[::-1])
    return _positions(start, end, grading ** (from_end / max(from_end.max(), 1)))


def towards_start(start: float, end: float, n_elements: int, grading: float = 1.0) -> np.ndarray:
    """Split a line, element lengths in geometric progression.

    grading : length of the last element over that of the first; above 1 is finer towards the start
    Returns (n_elements + 1,) increasing positions [m], first and last exactly start and end
    """
    return _positions(start, end, grading ** (np.arange(n_elements) / max(n_elements - 1, 1)))


def towards_end(start: float, end: float, n_elements: int, grading: float = 1.0) -> np.ndarray:
    """Mirror image of `towards_start`: grading is the length of the first element over that of the last."""
    return towards_start(start, end, n_elements, 1.0 / grading)


def _positions(start: float, end: float, lengths: np.ndarray) -> np.ndarray:
    fraction = np.concatenate([[0.0], np.cumsum(lengths) / lengths.sum()])
    positions = start + (end - start) * fraction
    positions[-1] = end
    return positions
