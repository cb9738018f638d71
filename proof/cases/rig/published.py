"""What is published about the fretting rig: Tamatam 2021, chapter 5. The numbers of its text; figures are lost."""

Modes = tuple[tuple[str, float], ...]

OPEN: Modes = (
    ("tangential", 91.0), ("normal", 230.0), ("tangential", 300.0), ("tangential", 575.0), ("twisting", 840.0),
)  # fmt: skip
STUCK: Modes = (("tangential", 285.0), ("tangential", 400.0), ("twisting", 868.0), ("tangential", 1180.0))
"""Table 5.2: dominant motion and frequency [Hz]. The fourth stuck one is "bending + twisting"."""

STUCK_COMPLEX = 1800.0
"""The fifth stuck mode, "bending: complex" [Hz]: no single motion by which to know it."""

PRELOAD = 31.0
"""At the start [N]."""

TABLE_5_3 = {
    10.0: (1.5e-6, 0.2e-6),
    20.0: (20e-6, 2e-6),
    40.0: (150e-6, 5e-6),
    50.0: (450e-6, 12e-6),
    70.0: (1.4e-3, 50e-6),
}
"""Shaker force [N] -> energy per cycle [J], tangential relative displacement [m], at 290 Hz and 31 N.

The text does not say whether the displacement is an amplitude or a range. A loop of 31 N and friction 0.9 that
dissipates 450 and 1400 uJ is at least 8 and 25 um wide, so that 12 and 50 um are read as the range.
"""

FULL_SLIP = 50.0
"""Shaker force from which on the contact slides as a whole; below it there is micro-slip only [N]."""

LIFE_MEASURED, LIFE_SIMULATED = 16e6, 17e6
"""Cycles to full loss of contact, experiment and simulation."""

WORK = 12_000.0
"""Friction work to full loss of contact, experiment [J]."""

WEAR_COEFFICIENT = 5.5e-15
"""Slope of worn volume over friction work [m3/J]."""

WORN_AREA = 0.8
"""Worn part of the nominal face after loss of contact."""

FAST_CYCLES, SLOW_CYCLES = 5e6, 10e6
"""The preload falls fast in the first of these, then slowly over the second (section 5.5.2)."""

SCANS = (0.5e6, 1.5e6, 4e6, 7e6, 10e6, 13e6, 16e6)
"""Cycles at which the faces were scanned."""

WEAR_STEPS, HOURS = 89, 15.0
"""Wear iterations of one simulation, and its time on four cores."""

MATING_HEIGHTS = (0.0, 3e-6, -3e-6)
"""Simulations 1, 2, 3: shift of the first point of contact [m]."""
