"""Assumptions of a fit that are reported: wind, flat ground, paths, burial, speeds."""

import dataclasses
import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest

from jblast.constants import STANDARD_SOUND_SPEED
from jblast.inference.answer import Answer
from jblast.inference.density import density_of
from jblast.inference.fitting.assumptions import (
    EARTH_RADIUS,
    flat_ground,
    paths_taken_as_independent,
    slower_than_sound,
    still_air,
    valid_at_depth,
    wider_with_wind,
)
from jblast.inference.fitting.warnings import height_beside_the_curves, outside
from jblast.observations.places import Frame
from jblast.report.messages import sentence_of, sentences_of
from jblast.results import assumption, warning
from jblast.scene import Charge, Scene, UncertainScene, freed, with_values
from jblast.sensors.path_scatter import MAX_PATHS, TYPICAL, correlations, embedded
from jblast.waves.choice import TakenLaw
from tests.inference.logs import log

PLACES = np.array([(600.0, 0.0), (-700.0, 300.0), (0.0, 900.0), (200.0, -800.0)])
FREE = ("charge_east_m", "charge_north_m", "origin_time_s")
KNOWN_TIME = FREE[:2]
SIGMA, SOUND = 1e-3, 340.0


def solved(
    places=PLACES, free=FREE, *, scatter=False, wind=0.0, far=math.nan, ranges=False
) -> Answer:
    """Solve a log of arrivals of sound as the truth, a charge at the origin, has them.

    Args:
        places: Of the sensors.
        free: Unknowns.
        scatter: Whether laws scatter.
        wind: Towards east [m/s].
        far: Slant range instead of places [m].
        ranges: Whether slant ranges stand for places.
    """
    distance = np.linalg.norm(places, axis=1)
    time = distance / (SOUND + wind * places[:, 0] / distance)
    made = log(
        *(
            (f"s{i}", "air_arrival_s", float(t), SIGMA, (*place, 0.0))
            for i, (place, t) in enumerate(zip(places, time, strict=True))
        )
    )
    if ranges or not math.isnan(far):
        slant = distance if ranges else np.full(len(places), far)
        nowhere = np.full((len(places), 3), np.nan)
        made = replace(made, position=nowhere, slant_range=slant)
    scene = Scene(Charge(1.0), scatter=scatter, law=(("air_arrival_s", "acoustic"),))
    scene = with_values(scene, {"air_sound_speed_m_s": SOUND, "wind_east_m_s": wind})
    density = density_of(made, freed(UncertainScene(scene), list(free)), "gaussian")
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


@pytest.mark.parametrize("scatter", [False, True])
def test_intervals_widen_as_with_the_wind_among_the_unknowns(scatter):
    factors = wider_with_wind(solved(scatter=scatter), 5.0)
    assert factors is not None
    # by the second order of differences over 0.005 m/s and 1e-3 of a typical step
    np.testing.assert_allclose(
        [factors[name] for name in FREE], by_hand(scatter, 5.0), rtol=1e-4
    )


def test_still_air_is_told_where_it_was_taken_and_only_there():
    assert still_air(solved())
    assert still_air(solved(wind=3.0)) == []
    assert still_air(solved(free=("charge_east_m", "wind_east_m_s"))) == []
    # along a range alone a wind is another sound speed, unless that is fitted already
    (note,) = still_air(solved(free=("origin_time_s",), far=700.0))
    assert "a prior on air_sound_speed_m_s" in sentence_of(note)
    (note,) = still_air(solved(free=("air_sound_speed_m_s",), far=700.0))
    assert "prior" not in sentence_of(note)


def log_of(answer, factor=1.0, late=0.0):
    """Return the log of an answer with all travel times stretched and shifted."""
    made = answer.density.observations
    return replace(made, value=made.value * factor + late)


def test_arrivals_slower_than_sound_are_reported_with_sensors_and_speed():
    exact, scattered = solved(), solved(scatter=True)
    for answer in (exact, scattered):
        assert slower_than_sound(log_of(answer), answer) == []
        assert slower_than_sound(log_of(answer, 0.9), answer) == []
    (found,) = slower_than_sound(log_of(exact, 1.1), exact)
    assert set(found["sensors"]) == {"s0", "s1", "s2", "s3"}
    assert found["speed_m_s"] == pytest.approx(SOUND / 1.1, rel=1e-6)
    assert found["sound_m_s"] == pytest.approx(SOUND)
    # laws scatter by 1 % of the travel time a shot: 1 % more is one deviation
    assert slower_than_sound(log_of(scattered, 1.01), scattered) == []
    (found,) = slower_than_sound(log_of(scattered, 1.2), scattered)
    assert found["speed_m_s"] == pytest.approx(SOUND / 1.2, rel=1e-6)


def test_a_fitted_time_of_detonation_explains_a_common_delay():
    exact, known = solved(), solved(free=KNOWN_TIME)
    assert slower_than_sound(log_of(exact, late=0.5), exact) == []
    (found,) = slower_than_sound(log_of(known, late=0.5), known)
    # the nearest sensor, at 600 m, is the slowest
    assert found["sensors"][0] == "s0"
    assert found["speed_m_s"] == pytest.approx(600.0 / (600.0 / SOUND + 0.5), rel=1e-6)


def test_a_tail_wind_is_part_of_the_speed_of_sound():
    known = solved(wind=20.0, free=KNOWN_TIME)
    assert slower_than_sound(log_of(known), known) == []
    (found,) = slower_than_sound(log_of(known, late=1.0), known)
    assert found["sensors"][0] == "s0"
    assert found["sound_m_s"] == pytest.approx(SOUND + 20.0)


def independent(count, width_m=20.0, **asked):
    """What is told of microphones in a square, 200 m from a charge at the origin."""
    rng = np.random.default_rng(0)
    at = width_m * (rng.random((count, 2)) - 0.5) + [200.0, 0.0]
    answer = solved(at, **{"scatter": True} | asked)
    solution: Any = SimpleNamespace(density=answer.density, answer=answer)
    return paths_taken_as_independent(solution)


def test_many_paths_taken_as_independent_are_marked():
    more = {"paths": MAX_PATHS + 1, "limit": MAX_PATHS}
    # close together bearing and range are too sure; about the charge, or with a known
    # place, only its position and time
    close, around = warning("paths_beyond_array", **more), "paths_independent"
    assert independent(MAX_PATHS + 1) == [close]
    assert independent(MAX_PATHS + 1, 900.0) == [assumption(around, **more)]
    (found,) = independent(MAX_PATHS + 1, free=FREE[2:])
    assert found.level == "assumption"
    # correlations that count, laws that are exact, paths without directions
    assert independent(MAX_PATHS) == []
    assert independent(MAX_PATHS + 1, scatter=False) == []
    assert independent(MAX_PATHS + 1, free=FREE[2:], ranges=True) == []


MASS, UP = 1500.0, -2.1  # -0.183 m/kg^(1/3), where ford_2021 holds, to -0.2
PRESSURE, IMPULSE = "peak_overpressure_pa", "positive_impulse_pa_s"


def buried(
    up=UP,
    quantity=IMPULSE,
    law="ford_2021",
    free=("charge_mass_kg",),
    far=1500.0,
    draws=None,
    burst=None,
) -> Any:
    """What a fit found: this mass, by readings at two places."""
    rows = [
        (n, quantity, 100.0, 10.0, (x, 0.0, 0.0)) for n, x in (("a", 800.0), ("b", far))
    ]
    scene = with_values(Scene(), {"charge_mass_kg": MASS, "charge_up_m": up})
    charge = dataclasses.replace(scene.charge, burst=burst)
    scene = replace(scene, charges=(charge,), law=((quantity, law),))
    density = density_of(log(*rows), freed(UncertainScene(scene), list(free)))
    values = np.array([{"charge_mass_kg": MASS}.get(n, 0.0) for n in free])
    draws = values[None] if draws is None else draws
    return SimpleNamespace(
        density=density,
        answer=Answer(density, values, np.ones(len(free))),
        draws=SimpleNamespace(
            u=draws, values=draws, weights=np.full(len(draws), 1 / len(draws))
        ),
        laws={quantity: TakenLaw(law)},
    )


# (2.1/0.2)^3 = 1158 kg would lie at the end of the range: 0.26 below 1500 kg in ln,
# 1.6 sd of 0.16
@pytest.mark.parametrize(("sd", "holds"), [(0.15, True), (0.17, False)])
def test_an_answer_carried_into_range_by_its_own_estimate_is_marked(sd, holds):
    draws = np.exp(np.log(MASS) + sd * np.random.default_rng(0).normal(size=(8000, 1)))
    solution = buried(draws=draws)
    assert solution.answer.valid.all()
    valid = valid_at_depth(solution)
    assert (valid == holds).all()
    if not holds:
        made, there = solution.density.observations, solution.answer.valid
        assert outside(made, solution.laws, valid, there).kind.endswith("_below")


def test_draws_that_leave_a_law_by_their_east_do_not_count():
    # the far place lies at Z = 980, and the law's range ends at 1000, 230 m beyond: a
    # third of the draws leave it by their east, none by a mass known to 1 %
    drawn = np.random.default_rng(0).standard_normal((2000, 2))
    draws = np.stack([MASS * np.exp(0.01 * drawn[:, 0]), 500.0 * drawn[:, 1]], 1)
    free = ("charge_mass_kg", "charge_east_m")
    solution = buried(free=free, far=980.0 * np.cbrt(MASS), draws=draws)
    assert solution.answer.valid.all()
    assert valid_at_depth(solution).all()


@pytest.mark.parametrize(
    ("quantity", "law", "asks"),
    [
        (IMPULSE, "kingery_bulmash", True),
        (PRESSURE, "weak_shock", True),  # of two curve sets
        (IMPULSE, "swisdak", True),  # of one, where it holds
        (IMPULSE, "ford_2021", False),  # of heights themselves
    ],
)
def test_a_burst_against_the_height_is_marked_where_a_law_asks_for_it(
    quantity, law, asks
):
    solution = buried(0.0, quantity, law, burst="free-air")
    charge = solution.answer.scene.charge
    told = height_beside_the_curves(solution.answer, solution.laws, charge)
    assert any("contradicts the height" in one for one in sentences_of(told)) == asks


def flat(east, sigma, charge=(0.0, 0.0, 0.0)):
    """What is told of two sensors, one of them so far east of the origin."""
    places = {"near": (0.0, 0.0, 0.0), "far": (east, 0.0, 0.0)}
    made = log(
        *((name, "air_arrival_s", 1.0, sigma, at) for name, at in places.items())
    )
    made = replace(made, frame=Frame(10.0, 20.0, 0.0))
    at = np.tile(charge, (2, 1))
    return flat_ground(made, at, np.linalg.norm(made.position - at, axis=1))


def test_flat_ground_is_told_where_the_arc_of_a_great_circle_matters():
    assert flat(1e3, 1e-3) == []
    assert flat(20e3, 1e-3) == []  # 8 mm, 0.02 of a sigma of 1 ms
    (found,) = flat(1e5, 1e-3)
    assert found["sensor"] == "far"
    arc = 2 * EARTH_RADIUS * np.arcsin(1e5 / (2 * EARTH_RADIUS))
    # the next term of the series is 2e-5 of the first
    assert found["error_m"] == pytest.approx(arc - 1e5, rel=1e-3)
    assert found["sigmas"] == pytest.approx(
        found["error_m"] / STANDARD_SOUND_SPEED / 1e-3
    )
    # a charge 30 km away is 71 m up; a sensor 1 km nearer sees it 2.5 m further off
    (found,) = flat(29e3, 1e-2, charge=(30e3, 0.0, 0.0))
    up = 30e3**2 / (2 * EARTH_RADIUS)
    assert found["error_m"] == pytest.approx(np.hypot(1e3, up) - 1e3, rel=1e-3)
