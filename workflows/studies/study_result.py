"""What all studies give. It loads no plots, so that a run may import a study."""

from __future__ import annotations


class StudyResult:
    """What a study found. Printed, it shows its lines, not its arrays."""

    def lines(self) -> list[str]:
        """For people."""
        raise NotImplementedError

    def __repr__(self) -> str:
        return "\n".join(self.lines())
