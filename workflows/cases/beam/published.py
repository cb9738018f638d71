"""Tables of the thesis that ours stand beside."""

from __future__ import annotations

# by scene and largest depth of a step over delta_max: wear iterations, seconds on four cores, largest depth [mm], its
# error against the finest step
WEAR_STEPS: dict[str, dict[float, tuple[int, int, float, float]]] = {
    "beam": {  # table 4.2
        0.1: (130, 14220, 6.9668, 0.0899),
        0.05: (183, 21600, 6.6260, 0.0366),
        0.02: (291, 37020, 6.4849, 0.0145),
        0.01: (411, 58200, 6.4230, 0.0049),
        0.005: (577, 70320, 6.3919, 0.0),
    },
    "blade": {  # table 4.4
        0.1: (34, 1020, 8.4697, 0.026),
        0.05: (63, 2100, 8.3808, 0.015),
        0.02: (152, 4740, 8.2916, 0.004),
        0.01: (298, 9480, 8.2572, 0.0001),
        0.005: (596, 19020, 8.2566, 0.0),
    },
}
