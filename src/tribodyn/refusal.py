"""The two ends that are no defects: a refused input, and a solver that failed."""


class Refusal(ValueError):
    """Bad input: a sentence that says what is wrong and how to mend it; the command ends with exit code 2.

    It is a ValueError so that the validators of scenes collect it.

    key : of the scene, the file or the option, value : its value, cure : what to write in its place; each "" or None
    where the sentence says it"""

    def __init__(self, sentence: str = "", *, key: str = "", value: object = None, cure: str = "") -> None:
        super().__init__(f"{sentence}: {cure}" if cure else sentence)
        self.key, self.value, self.cure = key, value, cure


class SolverFailure(RuntimeError):
    """A solver that did not reach its solution: where and why; the command ends with exit code 3."""


class SolveFailed(SolverFailure):
    """A solve did not converge; the message has where and why, and the result file holds what came before."""
