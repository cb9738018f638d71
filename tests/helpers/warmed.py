"""Imported by a process that forks others: what a first run alone does is done before, such as reading the kernels."""

from tests.helpers import compiled

compiled.small_run()
