"""The words `tribodyn wheel ...`."""

from tribodyn.workflows.command.word import group, word
from tribodyn.workflows.studies.wheels.flutter import flutter
from tribodyn.workflows.studies.wheels.patterns import patterns
from tribodyn.workflows.studies.wheels.unequal_sectors import mistuned
from tribodyn.workflows.studies.wheels.wheel_modes import modes

app = group(
    "wheel",
    word(modes, "wheel modes"),
    word(flutter, "wheel flutter"),
    word(mistuned, "wheel mistuned"),
    word(patterns, "wheel patterns"),
)
