import numpy as np
from scipy.interpolate import CubicSpline, make_interp_spline

from jblast.waves.curves import clamped_log_spline, natural_log_spline
from tests.tools.slopes import with_slopes

Z = np.array([0.1, 0.3, 0.5, 2.0, 3.0, 20.0])
Y = np.array([50.0, 48.0, 30.0, 4.0, 2.5, 0.1])
SPLINE = natural_log_spline(Z, Y)
AT = with_slopes(SPLINE.value)
REFERENCE = CubicSpline(np.log(Z), np.log(Y), bc_type="natural")


def test_it_is_the_natural_spline_of_scipy_with_two_derivatives():
    log_z = np.linspace(np.log(0.1) + 1e-6, np.log(20.0) - 1e-6, 300)
    for order, found in enumerate(AT(log_z)):
        np.testing.assert_allclose(
            found, REFERENCE(log_z, order), rtol=1e-12, atol=1e-12
        )


def test_with_slopes_at_its_ends_it_is_the_clamped_spline_of_scipy():
    spline = clamped_log_spline(Z, Y, -0.7, -2.0)
    ends = [(1, -0.7)], [(1, -2.0)]
    reference = make_interp_spline(np.log(Z), np.log(Y), bc_type=ends)
    log_z = np.linspace(np.log(0.1) + 1e-6, np.log(20.0) - 1e-6, 300)
    for order, found in enumerate(with_slopes(spline.value)(log_z)):
        np.testing.assert_allclose(
            found, reference(log_z, order), rtol=1e-12, atol=1e-11
        )
    ends = [spline.slope_before, spline.slope_after]
    np.testing.assert_allclose(ends, [-0.7, -2.0], rtol=1e-14)


def test_outside_the_points_the_slope_is_that_at_the_end_and_the_curvature_zero():
    for inside, outside in ((np.log(0.1), -20.0), (np.log(20.0), 20.0)):
        end = float(REFERENCE(inside, 1))
        values, slopes, curvatures = AT([inside, outside])
        np.testing.assert_allclose(slopes, end, rtol=1e-12)
        assert curvatures[1] == 0.0
    np.testing.assert_allclose(
        values[1], np.log(0.1) + end * (20.0 - np.log(20.0)), rtol=1e-13
    )
