import math
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from calibration.ford_2021 import ADOPTED, QUANTITIES, fit
from jblast.registry import law_for
from jblast.waves.laws.ford_2021 import (
    Ford2021,
    FordCurve,
    ford_2021,
    ford_2021_duration,
    ford_2021_impulse,
    ford_2021_laws,
    ford_2021_valid,
    log_curve,
    log_gradient,
)

STANDARD = (101_325.0, 340.29)
LAWS = (ford_2021_impulse, ford_2021_duration)
RESULTS = Path(__file__).parents[4] / "calibration" / "results"


def curve(coefficients, covariance=None):
    covariance = np.zeros((4, 4)) if covariance is None else covariance
    return FordCurve(
        np.array(coefficients),
        covariance,
        site_sd=0.03,
        shot_sd=0.04,
        burial_sd=0.5,
        path_sd=0.2,
        record_sd=0.1,
    )


PRINTED = curve([6.0, -1.1, 5.0, 1.0])
BY_HAND = Ford2021(PRINTED, curve([-5.0, 0.2, 0.7, 1.0]))


def test_printed_form_agrees_with_arithmetic_by_hand():
    # W = 64 kg at half an atmosphere: S_d = (64/0.5)^(1/3); c doubles, times halve.
    scale = 128.0 ** (1 / 3)
    got = ford_2021_impulse(300.0, 64.0, -2.0, 50_662.5, 680.58, calibration=BY_HAND)
    ground = 1.0 + math.exp(5.0 * 2.0 / scale)
    expected = 0.5 * scale * 0.5 * math.exp(6.0) * (300.0 / scale) ** -1.1 / ground
    assert got == pytest.approx(expected, rel=1e-12)


def test_duration_agrees_with_arithmetic_by_hand():
    got = ford_2021_duration(200.0, 1.0, 0.0, *STANDARD, calibration=BY_HAND)
    assert got == pytest.approx(math.exp(-5.0) * 200.0**0.2 / 2.0, rel=1e-12)


def test_recording_of_hri_2_at_lv1_lies_within_the_scatter():
    air = (83_986.0, 340.29 * math.sqrt(299.6 / 288.15))
    place = (276.413, 539.77, 3.0)
    sets = ford_2021()
    for law, which, seen in (
        (ford_2021_impulse, sets.impulse, 66.36568),
        (ford_2021_duration, sets.duration, 0.05525),
    ):
        sds = which.scatter(*place, air[0])
        total = math.sqrt(sum(float(sd) ** 2 for sd in sds))
        assert abs(math.log(seen / float(law(*place, *air)))) < 2.0 * total


@pytest.mark.parametrize("scaled_range", [0.01, 100.0, 1e5])
def test_log_slope_in_range_is_b2_inside_and_outside_the_recordings(scaled_range):
    for law, which in zip(
        LAWS, (ford_2021().impulse, ford_2021().duration), strict=True
    ):
        slope = jax.grad(
            lambda ln_r, law=law: jnp.log(law(jnp.exp(ln_r), 1.0, 0.5, *STANDARD))
        )
        got = slope(jnp.log(scaled_range))
        assert got == pytest.approx(float(which.coefficients[1]), abs=1e-12)


def test_high_above_ground_height_no_longer_matters_and_deep_below_it_is_exponential():
    b3, b4 = (float(b) for b in ford_2021().impulse.coefficients[2:4])
    high = [ford_2021_impulse(100.0, 1.0, h, *STANDARD) for h in (5.0, 10.0)]
    assert high[0] == pytest.approx(float(high[1]), rel=1e-12)
    deep = [ford_2021_impulse(100.0, 1.0, h, *STANDARD) for h in (-5.0, -6.0)]
    assert deep[1] / deep[0] == pytest.approx(math.exp(-b3 * b4), rel=1e-9)


def test_gradient_by_coefficients_is_the_automatic_one():
    coefficients = ford_2021().impulse.coefficients
    place = (jnp.log(300.0), jnp.asarray(-0.2))
    automatic = jax.grad(log_curve)(coefficients, *place)
    assert jnp.allclose(log_gradient(coefficients, *place), automatic, rtol=1e-12)


def test_validity_follows_the_recordings():
    assert ford_2021_valid(100.0, 1.0, 0.0)
    assert not ford_2021_valid(19.9, 1.0, 0.0)
    assert not ford_2021_valid(1001.0, 1.0, 0.0)
    assert ford_2021_valid(
        400.0, 8.0, -0.4 + 1e-12
    )  # 8^(1/3) is not 2 to the last digit
    assert not ford_2021_valid(400.0, 8.0, -0.4 - 1e-12)
    assert not ford_2021_valid(400.0, 8.0, -0.41)
    assert not ford_2021_valid(400.0, 8.0, 2.01)


def test_no_shot_is_called_in_range_that_a_law_without_it_missed():
    table = (RESULTS / "leave_out.txt").read_text(encoding="utf-8").split("campaign")[0]
    rows = [line.split() for line in table.splitlines() if line.startswith("  H")]
    missed = {row[0]: float(row[2]) for row in rows if "OUT" in row}
    assert len(rows) == 18
    assert list(missed) == ["HTP-7"]
    # the table has heights in m/kg^(1/3), the height of 1 kg in m
    assert not ford_2021_valid(100.0, 1.0, missed["HTP-7"])


def test_scatter_of_the_shot_grows_with_burial_as_stated():
    for height, expected in ((0.0, 0.05), (1.0, 0.05), (-0.2, math.hypot(0.05, 0.1))):
        shot, path, record = PRINTED.scatter(300.0, 1.0, height, STANDARD[0])
        assert shot == pytest.approx(expected, rel=1e-12)
        assert (float(path), float(record)) == (0.2, 0.1)
    packaged = ford_2021().impulse
    depths = [packaged.scatter(300.0, 1.0, -d, STANDARD[0])[0] for d in (0.1, 0.2, 0.4)]
    assert depths[0] < depths[1] < depths[2]


def test_uncertain_coefficients_add_to_the_scatter_of_the_shot():
    # Only b1 uncertain, by 0.12: d ln y/d b1 = 1.
    covariance = np.zeros((4, 4))
    covariance[0, 0] = 0.12**2
    uncertain = curve([6.0, -1.1, 5.0, 1.0], covariance)
    shot, _, _ = uncertain.scatter(300.0, 1.0, 0.0, STANDARD[0])
    assert shot == pytest.approx(math.hypot(0.05, 0.12), rel=1e-12)


def test_packaged_covariance_is_symmetric_and_not_negative():
    for which in (ford_2021().impulse, ford_2021().duration):
        # Six significant digits of the file leave 1e-6 of the largest entry.
        assert jnp.allclose(which.covariance, which.covariance.T)
        least = jnp.linalg.eigvalsh(which.covariance)[0]
        assert least > -1e-5 * jnp.max(which.covariance)


def test_table_of_laws_calls_the_packaged_and_a_refitted_set():
    place = np.array([300.0, 900.0]), 200.0, 1.0
    packaged = law_for("positive_impulse_pa_s", "ford_2021")
    direct = ford_2021_impulse(*place, *STANDARD)
    np.testing.assert_array_equal(packaged.function(*place, *STANDARD), direct)
    refitted = ford_2021_laws(BY_HAND, "ford_2021 by hand")[0]
    by_hand = ford_2021_impulse(*place, *STANDARD, calibration=BY_HAND)
    np.testing.assert_array_equal(refitted.function(*place, *STANDARD), by_hand)
    shot, path_sd, record = refitted.scatter(*place, STANDARD[0])
    assert shot.shape == (2,)
    assert (float(path_sd), float(record)) == (0.2, 0.1)


@pytest.mark.slow
@pytest.mark.parametrize("quantity", QUANTITIES)
def test_packaged_coefficients_are_what_the_script_finds(quantity):
    found = fit(quantity, ADOPTED[quantity]).curve
    packaged = ford_2021()
    kept = packaged.impulse if "impulse" in quantity else packaged.duration
    # The search stops where the likelihood is flat to 1e-13 of itself.
    for name, value in vars(found).items():
        assert np.allclose(getattr(kept, name), value, rtol=1e-3, atol=1e-4), name
