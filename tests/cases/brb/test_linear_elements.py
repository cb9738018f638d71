"""The published frequencies of the beam apart are those of linear elements with reduced integration.

Run with `pytest -m slow tests/cases/brb/test_linear_elements.py`; it prints the table of the beam's page."""

import numpy as np
import pytest

import tribodyn as td

PUBLISHED = np.array([70.323, 151.26, 609.25])  # five elements through the lap, ten across the beam


@pytest.mark.slow
@pytest.mark.parametrize(("through", "across", "within"), [(4, 4, 0.025), (6, 10, 0.02)])
def test_linear_reduced_elements_have_the_published_frequencies(through, across, within, capsys):
    """Each row is printed: elements, DOFs, frequencies, and how far they are from the published ones."""
    counts = [f"bodies.{h}.{k}" for h in ("lower", "upper") for k in (f"n_lap={through // 2}", f"n_side={across // 2}")]
    requested = [*counts, "materials.steel.elements=linear_reduced"]
    hertz = np.array(td.inspect("brb", modes=10, overrides=requested).record()["frequencies_hz"])
    result = hertz[7:10]
    with capsys.disabled():
        print(f"\n{through} through the lap, {across} across: {result.round(2)} Hz, {100 * (result / PUBLISHED - 1)} %")
    assert max(hertz[:7]) < 0.1
    np.testing.assert_allclose(result, PUBLISHED, rtol=within)
