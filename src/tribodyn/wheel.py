"""Wheels: each study takes a scene with a [wheel] and returns its numbers, lines and pictures."""

from tribodyn.workflows.studies.wheels.flutter import Flutter as Flutter
from tribodyn.workflows.studies.wheels.flutter import flutter as flutter
from tribodyn.workflows.studies.wheels.mistuned_motion import PatternMotion as PatternMotion
from tribodyn.workflows.studies.wheels.mistuned_motion import pattern_motion as pattern_motion
from tribodyn.workflows.studies.wheels.mistuned_wear import MistunedWear as MistunedWear
from tribodyn.workflows.studies.wheels.mistuned_wear import pattern_wear as pattern_wear
from tribodyn.workflows.studies.wheels.mistuning import Mistuned as Mistuned
from tribodyn.workflows.studies.wheels.mistuning import mistuned as mistuned
from tribodyn.workflows.studies.wheels.modes import WheelModes as WheelModes
from tribodyn.workflows.studies.wheels.modes import modes as modes
from tribodyn.workflows.studies.wheels.patterns import Patterns as Patterns
from tribodyn.workflows.studies.wheels.patterns import patterns as patterns
from tribodyn.workflows.studies.wheels.wheel import Wheel as Wheel
from tribodyn.workflows.studies.wheels.wheel import build as build
from tribodyn.workflows.studies.wheels.wheel import campbell as campbell
from tribodyn.workflows.studies.wheels.wheel import critical_speeds as critical_speeds
