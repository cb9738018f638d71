"""The word `tribodyn verify`."""

from tribodyn.workflows.command.word import word
from tribodyn.workflows.studies.verification import verify as of_result

verify = word(of_result, "verify", into="pictures")
