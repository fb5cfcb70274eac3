"""What one drone knows, from draws and from the bound: the same where all is normal."""

from typing import Any

import numpy as np
import pytest

from calibration.one_drone import DOCUMENT, HOVERS, SENSES, Known, known_of, table
from calibration.world_round_trip import Fitted
from jblast.inference.importance import Importance
from jblast.inference.posterior.parameters import Parameters, parameters_of
from jblast.scene.reader.scene import world_from_document
from jblast.world import scene_of_one_blast

SD, DRAWS = 1e-3, 4000
TRUTH = {
    "charge_east_m": 30.0,
    "charge_north_m": -20.0,
    "charge_mass_kg": 6.0,
    "origin_time_s": 2.0,
}


@pytest.fixture(scope="module")
def parameters() -> Parameters:
    return parameters_of(scene_of_one_blast(*world_from_document(DOCUMENT, "drone")))


def normal(parameters: Parameters, off: float = 0.0) -> Fitted:
    """Draws of a narrow normal about the truth, or so many sd beside it."""
    at = np.array(
        [
            belief.unconstrain(TRUTH[name])
            for name, belief in zip(parameters.names, parameters.beliefs, strict=True)
        ]
    )
    noise = np.random.default_rng(0).normal(size=(DRAWS, len(at)))
    weights = np.full(DRAWS, 1 / DRAWS)
    drawn = Importance(at + SD * (noise + off), weights, 0.0, float(DRAWS))
    return Fitted(parameters, drawn, at, SD**2 * np.eye(len(at)))


def test_a_normal_posterior_is_as_wide_as_the_bound(parameters):
    sd, least, inside = known_of(normal(parameters))
    # an sd of 4,000 draws is known to 1.1 %, 5 of which
    np.testing.assert_allclose(sd, least, rtol=0.06)
    assert inside.tolist() == [1, 1, 1, 1]


def test_the_bound_of_range_is_that_of_place_seen_along_the_way(parameters):
    _, least, _ = known_of(normal(parameters))
    place = np.array([TRUTH["charge_east_m"], TRUTH["charge_north_m"]])
    slopes = []
    for name, belief in zip(parameters.names, parameters.beliefs, strict=True):
        if name in ("charge_east_m", "charge_north_m"):
            z = np.asarray(belief.unconstrain(TRUTH[name]))
            step = 1e-5
            rise = belief.constrain(z + step) - belief.constrain(z - step)
            slopes.append(float(rise) / (2 * step))
    along = place / np.hypot(np.linalg.norm(place), HOVERS[2])
    assert least[1] == pytest.approx(SD * np.linalg.norm(along * slopes), rel=1e-6)
    assert least[2] == pytest.approx(SD * np.linalg.norm(slopes), rel=1e-6)


def test_a_truth_far_outside_is_held_by_nothing(parameters):
    _, _, inside = known_of(normal(parameters, off=10.0))
    assert not inside.any()


def test_the_table_has_a_row_for_each_subset():
    some: Any = np.ones((2, 4))
    lines = table({senses: Known(some, some, some) for senses in SENSES}).splitlines()
    assert [line.split("  ")[0] for line in lines[-len(SENSES) :]] == list(SENSES)
