"""Long logs: searched by some of their rows, climbed by all."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.errors import InputError
from jblast.inference import posterior_of
from jblast.inference.mode.laplace import density_and_slope
from jblast.inference.mode.search import (
    MAX_SEARCH_ROWS,
    is_long,
    optima,
    row_subset,
    spread_rows,
)
from jblast.inference.posterior.fisher_information import information
from jblast.inference.posterior.parameters import parameters_of
from jblast.scene import Air, Scene, UncertainScene, freed, with_values
from jblast.sensors import layout_of, observe
from jblast.sensors.record import count_effects, path_effects, record
from jblast.sensors.simulated_readings import loadings
from tests.inference.logs import log

ARRIVAL = {"air_arrival_s": "kingery_bulmash"}
IMPULSE = {"positive_impulse_pa_s": "ford_2021"}
TRUTH = {"charge_mass_kg": 20.0, "charge_east_m": 8.0, "charge_north_m": -5.0}


def arrivals(places, rows, scatter=True):
    """A posterior of so many arrivals at places in turn, and what it is of."""
    which = np.arange(rows) % len(places)
    scene = Scene(air=Air(sound_speed=340.0), scatter=scatter)
    made = log(*((f"s{i}", "air_arrival_s", 1.0, 1e-3, places[i]) for i in which))
    layout = layout_of(made, scene)
    values = observe(
        jax.random.key(1),
        with_values(scene, TRUTH),
        layout,
        ARRIVAL,
        jnp.full(rows, 1e-3),
    )
    made = dataclasses.replace(made, value=np.asarray(values))
    parameters = parameters_of(freed(UncertainScene(scene), list(TRUTH)))
    return posterior_of(parameters, layout, made, ARRIVAL, "student")


RING = [(40.0, 0.0, 1.0), (-30.0, 35.0, 1.0), (-20.0, -45.0, 1.0), (60.0, 50.0, 1.0)]


@pytest.mark.slow
def test_the_optimum_of_a_long_log_is_that_of_all_its_rows():
    posterior = arrivals(RING, MAX_SEARCH_ROWS + 500)
    found = optima(jax.random.key(0), posterior)
    z = found.z[0]
    _, slope = density_and_slope(posterior, z)
    known = np.asarray(information(posterior, z))
    # what one more Newton step would gain, as `Laplace.decrement`
    assert 0.5 * slope @ np.linalg.solve(known, slope) < 1e-6
    sds = np.sqrt(np.diag(np.linalg.inv(known)))
    truth = np.array([np.log(20.0), 8.0, -5.0])
    np.testing.assert_array_less(np.abs(z - truth), 4 * sds)
    # by the rows that were searched it lies elsewhere, within their errors
    few = row_subset(posterior)
    assert len(few.measured) == MAX_SEARCH_ROWS
    _, slope = density_and_slope(few, z)
    assert 1e-3 < 0.5 * slope @ np.linalg.solve(known, slope) < 10
    # ends that led to the same place are told once
    assert np.isneginf(found.log_density[1:]).all()


def test_rows_are_spread_over_quantities_and_paths():
    rows = [(f"s{i % 50}", "air_arrival_s", 1.0, 1e-3, (i, 0, 0)) for i in range(2000)]
    rows += [("s0", "flash_time_s", 0.1, 1e-3, (1.0, 0.0, 0.0))]
    layout = layout_of(log(*rows), Scene())
    kept = spread_rows(layout, 120)
    assert len(kept) == len(set(kept)) == 120
    assert 2000 in kept  # the one flash
    # 119 arrivals of 50 sensors: each has two, some a third
    counts = np.bincount(np.array(layout.group)[kept[kept < 2000]])
    assert set(counts) == {2, 3}
    of_four = spread_rows(layout, 120, paths=4)
    assert len(set(np.array(layout.group)[of_four])) == 4
    np.testing.assert_array_equal(spread_rows(layout, 9999), np.arange(2001))


def test_every_clock_that_is_free_keeps_rows():
    rows = [(f"s{i}", "air_arrival_s", 1.0, 1e-3, (i, 0, 0)) for i in range(500)]
    layout = layout_of(log(*rows), Scene())
    assert 17 in spread_rows(layout, 10, clocks=["s17"])
    assert len(spread_rows(layout, 10, clocks=["s17"])) == 10


@pytest.mark.parametrize("paths", [pytest.param(20, marks=pytest.mark.slow), 40])
def test_many_paths_with_effects_make_a_log_long(paths):
    rows = [
        (f"s{i}", "positive_impulse_pa_s", 50.0, 5.0, (100.0 + i, 0.0, 0.0))
        for i in range(paths)
    ]
    made, scene = log(*rows), Scene()
    layout = layout_of(made, scene)
    parameters = parameters_of(freed(UncertainScene(scene), ["charge_mass_kg"]))
    posterior = posterior_of(parameters, layout, made, IMPULSE, "student")
    assert is_long(posterior) == (paths > 32)
    assert path_effects(scene, layout, IMPULSE) == {("positive_impulse_pa_s", 0)}
    held = loadings(record(scene, layout, IMPULSE), layout)
    assert count_effects(scene, layout, IMPULSE) == held.shape[1] == paths + 1
    exact = dataclasses.replace(scene, scatter=False)
    assert count_effects(exact, layout, IMPULSE) == 0
    assert count_effects(scene, layout, {"positive_impulse_pa_s": "swisdak"}) == 1


@pytest.mark.parametrize(("limit", "most"), [("MAX_EFFECT_NUMBERS", 30), ("WORK", 200)])
def test_more_rows_times_effects_than_can_be_held_are_refused(monkeypatch, limit, most):
    monkeypatch.setattr(f"jblast.inference.posterior.posterior.{limit}", most)
    rows = [
        (f"s{i}", "positive_impulse_pa_s", 50.0, 5.0, (100.0 + i, 0.0, 0.0))
        for i in range(6)
    ]
    made, scene = log(*rows), Scene()
    parameters = parameters_of(freed(UncertainScene(scene), ["charge_mass_kg"]))
    said = rf"6 rows of 6 paths share 7 effects; .* {most:.0e}.*: put the mean".replace(
        "+", r"\+"
    )
    with pytest.raises(InputError, match=said):
        posterior_of(parameters, layout_of(made, scene), made, IMPULSE, "student")
