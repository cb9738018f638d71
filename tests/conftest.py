"""The order of the tests: what takes minutes first, then by room, as the imports of the product go.

Two processes share the tests by file, so that what a module sets up is set up once. A long file that began last would
keep one of them busy while the other waits. Of the others, what is wrong in a kernel is told by its own test, not by a
run of a scene minutes later; what starts processes comes last."""

import os
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest

ROOMS = ("geometry", "fem", "reduction", "hbm", "workflows", "properties", "proof", "cases", "documentation")
PROCESSES = ("subprocess", "multiprocessing")  # a test module that imports one of them starts processes
LONG = (  # more than 12 s of processor each, the longest first
    "test_pages", "test_errors", "test_rig", "test_stress", "test_lives", "test_scene_brb",
    "test_contact_events", "test_run", "test_blade_study", "test_turbine", "test_properties_solver", "test_report",
    "test_scene_leaf_seal", "test_only_what_is_needed", "test_wear_steps", "test_operating_line", "test_convergence",
    "test_scene_blade", "test_wear_laws", "test_optimise", "test_structure", "test_cli", "test_scoreboard",
    "test_wear_rules", "test_extremes", "test_pictures", "test_continuation_arc_length", "test_large", "test_study",
    "test_fit_file", "test_travelling_wave",
)  # fmt: skip
TESTS = Path(__file__).parent


def rank(item: pytest.Item) -> tuple[int, bool, int]:
    """Place of the item's module among the long ones, whether it starts processes, and its room."""
    room = item.path.relative_to(TESTS).parts[0]
    starts = any(hasattr(getattr(item, "module", None), name) for name in PROCESSES)
    long = LONG.index(item.path.stem) if item.path.stem in LONG else len(LONG)
    return long, starts, ROOMS.index(room) if room in ROOMS else len(ROOMS)


def pytest_configure(config: pytest.Config) -> None:
    """Parts and reductions that these tests make serve all of them and their subprocesses, and no other run."""
    if "TRIBODYN_CACHE" not in os.environ:
        temporary_directory = TemporaryDirectory(prefix="tribodyn-kept-")
        config.add_cleanup(temporary_directory.cleanup)
        os.environ["TRIBODYN_CACHE"] = temporary_directory.name


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Sort the items; within a module they stay as they are."""
    items.sort(key=rank)
