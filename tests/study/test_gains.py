"""Gains by gradient through blasts: slopes, margins, peaks, what is refused."""

from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.errors import InputError
from jblast.scene import UncertainScene, read_scene
from jblast.study.flight_results import Options
from jblast.study.gains import (
    FACTORS,
    TuningSettings,
    chosen_ranks,
    drawn_flights,
    known_peaks,
    margins_to_spare,
    mean_ln_peak,
    scaled,
    tune_gains,
)
from jblast.vehicle import named, named_gains

NAMES = ("hummingbird", "iris")
"""The Crazyflie's motors lag too much for its own gains to have the margins asked
for."""


def scene_of(directory, model: str, place: str = "[0.0, 0.0, 5.0]") -> UncertainScene:
    file = directory / "scene.toml"
    file.write_text(
        "[charge]\nmass_kg = { uniform = [0.2, 2.0] }\n"
        "position_m = [{ uniform = [-5, 5] }, { uniform = [-5, 5] }, 0.0]\n"
        "time_s = 0.5\n"
        f'[vehicle]\nmodel = "{model}"\nposition_m = {place}\n'
        "control = { integral = true }\n"
    )
    return read_scene(file)


def test_each_factor_scales_what_it_says():
    gains = named_gains("iris", integral=True)
    factors = jnp.log(jnp.array([2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0]))
    found = scaled(gains, factors)
    led = scaled(replace(gains, motor_lead=jnp.asarray(2.0)), factors)
    assert float(led.lead) == 2.0
    np.testing.assert_allclose(found.position, gains.position * np.array([2.0, 2, 3]))
    np.testing.assert_allclose(found.velocity, gains.velocity * np.array([4.0, 4, 5]))
    np.testing.assert_allclose(found.integral, gains.integral * np.array([6.0, 6, 7]))
    assert float(found.attitude / gains.attitude) == pytest.approx(8.0)
    assert float(found.body_rate / gains.body_rate) == pytest.approx(9.0)


def test_what_is_asked_of_margins_is_met_at_zero():
    gains, lag = named_gains("crazyflie", integral=True), 0.072
    spare = margins_to_spare(
        jnp.zeros(FACTORS), gains, lag, 2.5e-4, jnp.array([6.0, 15.5])
    )
    assert float(spare.min()) == pytest.approx(0.0, abs=0.01)
    spare = margins_to_spare(
        jnp.zeros(FACTORS), gains, lag, 2.5e-4, jnp.array([6.0, 35.0])
    )
    assert float(spare.min()) == pytest.approx(15.5 / 35 - 1, abs=0.01)


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        (TuningSettings(vehicles=1), "vehicles: expected two blasts"),
        (TuningSettings(margin_db=-1.0), "margin_db: expected a positive number"),
        (TuningSettings(delay_s=-0.1), "delay: expected a time of 0 s or more"),
    ],
)
def test_numbers_that_cannot_be_are_named(tmp_path, settings, words):
    with pytest.raises(InputError, match=words):
        tune_gains(scene_of(tmp_path, "iris"), settings)


@pytest.mark.parametrize(("drawn", "count"), [(256, 32), (40, 32), (9, 8)])
def test_the_strongest_blasts_are_among_those_tuned_by(drawn, count):
    ranks = chosen_ranks(drawn, count)
    assert len(set(ranks.tolist())) == ranks.size == count
    assert set(range(drawn - count // 4, drawn)) <= set(ranks.tolist())
    assert ranks.min() < drawn / count


@pytest.mark.slow
def test_the_peak_has_the_slopes_of_differences(tmp_path):
    uncertain = scene_of(tmp_path, "iris")
    spec = uncertain.scene.vehicle
    assert spec is not None
    options = Options(step_s=1e-3, seconds=1.5)
    flights, _ = drawn_flights(uncertain, spec, 3, 0, options)
    gains = named_gains("iris", integral=True)
    # of which some are more and some less than what is flown
    before = jnp.log(jnp.asarray([0.001, 0.02, 0.003]))

    def of(x):
        return mean_ln_peak(x, gains, flights, before)

    (_, (_, crashed)), slopes = eqx.filter_jit(jax.value_and_grad(of, has_aux=True))(
        jnp.zeros(FACTORS)
    )
    assert not crashed.any()
    peak, width = eqx.filter_jit(lambda x: of(x)[0]), 1e-4
    for slope, step in zip(slopes, width * np.eye(FACTORS), strict=True):
        ends = [float(peak(jnp.asarray(sign * step))) for sign in (1, -1)]
        difference = (ends[0] - ends[1]) / (2 * width)
        assert float(slope) == pytest.approx(difference, rel=1e-4, abs=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("model", NAMES)
def test_peaks_over_unseen_blasts_are_a_fifth_less_within_the_margins(tmp_path, model):
    settings = TuningSettings(vehicles=16)
    tuned = tune_gains(scene_of(tmp_path, model), settings)
    after = tuned.after
    assert after.gain_margin_db >= 6.0
    assert after.phase_margin_deg >= 35.0
    assert tuned.cut() >= 0.2
    on = [one.outcomes.flies_on.mean() for one in (tuned.before, after)]
    assert on[1] >= on[0]
    assert known_peaks(after).size == 200


@pytest.mark.slow
def test_margins_that_no_gains_have_are_refused(tmp_path):
    lag = float(named("crazyflie").motor_lag_s)
    uncertain = scene_of(tmp_path, "crazyflie")
    settings = TuningSettings(vehicles=2, margin_deg=89.99, margin_db=60.0)
    with pytest.raises(
        InputError, match=r"gains have 17\.9 dB and 15\.5 degrees"
    ) as no:
        tune_gains(uncertain, settings)
    assert f"a motor lag of {lag:g} s" in str(no.value)
