"""A solve that fails, as a run tells it."""


class SolveFailed(RuntimeError):
    """A solve did not converge; the message says where and why, and the result file holds what came before."""
