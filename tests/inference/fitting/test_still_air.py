"""What an answer owes to still air, beside the same worked out by hand."""

import dataclasses
import math

import jax.numpy as jnp
import numpy as np
import pytest

from jblast.inference.answer import Answer
from jblast.inference.density import density_of
from jblast.inference.fitting.assumptions import still_air, wider_with_wind
from jblast.report.messages import sentence_of
from jblast.scene import Scene, Sensor, UncertainScene, freed, with_values
from jblast.sensors import planned_layout, record
from jblast.sensors.path_scatter import TYPICAL, correlations, embedded
from tests.inference.logs import log

LAWS = {"air_arrival_s": "acoustic"}
PLACES = np.array([(600.0, 0.0), (-700.0, 300.0), (0.0, 900.0), (200.0, -800.0)])
FREE = ("charge_east_m", "charge_north_m", "origin_time_s")
SIGMA, SOUND = 1e-3, 340.0


def solved(scatter=False, wind=0.0, free=FREE, far=math.nan) -> Answer:
    """A log of arrivals as the truth has them, at the truth."""
    sensors = tuple(
        Sensor(f"s{i}", jnp.array([*place, 0.0]), records=(("air_arrival_s", SIGMA),))
        for i, place in enumerate(PLACES)
    )
    scene = dataclasses.replace(
        Scene(), scatter=scatter, sensors=sensors, law=tuple(LAWS.items())
    )
    scene = with_values(scene, {"air_sound_speed_m_s": SOUND, "wind_east_m_s": wind})
    layout, _, _ = planned_layout(scene)
    rows = zip(PLACES, np.asarray(record(scene, layout, LAWS).value), strict=True)
    made = log(
        *(
            (f"s{i}", "air_arrival_s", float(time), SIGMA, (*place, 0.0))
            for i, (place, time) in enumerate(rows)
        )
    )
    if not math.isnan(far):
        nothing = np.full((len(PLACES), 3), np.nan)
        ranges = np.full(len(PLACES), far)
        made = dataclasses.replace(made, position=nothing, slant_range=ranges)
    density = density_of(made, freed(UncertainScene(scene), free), "gaussian")
    start = {"air_sound_speed_m_s": SOUND}
    values = np.array([start.get(name, 0.0) for name in density.coordinates.names])
    return Answer(density, values, np.ones(len(values)))


def by_hand(scatter: bool, sd_of_wind: float) -> np.ndarray:
    r"""Sds of east, north and time with the wind among the unknowns, over without.

    Of t = t0 + |r - x| / (c + w . n): slopes -n/c to the place, 1 to the time, and
    -R n/c^2 to the wind. The law scatters by 1 % of the travel time a shot and a row,
    and rows scatter alike where their paths are neighbours.
    """
    distance = np.linalg.norm(PLACES, axis=1)
    n, travel = PLACES / distance[:, None], distance / SOUND
    fitted = np.column_stack([-n / SOUND, np.ones(len(n))])
    wind = -distance[:, None] * n / SOUND**2
    cover = np.eye(len(n)) * SIGMA**2
    if scatter:
        height = np.zeros((len(n), 1))
        paths, _ = embedded(jnp.hstack([-PLACES, height]), jnp.asarray(distance))
        alike = np.asarray(correlations(paths, paths, jnp.asarray(TYPICAL)))
        cover += 1e-4 * (1.0 + alike) * np.outer(travel, travel)
    both = np.hstack([fitted, wind])
    full = both.T @ np.linalg.inv(cover) @ both
    full += np.diag([0, 0, 0, *[1 / sd_of_wind**2] * 2])
    still = fitted.T @ np.linalg.inv(cover) @ fitted
    open_, fixed = np.linalg.inv(full), np.linalg.inv(still)
    return np.sqrt(np.diag(open_)[:3] / np.diag(fixed))


@pytest.mark.slow
@pytest.mark.parametrize("scatter", [False, True])
def test_intervals_widen_as_with_the_wind_among_the_unknowns(scatter):
    factors = wider_with_wind(solved(scatter), 5.0)
    assert factors is not None
    # by the second order of differences over 0.005 m/s and 1e-3 of a typical step
    np.testing.assert_allclose(
        [factors[name] for name in FREE], by_hand(scatter, 5.0), rtol=1e-4
    )


def words_of(answer):
    """Say what still air did to an answer."""
    (note,) = still_air(answer)
    return sentence_of(note)


def test_still_air_is_told_where_it_was_taken_and_only_there():
    factor = by_hand(False, 5.0)
    said = words_of(solved())
    assert said.startswith("still air; with unknown wind (sd 5 m/s per component)")
    assert f"charge east {factor[0]:.2g} times" in said
    assert still_air(solved(wind=3.0)) == []
    open_wind = solved(free=("charge_east_m", "wind_east_m_s"))
    assert still_air(open_wind) == []


def test_along_a_range_alone_a_wind_is_another_sound_speed():
    said = words_of(solved(free=("origin_time_s",), far=700.0))
    assert "a prior on air_sound_speed_m_s" in said
    said = words_of(solved(free=("air_sound_speed_m_s",), far=700.0))
    assert "prior" not in said  # it is fitted already
    assert "the fitted air sound speed covers it" in said
