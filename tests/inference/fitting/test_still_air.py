"""What an answer owes to still air, beside the same worked out by hand."""

import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest

from jblast.inference import Posterior
from jblast.inference.fitting.assumptions import still_air, wider_with_wind
from jblast.inference.fitting.solution import Solution
from jblast.inference.identifiability import identifiability
from jblast.inference.mode.laplace import laplace
from jblast.inference.posterior.parameters import parameters_of
from jblast.report.fit.findings import words
from jblast.scene import Scene, Sensor, UncertainScene, freed, with_values
from jblast.sensors import planned_layout, record
from jblast.sensors.path_scatter import TYPICAL, correlations, embedded

LAWS = {"air_arrival_s": "acoustic"}
PLACES = np.array([(600.0, 0.0), (-700.0, 300.0), (0.0, 900.0), (200.0, -800.0)])
FREE = ("charge_east_m", "charge_north_m", "origin_time_s")
SIGMA, SOUND = 1e-3, 340.0


def solved(scatter=False, wind=0.0, free=FREE):
    """A log of arrivals as the truth has them, solved at the truth."""
    records = (("air_arrival_s", SIGMA),)
    sensors = tuple(
        Sensor(f"s{i}", jnp.array([*place, 0.0]), records=records)
        for i, place in enumerate(PLACES)
    )
    scene = dataclasses.replace(Scene(), scatter=scatter, sensors=sensors)
    scene = with_values(scene, {"air_sound_speed_m_s": SOUND, "wind_east_m_s": wind})
    uncertain = freed(UncertainScene(scene), free)
    layout, sigma, _ = planned_layout(scene)
    read = record(scene, layout, LAWS).value
    posterior = Posterior(
        parameters_of(uncertain), layout, read, sigma, tuple(LAWS.items()), "gaussian"
    )
    z = np.zeros(len(free))
    identified = identifiability(posterior, z)
    optima = None
    laws = {q: (name, "") for q, name in LAWS.items()}
    normal = laplace(posterior, z, identified.identified_basis)
    return Solution(posterior, laws, {}, optima, identified, normal)  # pyright: ignore[reportArgumentType]  nobody asks for the search's ends


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
    # 8e-6 by the second order of differences over 0.005 m/s and 1e-3 sd, rounded up
    np.testing.assert_allclose(
        [factors[name] for name in FREE], by_hand(scatter, 5.0), rtol=1e-4
    )


def words_of(solution):
    """Say what still air did to an answer."""
    finding = still_air(solution)
    assert finding is not None
    return words(finding)


def test_still_air_is_told_where_it_was_taken_and_only_there():
    factor = by_hand(False, 5.0)
    said = words_of(solved())
    assert said.startswith("still air; with unknown wind (sd 5 m/s per component)")
    assert f"charge east {factor[0]:.2g} times" in said
    assert still_air(solved(wind=3.0)) is None
    open_wind = solved(free=("charge_east_m", "wind_east_m_s"))
    assert still_air(open_wind) is None


def test_along_a_range_alone_a_wind_is_another_sound_speed():
    found = solved(free=("charge_east_m",))
    layout = found.posterior.layout
    at_range = dataclasses.replace(layout, slant_range=jnp.full(4, 700.0))
    posterior = dataclasses.replace(found.posterior, layout=at_range)
    said = words_of(found._replace(posterior=posterior))
    assert "a prior on air_sound_speed_m_s" in said
    free = parameters_of(
        freed(UncertainScene(posterior.parameters.scene), ["air_sound_speed_m_s"])
    )
    fitted = dataclasses.replace(posterior, parameters=free)
    normal = dataclasses.replace(found.laplace, z=np.log([SOUND]))
    said = words_of(found._replace(posterior=fitted, laplace=normal))
    assert "prior" not in said  # it is fitted already
    assert "the fitted air_sound_speed_m_s covers it" in said
