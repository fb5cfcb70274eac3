"""What is heard over time has what `sensors.record` says, measured on the samples."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.scene import Charge, Scene
from jblast.sensors import Layout, even_overpressure, heard, overpressure, record
from jblast.sensors.wave_paths import AIR_QUANTITIES, DEFAULT_RECORD_LAWS

PLACE = jnp.array([18.0, 5.0, 1.5])
ON_GROUND = Scene(Charge(mass_kg=15.0, time_s=0.7, burst="surface"))
LIFTED = Scene(Charge(mass_kg=0.5, position_m=(0.0, 0.0, 15.0), burst="free-air"))
OTHER_LAWS = {
    "air_arrival_s": "kingery_bulmash",
    "peak_overpressure_pa": "kinney_graham",
    "positive_duration_s": "kinney_graham",
    "positive_impulse_pa_s": "kinney_graham",
}


def recorded(scene, place, laws):
    """Return arrival, peak, duration and impulse as `sensors.record` has them."""
    n = len(AIR_QUANTITIES)
    layout = Layout(
        quantity=AIR_QUANTITIES,
        position=jnp.broadcast_to(place, (n, 3)),
        slant_range=jnp.full(n, jnp.nan),
        time=jnp.full(n, jnp.nan),
        group=(0,) * n,
        shot=(0,) * n,
        clock=("",) * n,
    )
    return np.asarray(record(scene, layout, laws).value)


def measured(pressure, edges):
    """Return the same from samples, by their own rules."""
    width = np.diff(edges)
    loud = np.flatnonzero(pressure)
    first = loud[0]
    negative = first + np.flatnonzero(pressure[first:] < 0)[0]
    # where the pressure passes through zero within that sample, by its slope before
    before = pressure[negative - 2 : negative]
    end = (
        edges[negative] + before[1] / (before[0] - before[1]) * width[0] - width[0] / 2
    )
    return np.array(
        [
            edges[first],
            pressure.max(),
            end - edges[first],
            np.sum((pressure * width)[first:negative]),
        ]
    )


@pytest.mark.parametrize(
    ("scene", "place", "laws"),
    [
        (ON_GROUND, PLACE, DEFAULT_RECORD_LAWS),
        (ON_GROUND, 30.0 * PLACE, DEFAULT_RECORD_LAWS),
        (ON_GROUND, PLACE, OTHER_LAWS),
        (LIFTED, PLACE.at[2].set(0.0), DEFAULT_RECORD_LAWS),  # no reflection there
    ],
    ids=["near", "far", "other laws", "free air"],
)
def test_the_samples_have_the_values_of_record(scene, place, laws):
    arrival, peak, duration, impulse = recorded(scene, place, laws)
    rate = 4096 / duration
    edges = arrival + (np.arange(12_000) - 100.3) / rate
    pressure = overpressure(scene, place, edges, laws)
    found = measured(np.asarray(pressure), edges)
    np.testing.assert_allclose(found[0], arrival, rtol=0, atol=1 / rate)
    # a mean is below the peak by the slope there, (1 + b) over 1.5 samples of 4096
    np.testing.assert_allclose(found[1], peak, rtol=1e-3)
    np.testing.assert_allclose(found[2], duration, rtol=0, atol=1.5 / rate)
    np.testing.assert_allclose(found[3], impulse, rtol=1e-5)  # the last part sample


def test_heard_and_record_agree_to_the_last_digit():
    (wave,) = heard(ON_GROUND, PLACE)
    pulse = wave.pulse
    arrival, peak, duration, _ = recorded(ON_GROUND, PLACE, DEFAULT_RECORD_LAWS)
    # the same formulas compiled twice
    np.testing.assert_allclose(
        [pulse.arrival_time, pulse.peak, pulse.duration],
        [arrival, peak, duration],
        rtol=1e-14,
    )


def test_a_front_between_two_samples_lands_where_it_should():
    """The share of the first sample that the wave fills says when it came."""
    rate = 48e3
    (wave,) = heard(ON_GROUND, PLACE)
    arrival, rise = float(wave.pulse.arrival_time), float(wave.pulse.rise_time)
    shifts = np.linspace(0.05, 0.85, 9)  # at least a rise
    sample = jax.jit(
        jax.vmap(
            lambda start: overpressure(ON_GROUND, PLACE, start + np.arange(3) / rate)
        )
    )
    means = np.asarray(sample(arrival - shifts / rate))
    # behind the front, whose middle comes half a rise late
    filled = 1 - shifts - 0.5 * rise * rate
    # the slope behind the front: half a per cent of a sample of 1/530 of the duration
    np.testing.assert_allclose(means[:, 0] / float(wave.pulse.peak), filled, atol=0.002)
    assert np.all(np.diff(means[:, 0]) < 0)


def test_gradients_by_mass_range_and_arrival_are_those_of_differences():
    """To 1e-4 of the largest, the samples of the front included.

    By the origin time, which moves the arrival alone; by the range and the mass, which
    move all there is.
    """
    place = jnp.array([40.0, 0.0, 1.0])
    (wave,) = heard(ON_GROUND, place)
    edges = wave.pulse.arrival_time + jnp.linspace(-1e-3, 0.06, 201)

    def samples(mass, distance, time):
        charge = replace(ON_GROUND.charge, mass_kg=mass, time_s=time)
        there = jnp.stack([distance, 0.0 * distance, 1.0 + 0.0 * distance])
        return overpressure(replace(ON_GROUND, charges=(charge,)), there, edges)

    at = (15.0, 40.0, 0.7)
    slopes = jax.jit(jax.jacfwd(samples, argnums=(0, 1, 2)))(*at)
    both = jax.jit(samples)
    # steps small beside a sample of 0.3 ms and large beside a rounding of the clock
    for i, step in enumerate((1e-5, 1e-6, 1e-9)):
        above, below = (
            both(*at[:i], at[i] + side * step, *at[i + 1 :]) for side in (1, -1)
        )
        difference = (above - below) / (2 * step)
        largest = float(np.abs(slopes[i]).max())
        np.testing.assert_allclose(slopes[i], difference, rtol=0, atol=1e-4 * largest)
    assert np.abs(slopes[2]).max() > float(wave.pulse.peak) / 0.31e-3 / 2  # the front's


@pytest.mark.slow
def test_even_samples_are_the_same_of_all_waves():
    start, rate, count = 0.7, 10e3, 1500
    edges = start + np.arange(count + 1) / rate
    found = even_overpressure(ON_GROUND, PLACE, start, rate, count, ground=True)
    known = overpressure(ON_GROUND, PLACE, edges, ground=True)
    assert np.max(known) > 1e4
    np.testing.assert_allclose(found, known, rtol=0, atol=1e-6)
