"""The words `tribodyn new` and `tribodyn inspect`."""

from tribodyn.workflows.command.word import word
from tribodyn.workflows.studies.draft import draft
from tribodyn.workflows.studies.inspection import inspect as inspect_source

new = word(draft, "new", into="here")
inspect = word(inspect_source, "inspect", into="asked")
