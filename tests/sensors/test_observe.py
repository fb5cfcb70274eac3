"""Errors that are drawn, how a drawn log says what they are, and rows of a layout."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.scene import Scene, Sensor
from jblast.sensors import observe, planned_layout
from jblast.sensors.layout import joined, picked
from jblast.sensors.simulated_readings import written

SD = 0.05
SCENE = dataclasses.replace(
    Scene(),
    scatter=False,
    sensors=(
        Sensor(
            "south",
            jnp.array([0.0, -40.0, 0.0]),
            records=(
                ("bearing_rad", SD),
                ("peak_overpressure_pa", 0.1),
                ("air_arrival_s", 1e-3),
            ),
        ),
    ),
)
LAWS = {
    "bearing_rad": "line_of_sight",
    "peak_overpressure_pa": "kingery_bulmash",
    "air_arrival_s": "kingery_bulmash",
}


def test_a_bearing_about_north_is_read_on_both_sides_of_it_within_a_circle():
    layout, sigma, _ = planned_layout(SCENE)
    keys = jax.random.split(jax.random.key(0), 400)

    @jax.jit
    @jax.vmap
    def drawn(key):
        return observe(key, SCENE, layout, LAWS, sigma, noise="gaussian")

    bearing = np.asarray(drawn(keys))[:, layout.quantity.index("bearing_rad")]
    assert ((bearing >= 0) & (bearing < 2 * np.pi)).all()
    off = (bearing + np.pi) % (2 * np.pi) - np.pi
    # 400 draws know the mean to SD/20 and the sd to SD/28: four of each
    assert abs(off.mean()) < 4 * SD / 20
    assert abs(off.std() - SD) < 4 * SD / 28


def test_a_written_log_has_errors_in_the_units_of_its_values():
    layout, sigma, sensors = planned_layout(SCENE)
    value = np.array([6.2, 2e4, 0.1])
    log = written(SCENE, layout, value, np.asarray(sigma), sensors)
    # an angle and a time as planned; a pressure's tenth in pascals
    np.testing.assert_allclose(log.sigma, [SD, 2e3, 1e-3], rtol=1e-12)
    assert log.sensor == ("south",) * 3


CASES = {
    "one behind the other": [[0, 1, 2], [3, 4, 5]],
    "in turn": [[0, 2, 4], [1, 3, 5]],
    "in no order": [[4, 0], [1, 5], [3, 2]],
    "of different sizes": [[0, 5, 1, 4], [2, 3]],
    "not every row": [[0, 3], [5]],
    "a row twice": [[0, 1, 2, 3, 4, 5], [1, 3]],
}


@pytest.mark.parametrize("name", CASES)
def test_parts_are_added_up_in_their_rows(name):
    parts = [
        (np.array(rows), jnp.asarray(1.5 + np.arange(len(rows))))
        for rows in CASES[name]
    ]
    whole = np.zeros(6)
    for rows, x in parts:
        np.add.at(whole, rows, np.asarray(x))
    np.testing.assert_array_equal(joined(parts, 6), whole)


def test_rows_are_those_asked_for():
    x = jnp.arange(6.0) ** 2
    for rows in ([0, 1, 2], [1, 3, 5], [2], [4, 0, 5], [0, 3, 4]):
        np.testing.assert_array_equal(picked(x, np.array(rows)), np.array(x)[rows])
