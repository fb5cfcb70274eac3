import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.waves.shock import (
    oblique_reflected_pressure,
    oblique_reflected_pressure_arl,
)
from tests.tools.slopes import check_slopes

INCIDENT = 1e5
ANGLES = np.linspace(0.0, math.pi / 2, 2001)
FORMS = (oblique_reflected_pressure, oblique_reflected_pressure_arl)
ratios = pytest.mark.parametrize("ratio", [2.0, 3.0, 8.0])


@pytest.mark.parametrize("form", FORMS)
def test_it_is_reflected_at_normal_and_incident_at_grazing_incidence(form):
    ends = form(INCIDENT, 3.0 * INCIDENT, np.array([0.0, math.pi / 2]))
    # the cosine of 90 degrees is 6e-17
    np.testing.assert_allclose(ends, [3.0 * INCIDENT, INCIDENT], rtol=1e-15)


def test_at_60_degrees_the_forms_differ_by_three_quarters_of_the_incident():
    ours, printed = (form(INCIDENT, 3e5, math.pi / 3) for form in FORMS)
    # 3 cos (1 - cos) = 3/4
    assert float(ours - printed) == pytest.approx(0.75 * INCIDENT, rel=1e-12)


def test_the_forms_are_the_printed_ones():
    c = np.cos(ANGLES)
    np.testing.assert_allclose(
        oblique_reflected_pressure(1.0, 2.5, ANGLES),
        2.5 * c**2 + 1 + c - 2 * c**2,
        rtol=1e-14,
    )
    np.testing.assert_allclose(
        oblique_reflected_pressure_arl(1.0, 2.5, ANGLES),
        2.5 * c**2 + 1 + c**2 - 2 * c,
        rtol=1e-14,
    )


@ratios
def test_ours_falls_from_normal_to_grazing_and_never_below_the_incident(ratio):
    pressure = oblique_reflected_pressure(1.0, ratio, ANGLES)
    assert np.all(np.diff(pressure) < 0)
    assert pressure.min() >= 1.0


def test_ours_is_1_plus_the_cosine_for_a_weak_shock():
    np.testing.assert_allclose(
        oblique_reflected_pressure(1.0, 2.0, ANGLES), 1.0 + np.cos(ANGLES), rtol=1e-14
    )


@pytest.mark.parametrize(
    ("ratio", "lowest", "angle", "below_from"),
    [(2.0, 0.667, 70.5, 48.2), (8.0, 0.889, 83.6, 77.2)],
)
def test_the_printed_form_dips_below_the_incident_pressure(
    ratio, lowest, angle, below_from
):
    pressure = np.asarray(oblique_reflected_pressure_arl(1.0, ratio, ANGLES))
    degrees = np.degrees(ANGLES)
    # printed digits, and the grid's step of 0.045 degrees
    assert pressure.min() == pytest.approx(lowest, abs=5e-4)
    assert pressure.min() == pytest.approx(ratio / (ratio + 1), abs=1e-6)
    assert degrees[pressure.argmin()] == pytest.approx(angle, abs=0.1)
    assert degrees[pressure < 1][0] == pytest.approx(below_from, abs=0.1)


@pytest.mark.parametrize("form", FORMS)
def test_derivatives_of_two_orders_are_those_of_finite_differences(form):
    check_slopes(form, (1.3, 4.0, jnp.array([0.1, 0.8, 1.4])), order=2, rtol=1e-4)


@pytest.mark.parametrize("form", FORMS)
def test_single_precision_keeps_six_digits_and_a_batch_is_a_loop(form):
    angles = jnp.linspace(0.0, 1.57, 30)
    loop = [float(form(INCIDENT, 4e5, angle)) for angle in angles]
    np.testing.assert_allclose(jax.jit(form)(INCIDENT, 4e5, angles), loop, rtol=1e-13)
    single = form(INCIDENT, 4e5, angles.astype("float32"))
    assert single.dtype == jnp.float32
    np.testing.assert_allclose(single, loop, rtol=1e-6)


@pytest.mark.parametrize("angle", [-0.1, 1.6])
def test_an_angle_from_behind_is_refused(angle):
    with pytest.raises(
        ValueError, match=r"incidence_angle must be between 0 and 1\.57"
    ):
        oblique_reflected_pressure(INCIDENT, 3e5, angle)
