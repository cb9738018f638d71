"""Every quantity: what it declares, and its adjoint slopes against differences of its own value."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.helpers.pressed_body import balance_of, pressed_body
from tribodyn.hbm import newton, quantity
from tribodyn.hbm.balance import HarmonicBalance
from tribodyn.hbm.harmonics import HarmonicBasis, amplitude, amplitude_slope
from tribodyn.hbm.newton import NewtonOptions
from tribodyn.hbm.quantity import CycleQuantity, Slopes, SolvedCycle, StatedQuantity
from tribodyn.refusal import Refusal

UNITS = {"Hz", "m", "rad", "J", "N", "m3", "Pa", "Pa N/m", "cycles", ""}


@pytest.fixture(scope="module")
def balance() -> HarmonicBalance:
    return balance_of(pressed_body())


@pytest.fixture(scope="module")
def cycle(balance: HarmonicBalance) -> SolvedCycle:
    """A cycle that slips, with a wear coefficient."""
    solution = newton.solve_from_rest(balance, 420.0, NewtonOptions(tolerance=1e-12))
    coefficients = {joint.name: 1e-12 for joint in balance.contact.joints}
    return SolvedCycle.of(balance, solution.state, balance.compliance.output_names[0], coefficients)


@pytest.mark.parametrize("name", quantity.FILES.names())
def test_a_quantity_declares_title_and_unit(name: str) -> None:
    loaded = quantity.load(name)
    assert isinstance(loaded, StatedQuantity)
    assert loaded.name == name
    assert loaded.title
    assert loaded.unit in UNITS


SMOOTH = [q.name for q in quantity.quantities_of(CycleQuantity) if q.slopes is not None and not q.by_place]


@pytest.mark.parametrize("name", SMOOTH)
def test_adjoint_slopes_are_those_of_the_value(name: str, balance: HarmonicBalance, cycle: SolvedCycle) -> None:
    """A random small step of displacement, force and response at once."""
    declared = quantity.load(name)
    assert isinstance(declared, CycleQuantity)
    assert cycle.displacement is not None
    assert cycle.force is not None
    assert cycle.energy.any()
    draw = np.random.default_rng(3)
    arrays = (cycle.displacement, cycle.force, cycle.response)
    step = [1e-6 * np.abs(array).max() * draw.normal(size=array.shape) for array in arrays]
    values = [declared.value(_stepped(balance, cycle, [side * part for part in step])) for side in (1, -1)]
    slopes: Slopes = declared.slopes(cycle)
    by = (slopes.by_x, slopes.by_force, slopes.by_response)
    expected = sum(float(np.vdot(slope, part)) for slope, part in zip(by, step, strict=True) if slope is not None)
    assert values[1] is not None
    assert (values[0] - values[1]) / 2 == pytest.approx(expected, rel=1e-5)


def _stepped(balance: HarmonicBalance, cycle: SolvedCycle, step: list[np.ndarray]) -> SolvedCycle:
    """The cycle moved by a step of displacement, force and response, with the numbers that follow from these."""
    assert cycle.energy is not None
    x, force, response = cycle.displacement + step[0], cycle.force + step[1], cycle.response + step[2]
    tangential = balance.contact.tangential
    work = balance.basis.work_per_cycle(force[:, tangential], x[:, tangential]).sum(axis=1)
    normal = force[:, cycle.components.index("n"), 0]
    return replace(
        cycle, displacement=x, force=force, response=response,
        amplitude=float(amplitude(response[cycle.output], balance.basis.harmonics)),
        energy=np.where(cycle.energy != 0, work, 0.0), normal_force=normal, preload=float(normal.sum()),
    )  # fmt: skip


def test_a_quantity_that_is_not_there_is_refused_with_the_known_ones() -> None:
    with pytest.raises(Refusal, match=r"no quantity 'colour'.*amplitude"):
        quantity.load("colour")


def test_a_file_without_a_declaration_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "empty.py"
    file.write_text('"""Nothing."""\n')
    quantity.use(file)
    try:
        with pytest.raises(Refusal, match="QUANTITY"):
            quantity.load("empty")
    finally:
        quantity.forget(file)


@pytest.mark.parametrize("harmonics", [(0, 1), (1,), (0, 3), (0, 1, 3), (1, 3, 5, 7), tuple(range(12))])
def test_an_amplitude_is_half_the_range_of_the_cycle(harmonics: tuple[int, ...]) -> None:
    """Against fine samples, and its slope against differences."""
    fine, draw = HarmonicBasis(harmonics, 1024 * harmonics[-1]), np.random.default_rng(0)
    row = draw.normal(size=(20, fine.n_coeff))
    assert amplitude(row, harmonics) == pytest.approx(np.ptp(fine.to_time(row), axis=1) / 2, rel=1e-5)
    step = 1e-6 * draw.normal(size=row.shape)
    change = amplitude(row + step, harmonics) - amplitude(row - step, harmonics)
    slope = np.sum(2 * step * amplitude_slope(row, harmonics), axis=1)
    np.testing.assert_allclose(change, slope, atol=1e-11)
