"""The words `tribodyn curve ...`."""

from tribodyn.workflows.command.word import group, word
from tribodyn.workflows.studies.curves.backbones import backbone
from tribodyn.workflows.studies.curves.decay import ring_down

app = group(
    "curve",
    word(backbone, "curve backbone"),
    word(ring_down, "curve ring-down"),
)
