"""The words `tribodyn wheel ...`."""

from cyclopts import App

from tribodyn.workflows.command.word import word
from tribodyn.workflows.studies.wheels.flutter import flutter
from tribodyn.workflows.studies.wheels.patterns import patterns
from tribodyn.workflows.studies.wheels.unequal_sectors import mistuned
from tribodyn.workflows.studies.wheels.wheel_modes import modes

app = App(name="wheel")
app.command(word(modes, "wheel modes"))
app.command(word(flutter, "wheel flutter"))
app.command(word(mistuned, "wheel mistuned"))
app.command(word(patterns, "wheel patterns"))
