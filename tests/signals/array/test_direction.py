"""Directions: errors as large as stated, and angles that are not identified named.

Times without the scatter of paths (`path_scatter=0`) have the errors of instruments
alone.
"""

import numpy as np
import pytest
from scipy.special import gamma, kv

from jblast.errors import InputError
from jblast.signals import RelativeTimes, direction, relative_times
from tests.signals.array.simulated import RATE, heard, variance

C = 340.0
SIGMA = 2e-5
TRIES = 150
TETRAHEDRON = np.array([[0, 0, 0], [1, 0, 0], [0.5, 0.87, 0], [0.5, 0.3, 0.8]])
SQUARE = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0.0]])
MAST = np.array([[0, 0, 0], [0, 0, 1], [0, 0, 2.0]])


def toward(b, e):
    """Unit vector of a bearing and an elevation."""
    return np.array([np.sin(b) * np.cos(e), np.cos(b) * np.cos(e), np.sin(e)])


def passed(positions, source, rng, speed=C, sigma=SIGMA):
    """Times at which a plane wave passes, with errors."""
    times = -(positions @ source) / speed + sigma * rng.standard_normal(len(positions))
    apart = np.eye(len(positions)) - 1 / len(positions)
    return RelativeTimes(apart @ times, apart * sigma**2)


def scaled_errors(positions, angle, *, speed_sd=0.0):
    """Errors of bearing and elevation over their sigmas, and chi-squared."""
    rng, rows, chi2 = np.random.default_rng(1), [], []
    for _ in range(TRIES):
        b = rng.uniform(0, 2 * np.pi)
        speed = C + speed_sd * rng.standard_normal()
        times = passed(positions, toward(b, angle), rng, speed)
        found = direction(positions, times, C, speed_sd, path_scatter=0.0)
        sd = np.sqrt(np.diag(found.covariance))
        off = (found.bearing - b + np.pi) % (2 * np.pi) - np.pi
        rows.append([off / sd[0], (found.elevation - angle) / sd[1]])
        chi2.append(found.chi2 / max(found.dof, 1))
    return np.array(rows), np.mean(chi2)


@pytest.mark.slow
@pytest.mark.parametrize("angle", [-0.4, 0.02, 1.2])
@pytest.mark.parametrize("speed_sd", [0.0, 10.0])
def test_normalised_errors_of_a_direction_are_one(angle, speed_sd):
    errors, chi2 = scaled_errors(TETRAHEDRON, angle, speed_sd=speed_sd)
    # Monte Carlo: sd of 150 is known to 6 %, the mean to 0.08
    assert ((errors.std(axis=0) > 0.8) & (errors.std(axis=0) < 1.2)).all()
    assert (np.abs(errors.mean(axis=0)) < 0.3).all()
    assert 0.7 < chi2 < 1.4


def test_a_level_square_tells_the_bearing_and_not_which_side_it_came_from():
    errors, _ = scaled_errors(SQUARE, 0.3)
    assert 0.8 < errors[:, 0].std() < 1.2
    assert np.isnan(errors[:, 1]).all()
    times = passed(SQUARE, toward(1.0, 0.3), np.random.default_rng(0))
    found = direction(SQUARE, times, C, path_scatter=0.0)
    assert found.layout == "coplanar"
    assert found.undetermined == ("elevation_rad",)
    assert found.mirror is not None
    assert abs(found.mirror[1]) == pytest.approx(0.3, abs=0.05)  # 2 sigma or so


def test_an_upright_mast_tells_the_elevation_alone():
    errors, _ = scaled_errors(MAST, 0.3)
    assert 0.8 < errors[:, 1].std() < 1.2
    assert np.isnan(errors[:, 0]).all()
    times = passed(MAST, toward(1.0, 0.3), np.random.default_rng(0))
    assert direction(MAST, times, C, path_scatter=0.0).undetermined == ("bearing_rad",)


@pytest.mark.parametrize(
    ("positions", "layout"),
    [
        (np.array([[0, 0, 0], [1, 0, 0.0]]), "two"),
        (np.array([[0, 0, 0], [1, 1, 0], [3, 3, 0.0]]), "collinear"),
        (np.array([[0, 0, 0], [1, 0, 1], [2, 0, 2.0]]), "collinear"),
    ],
)
def test_two_microphones_and_those_in_a_line_tell_neither(positions, layout):
    rng = np.random.default_rng(0)
    found = direction(positions, passed(positions, toward(0.7, 0.1), rng), C)
    assert found.layout == layout
    assert found.undetermined == ("bearing_rad", "elevation_rad")
    assert np.isnan([found.bearing, found.elevation]).all()
    assert np.isnan(found.covariance).all()


def test_a_wall_of_microphones_cannot_tell_front_from_back():
    wall = np.array([[0, 0, 0], [1, 0, 0], [0, 0, 1], [1, 0, 1.0]])
    times = passed(wall, toward(0.6, 0.2), np.random.default_rng(0), sigma=1e-7)
    found = direction(wall, times, C, path_scatter=0.0)
    assert found.undetermined == ("bearing_rad",)
    assert found.elevation == pytest.approx(0.2, abs=1e-3)
    assert found.mirror is not None
    sides = np.array([found.mirror[0], np.pi - found.mirror[0]]) % (2 * np.pi)
    assert np.isclose(sides, 0.6, atol=1e-3).any()


def test_one_late_microphone_is_seen_in_chi_squared():
    times = passed(SQUARE, toward(1.0, 0.3), np.random.default_rng(0))
    late = times.time + np.array([0, 0, 0, 20 * SIGMA]) - 5 * SIGMA
    still = {"path_scatter": 0.0}
    assert direction(SQUARE, times, C, **still).chi2 < 10
    assert direction(SQUARE, times._replace(time=late), C, **still).chi2 > 50


def von_karman(apart, length):
    """Return a correlation that is not the fit's: Matern of order 5/6."""
    x, order = np.maximum(apart / (0.6 * length), 1e-12), 5 / 6
    return 2 ** (1 - order) / gamma(order) * x**order * kv(order, x)


@pytest.mark.slow
def test_intervals_contain_directions_of_fronts_that_air_has_turned():
    rng, inside, widths = np.random.default_rng(3), [], []
    for _ in range(120):
        count = int(rng.integers(3, 9))
        places = np.zeros((count, 3))
        places[:, :2] = rng.uniform(-0.5, 0.5, (count, 2)) * 10 ** rng.uniform(
            -0.3, 0.7
        )
        reach = 10 ** rng.uniform(np.log10(20.0), np.log10(5000.0))
        length = 10 ** rng.uniform(np.log10(0.2), np.log10(0.8))
        b = rng.uniform(0, 2 * np.pi)
        source = reach * toward(b, 0.0)
        distance = np.linalg.norm(places - source, axis=1)
        apart = np.linalg.norm(places[:, None] - places[None], axis=-1) / reach
        root = np.linalg.cholesky(von_karman(apart, length) + 1e-12 * np.eye(count))
        times = distance / C * (1 + 0.01 * root @ rng.standard_normal(count))
        times += SIGMA * rng.standard_normal(count)
        center = np.eye(count) - 1 / count
        relative = RelativeTimes(center @ times, center * SIGMA**2)
        found = direction(places, relative, C, 10.0)
        if "bearing_rad" in found.undetermined:
            continue
        sd = np.sqrt(found.covariance[0, 0])
        off = (found.bearing - b + np.pi) % (2 * np.pi) - np.pi
        inside.append(abs(off) < 1.645 * sd)
        widths.append(sd)
    # ranges from 20 m to 5 km are taken as one; Monte Carlo: 0.03. Without the air: 0.1
    assert len(inside) > 90
    assert np.mean(inside) > 0.8
    assert np.median(widths) < 0.25


def test_precise_times_leave_the_scatter_of_the_air():
    precise = passed(SQUARE, toward(1.0, 0.0), np.random.default_rng(0), sigma=1e-9)
    sd = np.sqrt(direction(SQUARE, precise, C).covariance[0, 0])
    # a plane front of precise times: as of the smoothest air, a tenth of it turbulent
    # (0.1^(1/2) 0.014 (R/D) (D/0.2 R)^(5/6)), the rest turning the front by 0.07 rad
    turbulent = 0.1**0.5 * 0.01 * 2**0.5 * 2000.0 * (1 / 400.0) ** (5 / 6)
    assert sd > np.hypot(0.7 * turbulent, 0.9 * 0.01 * (2 * 0.9) ** 0.5 / 0.2)
    assert sd < 0.15


def test_from_sound_to_direction():
    rng, errors = np.random.default_rng(2), []
    for _ in range(60):
        b, e = rng.uniform(0, 2 * np.pi), rng.uniform(-0.5, 1.0)
        later = -(TETRAHEDRON @ toward(b, e)) / C
        sound = heard(rng, later, noise=0.02)
        times = relative_times(sound, RATE, variance(0.02, 4), 1.5 / C)
        found = direction(TETRAHEDRON, times, C, path_scatter=0.0)
        error = [(found.bearing - b + np.pi) % (2 * np.pi) - np.pi, found.elevation - e]
        errors.append(np.array(error) / np.sqrt(np.diag(found.covariance)))
    # Monte Carlo: sd of 60 is known to 9 %
    assert ((np.std(errors, axis=0) > 0.75) & (np.std(errors, axis=0) < 1.35)).all()


def test_what_has_no_direction_is_refused():
    times = passed(SQUARE, toward(1.0, 0.3), np.random.default_rng(0))
    with pytest.raises(InputError, match="4 rows of east, north, up"):
        direction(SQUARE[:3], times, C)
    with pytest.raises(InputError, match="one for all"):
        direction(np.zeros((4, 3)), times, C)
    with pytest.raises(InputError, match="a time for each microphone"):
        direction(SQUARE, times._replace(time=np.full(4, np.nan)), C)
