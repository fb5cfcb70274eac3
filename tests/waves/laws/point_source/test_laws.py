"""A point source: its limits, its energy, its scaling and what is registered."""

import math
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import quad

from jblast.constants import (
    STANDARD_PRESSURE,
    STANDARD_SOUND_SPEED,
    TNT_SPECIFIC_ENERGY,
)
from jblast.waves.laws.kingery_bulmash import kingery_bulmash_pressure
from jblast.waves.laws.point_source import (
    ENDS,
    LENGTH,
    SEDOV_ALPHA,
    point_source_arrival_time,
    point_source_curve,
    point_source_mach_number,
    point_source_pressure,
    point_source_shock_speed,
    point_source_valid,
)
from jblast.waves.laws.sedov_taylor import sedov_alpha, sedov_taylor_shock_pressure
from tests.waves.laws.point_source.curve import (
    log_slope,
    overpressure_ratio,
)


def test_close_in_it_is_the_strong_limit_of_sedov_and_taylor():
    assert float(sedov_alpha(1.4)) == pytest.approx(SEDOV_ALPHA, abs=5e-13)
    scaled = np.array([1e-3, 1e-2, 0.03])
    strong = sedov_taylor_shock_pressure(LENGTH * scaled, 1.0, 1.4) / STANDARD_PRESSURE
    # the constant 1.063 on top, printed to 1e-3; rounding of 1.6e8 at 1e-3
    np.testing.assert_allclose(
        overpressure_ratio(scaled) - strong, 1.063, rtol=0, atol=6e-4
    )
    np.testing.assert_allclose(log_slope(scaled[:2]), -3.0, rtol=0, atol=3e-5)


@pytest.mark.parametrize("join", ENDS)
def test_value_and_slope_are_continuous_where_another_law_takes_over(join):
    scaled = np.array([join * (1 - 1e-9), join * (1 + 1e-9)])
    low, high = log_slope(scaled)
    # a step of 2e-9 times a curvature of less than 1
    assert float(low) == pytest.approx(float(high), abs=2e-9)
    p = overpressure_ratio(scaled)
    assert float(p[1] / p[0]) == pytest.approx(1.0, abs=7e-9)


def test_it_agrees_with_goldstine_and_von_neumann_below_two():
    name = "point_source_goldstine_vonneumann1955.csv"
    path = Path(__file__).parents[3] / "data" / name
    lines = [line for line in path.read_text().splitlines() if line[:1] != "#"]
    rows = np.array([[float(x) for x in line.split(",")] for line in lines[1:]])
    printed, scaled = rows[:, 1], rows[:, 2]
    ratio = np.asarray(overpressure_ratio(scaled)) / printed
    good = scaled < 2.0
    assert good.sum() > 40
    # their computation is good to 1 %
    np.testing.assert_allclose(ratio[good], 1.0, rtol=0, atol=0.01)
    # farther theirs drifts off, to 4 %
    assert ratio[~good].min() == pytest.approx(0.96, abs=5e-3)


@pytest.mark.parametrize(
    ("z", "energy", "digits"),
    [
        (0.3, 1.5e6, 5e4),
        (0.5, 3.0e6, 5e4),
        (1.0, 5.35e6, 5e4),
        (2.0, 6.4e6, 5e4),
        (3.0, 6.1e6, 5e4),
        (5.0, 5.3e6, 5e4),
        (10.0, 5.2e6, 5e4),
        (20.0, 5.2e6, 5e4),
        (40.0, 4.1e6, 5e4),
    ],
)
def test_the_effective_energy_of_tnt_is_the_printed_one(z, energy, digits):
    mass = (energy + np.array([-digits, digits])) / TNT_SPECIFIC_ENERGY
    low, high = point_source_pressure(z, mass)
    target = kingery_bulmash_pressure(z, 1.0, burst="free-air")
    assert low < target < high


@pytest.mark.parametrize("scaled", [0.03, 0.1, 0.17, 0.9, 5.0, 300.0, 9e3, 2e4, 1e8])
def test_the_arrival_is_the_integral_of_one_over_the_speed(scaled):
    mach = jax.jit(point_source_mach_number)
    nodes = [n for n in point_source_curve().nodes[::5] if n < math.log(scaled)]
    total, start = 0.0, -25.0  # where the arrival is 1e-27
    for end in (*nodes, math.log(scaled)):
        total += quad(
            lambda x: math.exp(x) / float(mach(x)), start, end, epsabs=0, epsrel=1e-12
        )[0]
        start = end
    arrival = point_source_arrival_time(LENGTH * scaled, 1.0) * STANDARD_SOUND_SPEED
    # by the spacing of the table
    assert float(arrival) == pytest.approx(LENGTH * total, rel=1e-9)


def test_the_first_arrival_is_that_of_sedov_and_taylor():
    # R = (E t^2/(alpha rho0))^(1/5) with rho0 = 1.4 P0/c0^2
    scaled = 1e-3
    radius = LENGTH * scaled
    density = 1.4 * STANDARD_PRESSURE / STANDARD_SOUND_SPEED**2
    time = math.sqrt(SEDOV_ALPHA * density * radius**5 / TNT_SPECIFIC_ENERGY)
    # the next term of the series is 5/22 of w = b lambda^3/a = 1.5e-8
    assert float(point_source_arrival_time(radius, 1.0)) == pytest.approx(
        time, rel=5e-9
    )


def test_the_shock_speed_is_rankine_hugoniot_and_tends_to_sound():
    r = jnp.geomspace(0.01, 1e6, 100)
    mach = point_source_shock_speed(r, 1.0, 9e4, 330.0) / 330.0
    relative = point_source_pressure(r, 1.0, 9e4) / 9e4
    np.testing.assert_allclose(mach**2, 1 + 6 / 7 * relative, rtol=1e-13)
    assert float(mach[-1]) == pytest.approx(1.0, abs=1e-6)


def test_valid_in_free_air_from_the_first_node_to_ten_thousand():
    z = np.array([0.345, 0.347, 9.9e3, 1.01e4])
    valid = point_source_valid(z, 1.0, burst="free-air")
    assert valid.tolist() == [False, True, True, False]
    assert not point_source_valid(z, 1.0, burst="surface").any()
