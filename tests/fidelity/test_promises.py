"""What the stored tables promise is kept, off every table's nodes."""

import jax
import numpy as np
import pytest

from calibration.fidelity import promises, random_path, real_errors, wilson_lower
from jblast.fidelity import choose_for
from jblast.fidelity.choose import ALIKE
from jblast.fidelity.errors import (
    BURSTS,
    REFERENCES,
    jitted_conditions,
)

FEW = 200
TOLERANCES = (0.01, 0.03, 0.1, 0.3)


@pytest.fixture(scope="module", params=BURSTS)
def path(request):
    return random_path(request.param)


@pytest.mark.slow
@pytest.mark.parametrize("quantity", REFERENCES)
def test_promises_are_kept_at_no_more_than_twice_the_cost(quantity, path):
    made = promises(quantity, path)
    for tolerance, told in made.items():
        if told.made:
            assert wilson_lower(told.kept, told.made) >= 0.99, tolerance
        assert told.good >= 0.99 * told.met
        assert told.dearest <= ALIKE
    loose = made[TOLERANCES[-1]]
    assert loose.supported > 0.4 * len(path.slant_range)
    assert loose.met >= 0.98 * loose.supported


@pytest.mark.slow
@pytest.mark.parametrize("quantity", ["air_arrival_s", "peak_overpressure_pa"])
def test_what_choose_names_is_what_the_study_counts(quantity):
    path = random_path("free-air", FEW)
    conditions = jax.tree.map(np.asarray, jitted_conditions(quantity, path))
    real = real_errors(quantity, path, conditions)
    counts = promises(quantity, path)
    for tolerance in TOLERANCES:
        choices = [
            choose_for(
                quantity,
                [jax.tree.map(lambda x, i=i: x[i : i + 1], conditions)],
                tolerance,
            )
            for i in range(FEW)
        ]
        met = [i for i, choice in enumerate(choices) if choice.met]
        assert len(met) == counts[tolerance].met
        good = [real[choices[i].method][i] <= tolerance for i in met]
        assert sum(good) >= counts[tolerance].good


@pytest.mark.parametrize(
    ("kept", "of", "lower"), [(10, 10, 0.7225), (0, 10, 0.0), (95, 100, 0.8883)]
)
def test_wilsons_interval_has_its_textbook_values(kept, of, lower):
    assert wilson_lower(kept, of) == pytest.approx(lower, abs=1e-3)
