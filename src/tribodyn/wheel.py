"""Wheels: each study takes a scene with a [wheel] and returns its numbers, lines and pictures."""

from tribodyn.workflows.studies.wheels.flutter import Flutter as Flutter, flutter as flutter
from tribodyn.workflows.studies.wheels.patterns import Patterns as Patterns, patterns as patterns
from tribodyn.workflows.studies.wheels.unequal_sectors import MistunedSectors as MistunedSectors, mistuned as mistuned
from tribodyn.workflows.studies.wheels.wheel_model import Wheel as Wheel, build as build, campbell as campbell
from tribodyn.workflows.studies.wheels.wheel_modes import WheelModes as WheelModes, modes as modes
