import dataclasses

import numpy as np
import pytest

from jblast.errors import InputError
from jblast.inference import batch_of, fit, fit_many
from jblast.scene import Scene, UncertainScene, freed, with_laws
from tests.inference.logs import log

OPEN = freed(UncertainScene(Scene(scatter=False)), ["charge_mass_kg"])
LAWS = {"air_arrival_s": "kingery_bulmash", "peak_overpressure_pa": "kingery_bulmash"}
SCENE = with_laws(OPEN, LAWS)


def made(*values):
    """A log of two pressures and an arrival."""
    return log(
        ("a", "peak_overpressure_pa", values[0], 100.0, (40.0, 0.0, 1.0)),
        ("b", "peak_overpressure_pa", values[1], 50.0, (0.0, 80.0, 1.0)),
        ("a", "air_arrival_s", values[2], 1e-3, (40.0, 0.0, 1.0)),
    )


LOGS = [made(9000.0, 3400.0, 0.09), made(12000.0, 4400.0, 0.086)]


@pytest.mark.slow
def test_plain_logs_are_fitted_as_one_by_one_and_a_bad_one_fails_alone():
    bad = made(-1.0, 3400.0, 0.09)
    found = fit_many(SCENE, *batch_of([LOGS[0], bad, LOGS[1]], SCENE), noise="gaussian")
    np.testing.assert_array_equal(found.bad, [False, True, False])
    np.testing.assert_array_equal(found.converged, [True, False, True])
    assert found.faults == (
        (1, "log 1, row 0, peak_overpressure_pa: expected a positive number, got -1.0"),
    )
    for lane, observations in ((0, LOGS[0]), (2, LOGS[1])):
        alone = fit(observations, SCENE, noise="gaussian").summary
        mass = alone.estimates["charge_mass_kg"]
        # both stop where a Newton step would gain 1e-4 in ln-density at most
        assert abs(np.log(found.values["charge_mass_kg"][lane] / mass.value)) < (
            0.015 * mass.log_sd
        )


def test_what_is_no_batch_is_refused():
    with pytest.raises(InputError, match="at least one, got none"):
        batch_of([], SCENE)
    with pytest.raises(InputError, match="peak_overpressure_pa: expected a name"):
        batch_of(LOGS, OPEN)
    short = log(("a", "air_arrival_s", 0.1, 1e-3, (40.0, 0.0, 1.0)))
    said = r"log 1: expected 3 rows .* got 1; .*fit_each"
    with pytest.raises(InputError, match=said):
        batch_of([LOGS[0], short], SCENE)
    moved = dataclasses.replace(LOGS[1], position=LOGS[1].position + 1.0)
    moved = dataclasses.replace(moved, source="moved.csv")
    with pytest.raises(InputError, match=r"moved.csv: row 1: expected a, peak"):
        batch_of([LOGS[0], moved], SCENE)
    mute = dataclasses.replace(LOGS[1], sigma=np.array([100.0, 50.0, np.nan]))
    with pytest.raises(InputError, match="air_arrival_s: expected a sigma"):
        batch_of([LOGS[0], mute], SCENE)


@pytest.mark.parametrize("each", [False, True], ids=["of each row", "of each log"])
def test_errors_in_the_unit_of_the_reading_are_refused_with_the_share(each):
    batch = batch_of(LOGS, SCENE)
    sigma = np.array([100.0, 50.0, 1e-3])  # Pa, Pa, s: as in the logs
    sigma = np.tile(sigma, (2, 1)) if each else sigma
    said = (
        r"relative_sigma, row 0 \(peak_overpressure_pa\).*the reading, 10500 .*0.00952"
    )
    with pytest.raises(InputError, match=said):
        fit_many(SCENE, batch.layout, batch.values, sigma, batch.laws)
