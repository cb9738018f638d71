"""The word `tribodyn verify`."""

from __future__ import annotations

from tribodyn.workflows.command.word import word
from tribodyn.workflows.studies.worn_states import verify as of_result

verify = word(of_result, "verify", into="pictures")
