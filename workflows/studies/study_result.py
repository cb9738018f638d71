"""The base of the results of all studies. It loads no plots, so that a run may import a study."""

from typing import Any


class DefectInRuns(Exception):
    """Runs of a study were stopped by a defect of the program; the others are complete."""


class StudyResult:
    """Result of a study. Printed, it shows its lines, not its arrays."""

    def record(self) -> Any:
        """For machines."""
        raise NotImplementedError

    def lines(self) -> list[str]:
        """For people."""
        raise NotImplementedError

    @property
    def defects(self) -> list[str]:
        """Sentences on runs that a defect of the program stopped; the command ends with exit code 70 for them."""
        return []

    def __repr__(self) -> str:
        return "\n".join(self.lines())
