"""The order of the tests: by room, as the imports of the product go, and what starts processes after what does not.

What is wrong in a kernel is then told by its own test, not by a run of a scene minutes later. Modules stay whole, so
that what a module sets up is set up once.
"""

from __future__ import annotations

from pathlib import Path

import pytest

ROOMS = ("geometry", "fem", "reduction", "hbm", "workflows", "properties", "cases", "documentation")
PROCESSES = ("subprocess", "multiprocessing")  # a test module that imports one of them starts processes
TESTS = Path(__file__).parent


def rank(item: pytest.Item) -> tuple[bool, int]:
    """Whether the item's module starts processes, and its room."""
    room = item.path.relative_to(TESTS).parts[0]
    starts = any(hasattr(getattr(item, "module", None), name) for name in PROCESSES)
    return starts, ROOMS.index(room) if room in ROOMS else len(ROOMS)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Sort the items; within a module they stay as they are."""
    items.sort(key=rank)
