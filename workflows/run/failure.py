"""A solve that fails, as a run reports it."""

from tribodyn.refusal import SolverFailure


class SolveFailed(SolverFailure):
    """A solve did not converge; the message has where and why, and the result file holds what came before."""
