"""The shock solver: start, fluxes, conservation, the exact decay."""

import math
from pathlib import Path

import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from calibration.euler import (
    Air,
    Gas,
    cell_centres,
    decay_at,
    face_flux,
    fitted_front,
    gas_of,
    march,
    point_source,
    reconstruct,
    shell_volume,
    swept_radius,
)
from jblast.errors import InputError
from jblast.waves.laws.point_source import log_overpressure_ratio
from jblast.waves.laws.sedov_taylor import sedov_alpha
from jblast.waves.shock import blast_wind

FILE = Path(__file__).parents[2] / "calibration/data/point_source_s1x4.csv"
LINES = [line for line in FILE.read_text().splitlines() if line[:1] != "#"]
HANCOCK = np.array([[float(x) for x in line.split(",")] for line in LINES[1:]])
HANCOCK = HANCOCK[(HANCOCK[:, 0] > math.log(0.1)) & (HANCOCK[:, 0] < math.log(0.35))]
"""ln lambda, ln p/P0, slope and more: S. Hancock, blast-ips, rows of table S1x4."""
positive = st.lists(st.floats(1e-6, 1e6), min_size=12, max_size=12)


@pytest.fixture(scope="module")
def decayed():
    """Return a run with a gauge, shared by all tests of it."""
    return march(60, 2.0, stride=2, gauges=(0.8,))


def test_mass_volume_and_energy_grow_by_what_the_shock_overtakes(decayed):
    start, (last, _) = point_source(cells=60), decayed
    grown = float(last.shock**3 - start.shock**3) / 3.0
    for name, gain in (("mass", 1.0), ("volume", 1.0), ("energy", 2.5)):
        before, after = (float(getattr(f, name).sum()) for f in (start, last))
        # rounding of some thousand steps
        assert after - before == pytest.approx(gain * grown, abs=1e-12 * after)
    shells = jnp.diff(last.radius**3) / 3.0
    np.testing.assert_allclose(shells, last.volume, rtol=1e-6)


def test_the_shock_is_that_of_the_method_of_characteristics(decayed):
    x, y, slopes, *_ = HANCOCK.T
    decay = decay_at(np.exp(x), decayed[1])
    # 6e-4 with 60 cells, a third of it with twice as many
    np.testing.assert_allclose(decay.overpressure_ratio, np.exp(y), rtol=1e-3)
    np.testing.assert_allclose(decay.slope, slopes, atol=5e-3)
    near = np.geomspace(0.2, 1.9, 50)
    table = np.exp(np.asarray(log_overpressure_ratio(jnp.log(near))))
    ratio = decay_at(near, decayed[1]).overpressure_ratio
    np.testing.assert_allclose(ratio, table, rtol=3e-3)


def test_the_arrival_is_the_integral_of_one_over_the_shock_speed(decayed):
    scaled = np.exp(np.linspace(math.log(0.05), 0.0, 4001))
    decay = decay_at(scaled, decayed[1])
    mach = np.sqrt(1.0 + 6.0 / 7.0 * decay.overpressure_ratio)
    steps = np.diff(scaled) * 2 / (mach[1:] + mach[:-1])
    # the two stages of a step see fronts that differ by the error of the scheme
    np.testing.assert_allclose(
        decay.arrival[1:] - decay.arrival[0], np.cumsum(steps), rtol=1e-3
    )


def test_a_gauge_is_at_rest_until_the_shock_comes_and_then_jumps_to_its_pressure(
    decayed,
):
    history = decayed[1]
    shown, wind = history.pressure[:, 0], history.velocity[:, 0]
    come = history.shock >= 0.8
    np.testing.assert_array_equal(shown[~come], 1.0)
    np.testing.assert_array_equal(wind[~come], 0.0)
    first = int(np.argmax(come))
    front = history.front.pressure[first] - 1.0
    # within two steps of the arrival, a fiftieth of the wave
    assert shown[first] - 1.0 == pytest.approx(front, rel=0.05)
    assert wind[first] == pytest.approx(history.front.velocity[first], rel=0.05)
    assert shown[-1] < shown[first]


@pytest.mark.slow
def test_a_strong_point_source_goes_where_sedov_says():
    cold = point_source(1.0, Air(1e-12), cells=50, radius=0.1, length=100.0)
    end, _ = march(50, 1.0, flow=cold)
    radius = (float(end.time) ** 2 / float(sedov_alpha(1.4))) ** 0.2
    # 0.0005 % with a start at 0.02
    assert radius == pytest.approx(1.0, rel=2e-5)


def test_the_start_has_the_energy_of_the_source_and_of_the_air_overtaken():
    flow = point_source(2.0, cells=50, radius=0.03)
    sphere = 0.03**3 / 3.0
    assert float(flow.mass.sum()) == pytest.approx(sphere, rel=1e-14)
    assert float(flow.volume.sum()) == pytest.approx(sphere, rel=1e-14)
    whole = 2.0 / (4.0 * np.pi) + sphere / 0.4
    assert float(flow.energy.sum()) == pytest.approx(whole, rel=1e-12)
    strong = 8.0 * 2.0 / (25.0 * 2.4 * float(sedov_alpha(1.4)) * 0.03**3)
    front = fitted_front(gas_of(flow), flow.air)
    # a parabola through the means of three of 50 cells
    assert float(front.pressure) == pytest.approx(strong, rel=1e-2)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"cells": 8}, r"cells: expected at least 20 .* got 8"),
        ({"cells": 50, "radius": 0.2}, "at least 300 ambient pressures"),
    ],
    ids=("cells", "radius"),
)
def test_what_does_not_resolve_the_source_is_refused(options, message):
    with pytest.raises(InputError, match=message):
        point_source(**options)


@settings(deadline=None, max_examples=30)
@given(density=positive, pressure=positive)
def test_between_positive_means_values_are_positive(density, pressure):
    cells = Gas(jnp.array(density), jnp.zeros(12), jnp.array(pressure))
    for side in reconstruct(cells):
        assert float(side.density.min()) > 0.0
        assert float(side.pressure[:-1].min()) > 0.0


def side(density, velocity, pressure):
    return Gas(*(jnp.array([float(q)]) for q in (density, velocity, pressure)))


@pytest.mark.parametrize(
    ("left", "right", "overtaken", "volume", "momentum", "energy"),
    [
        # equal states: the flux is that of the state
        (
            (1.3, 0.4, 2.0),
            (1.3, 0.4, 2.0),
            0.5,
            0.4 + 0.5 / 1.3,
            0.5 * 0.4 - 2.0,
            0.5 * (2.0 / (0.4 * 1.3) + 0.5 * 0.4**2) - 2.0 * 0.4,
        ),
        # a face faster than every wave: the gas ahead as it is
        (
            (1.0, 0.3, 5.0),
            (0.7, -0.2, 1.0),
            50.0,
            -0.2 + 50.0 / 0.7,
            50.0 * -0.2 - 1.0,
            50.0 * (1.0 / (0.4 * 0.7) + 0.5 * 0.2**2) + 0.2,
        ),
        # a contact at rest in the gas: nothing passes but the pressure
        ((1.0, 0.2, 3.0), (0.01, 0.2, 3.0), 0.0, 0.2, -3.0, -3.0 * 0.2),
    ],
)
def test_fluxes_are_exact_where_the_flow_is_known(
    left, right, overtaken, volume, momentum, energy
):
    flux = face_flux(
        side(*left), side(*right), jnp.array([overtaken]), jnp.ones(1), 1.4
    )
    for found, expected in zip(flux, (volume, momentum, energy), strict=True):
        np.testing.assert_allclose(found, expected, rtol=1e-14)


@pytest.mark.parametrize("ratio", [1e-4, 0.1, 3.0, 1e4])
def test_gas_in_the_state_behind_a_shock_drives_that_shock(ratio):
    # Rankine-Hugoniot with gamma 1.4
    sound = float(np.sqrt(1.4 * 2.0 / 1.5))
    behind = [
        1.5 * (7 + 6 * ratio) / (7 + ratio),
        float(blast_wind(ratio, 1.0, sound)),
        2.0 * (1.0 + ratio),
    ]
    front = fitted_front(Gas(*(jnp.full(4, q) for q in behind)), Air(2.0, 1.5))
    assert float(front.pressure) == pytest.approx(behind[2], rel=1e-13)
    assert float(front.velocity) == pytest.approx(behind[1], rel=1e-9)
    speed = sound * math.sqrt(1 + 6 / 7 * ratio)
    assert float(front.speed) == pytest.approx(speed, rel=1e-13)


def test_shells_and_centres_are_those_of_spheres():
    inner, thickness = jnp.array([0.1, 1.0, 100.0]), jnp.array([1e-3, 0.02, 0.5])
    volume = shell_volume(inner, thickness)
    np.testing.assert_allclose(volume, ((inner + thickness) ** 3 - inner**3) / 3.0)
    # what is left of Newton's step is x^6, x at most 0.06
    np.testing.assert_allclose(
        swept_radius(inner, volume), inner + thickness, rtol=1e-9
    )
    assert float(swept_radius(jnp.zeros(1), jnp.zeros(1))[0]) == 0.0
    radius = jnp.array([0.0, 0.5, 0.7, 1.5])
    # mean of r over shells, by (r^4/4)/(r^3/3)
    mean = 0.75 * jnp.diff(radius**4) / jnp.diff(radius**3)
    np.testing.assert_allclose(cell_centres(radius), mean, rtol=1e-14)
