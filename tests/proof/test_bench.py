"""The public bench: its files, its truths, and tribodyn's columns of a few problems."""

import numpy as np
import pytest

from proof.bench import events, pages, problem, record, tribodyn_columns


@pytest.mark.parametrize("name", problem.names())
def test_problems_and_results_are_as_the_bench_says(name: str) -> None:
    read, columns = problem.read(name), record.columns(name)
    assert np.allclose(read.stiffness, read.stiffness.T)
    assert len(columns) > 1
    assert all(column.head.keys() >= {"problem", "program", "source"} for column in columns.values())
    truth = columns[record.TRUTH]
    assert all(min(abs(row.frequency / w - 1) for w in read.points) < record.SAME for row in truth.points)
    assert all(row.error < 1e-3 for row in truth.points)
    assert read.title in pages.page(name)


def test_truth_from_event_to_event_is_den_hartog() -> None:
    """Den Hartog 1931: amplitude of an undamped mass that slides all the time; it dissipates 4 limit x amplitude."""
    read = problem.read("den_hartog_slides")
    row, _ = events.solve(read, ratio := 0.7)
    lag = np.sin(np.pi / ratio) / (ratio * (1 + np.cos(np.pi / ratio)))
    amplitude = np.sqrt(1 / (1 - ratio**2) ** 2 - (0.5 * lag) ** 2)
    assert [row.amplitude, row.energy] == pytest.approx([amplitude, 2 * amplitude], rel=1e-8)


@pytest.mark.parametrize("name", ["impact", "friction_mass_gross"])
def test_columns_of_tribodyn_are_those_of_the_bench(name: str) -> None:
    read = problem.read(name)
    balance = tribodyn_columns.balance_of(read)
    column, motions = tribodyn_columns.in_frequency(read, balance)
    assert record.score(column, record.columns(name)[record.TRUTH]).amplitude < 1e-3
    recorded = record.columns(name)["tribodyn"]
    assert [r.amplitude for r in column.points] == pytest.approx([r.amplitude for r in recorded.points], rel=1e-6)
    in_time = tribodyn_columns.in_time(read, balance, motions[:1])
    assert in_time.points[0].amplitude == pytest.approx(column.points[0].amplitude, rel=1e-3)
    assert name in pages.table([name])
