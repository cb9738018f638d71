"""Wheels: each study takes a scene with a [wheel] and returns its numbers, lines and pictures."""

from tribodyn.workflows.studies.wheels.flutter import Flutter, flutter
from tribodyn.workflows.studies.wheels.mistuned_motion import PatternMotion, pattern_motion
from tribodyn.workflows.studies.wheels.mistuned_wear import MistunedWear, pattern_wear
from tribodyn.workflows.studies.wheels.mistuning import Mistuned, mistuned
from tribodyn.workflows.studies.wheels.modes import WheelModes, modes
from tribodyn.workflows.studies.wheels.patterns import Patterns, patterns
from tribodyn.workflows.studies.wheels.wheel import Wheel, build, campbell, critical_speeds

__all__ = [
    "Flutter",
    "Mistuned",
    "MistunedWear",
    "PatternMotion",
    "Patterns",
    "Wheel",
    "WheelModes",
    "build",
    "campbell",
    "critical_speeds",
    "flutter",
    "mistuned",
    "modes",
    "pattern_motion",
    "pattern_wear",
    "patterns",
]
