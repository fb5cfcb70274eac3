"""A fit finds what a log was made of, says by which law, and what to doubt."""

import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest

from jblast.errors import InputError
from jblast.inference import fit
from jblast.report import summary
from jblast.report.choice import law_reason
from jblast.scene import Sensor, UncertainScene, freed, with_laws, with_values
from jblast.sensors import simulate
from jblast.waves import kingery_bulmash_pressure
from tests.catalogue import AROUND, BOTH, EXACT, MASS_FREE, TEN, TRUTH, pressures
from tests.inference.fitting.clocks_off import ASKED, heard
from tests.inference.logs import log


def test_an_exact_log_gives_its_mass_back():
    answer = fit(pressures(15.0), MASS_FREE).summary
    mass = answer.estimates["charge_mass_kg"]
    # the mode is climbed to within 1e-3 in ln of the density
    assert mass.value == pytest.approx(15.0, rel=1e-3)
    assert mass.q05 < 15.0 < mass.q95
    assert answer.converged
    assert answer.identifiable
    assert answer.law == {"peak_overpressure_pa": "kingery_bulmash"}
    assert answer.chi2 == pytest.approx(0.0, abs=1e-4)
    assert answer.dof == 2


def test_normal_errors_give_the_textbook_standard_deviation():
    # ln p falls as s ln R; with exact laws sd(ln W) = 3 sigma / (|s| sqrt n)
    log = pressures(15.0, [30.0, 30.0, 30.0])
    answer = fit(log, MASS_FREE, noise="gaussian").summary
    step = 1e-4
    slope = np.log(
        kingery_bulmash_pressure(30.0 * np.exp(step), 15.0)
        / kingery_bulmash_pressure(30.0 * np.exp(-step), 15.0)
    ) / (2 * step)
    expected = 3 * 0.1 / (abs(slope) * np.sqrt(3))
    found = answer.estimates["charge_mass_kg"].log_sd
    # an sd by some thousand draws
    assert found == pytest.approx(expected, rel=0.03)


@pytest.mark.slow
def test_one_wild_reading_among_ten_moves_the_answer_by_less_than_its_interval():
    clean = pressures(15.0, TEN)
    value = clean.value.copy()
    value[4] *= 5
    wild = dataclasses.replace(clean, value=value)
    before, after = fit(clean, MASS_FREE).summary, fit(wild, MASS_FREE).summary
    mass = before.estimates["charge_mass_kg"]
    assert mass.q05 < after.estimates["charge_mass_kg"].value < mass.q95
    assert [o.sensor for o in after.suspected_outliers] == ["s4"]
    assert before.suspected_outliers == ()


@pytest.mark.slow
def test_five_microphones_find_mass_place_and_time_they_were_simulated_with():
    scene = with_values(
        dataclasses.replace(
            EXACT,
            sensors=tuple(
                Sensor(f"m{i}", jnp.array([*place, 1.5]), records=BOTH)
                for i, place in enumerate(AROUND)
            ),
        ),
        TRUTH,
    )
    observed = simulate(UncertainScene(scene, {}), seed=1)
    asked = freed(UncertainScene(scene, {}), list(TRUTH))
    asked = dataclasses.replace(
        asked, scene=with_values(scene, dict.fromkeys(TRUTH, 1.0))
    )
    answer = fit(observed, asked).summary
    assert answer.identifiable
    assert answer.converged
    for name, value in TRUTH.items():
        found = answer.estimates[name]
        # four sds: one wrong alarm in ten thousand seeds, and this seed is fixed
        assert abs(found.value - value) < 4 * found.sd


def test_laws_are_chosen_at_the_answer_and_not_at_the_start():
    # at the starting mass of 1 kg these ranges lie beyond Z = 40
    answer = fit(pressures(1000.0, [100.0, 200.0, 350.0]), MASS_FREE).summary
    assert answer.law == {"peak_overpressure_pa": "kingery_bulmash"}
    reason = law_reason(answer.law_reason["peak_overpressure_pa"])
    assert "the reference law here" in reason
    # the mode is climbed to within 1e-3 in ln of the density
    assert answer.estimates["charge_mass_kg"].value == pytest.approx(1e3, rel=1e-3)


def without_density():
    """A log one reading of which no mass gives."""
    made = pressures(15.0)
    made.value[1] = np.nan
    return made


@pytest.mark.parametrize(
    ("made", "asked", "words"),
    [
        (
            lambda: log(("a", "air_arrival_s", 0.1, None, 40.0), at_range=True),
            MASS_FREE,
            "expected a sigma",
        ),
        (without_density, MASS_FREE, r"no value of charge_mass_kg .* row 2$"),
        (lambda: pressures(15.0, [20.0]), UncertainScene(EXACT), "nothing to fit"),
    ],
)
def test_what_cannot_be_fitted_is_refused(made, asked, words):
    with pytest.raises(InputError, match=words):
        fit(made(), asked)


def test_a_poor_fit_exits_4_and_says_so_above_its_numbers():
    made = pressures(15.0, sigma=0.02)
    made.value[:] *= [1.0, 3.0, 0.3]
    found = fit(made, MASS_FREE, noise="gaussian")
    assert found.exit_code == 4
    text = summary(found)
    assert text.index("POOR FIT (p < 0.001)") < text.index("Estimates")


def test_an_answer_whose_law_holds_for_no_row_exits_4_and_says_so():
    laws = {"peak_overpressure_pa": "kingery_bulmash"}  # to Z = 40
    beyond = fit(pressures(15.0, [200.0, 400.0, 800.0]), with_laws(MASS_FREE, laws))
    assert beyond.summary.law_valid_rows == 0
    assert beyond.exit_code == 4
    assert summary(beyond).index("OUTSIDE THE LAWS") < summary(beyond).index(
        "Estimates"
    )


@pytest.mark.slow
def test_the_band_at_a_sensor_is_what_draws_say_of_it():
    found = fit(heard("arrivals", np.random.default_rng(4)), ASKED)
    (band,) = found.bands
    numbers = np.stack([found.draws[n] for n in found.names], axis=1)[::20]
    read = found.density.seen_with(numbers).predicted
    low, high = np.quantile(read, [0.05, 0.95], axis=0)
    at = np.log(found.distance)
    for ours, theirs in ((band.q05, low), (band.q95, high)):
        # other draws of the same, 0.1 sd at the ends; a chord between places
        near = np.interp(at, np.log(band.x), ours)
        np.testing.assert_allclose(near, theirs, atol=0.1 * np.max(high - low))
