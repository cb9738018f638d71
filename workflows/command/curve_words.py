"""The words `tribodyn curve ...`."""

from cyclopts import App

from tribodyn.workflows.command.word import word
from tribodyn.workflows.studies.curves.backbones import backbone
from tribodyn.workflows.studies.curves.decay import ring_down

app = App(name="curve")
app.command(word(backbone, "curve backbone"))
app.command(word(ring_down, "curve ring-down"))
