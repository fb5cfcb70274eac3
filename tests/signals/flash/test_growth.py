"""First light, place and growth from silhouettes of the law."""

import numpy as np
import pytest

from jblast.signals.flash.fireball import Silhouette, growth


def spots(start=0.0104, last=14.0, tau=2.5e-3, half=True, noise=0.0, cut_from=np.inf):
    rng = np.random.default_rng(3)
    out = []
    for time in np.arange(11, 50) / 1000:
        radius = -last * np.expm1(-(time - start) / tau)
        above = 4 * radius / (3 * np.pi) if half else 0.0
        x, y = 40.0, 30.0 - above
        radius, x, y = np.array([radius, x, y]) + noise * rng.standard_normal(3)
        out.append(Silhouette(time, radius, x, y, 9.0, radius > cut_from))
    return out


@pytest.mark.parametrize("half", [True, False])
def test_the_law_is_found_and_the_burst_below_a_half_disc(half):
    told = growth(spots(half=half), 0.010)
    assert told.time_s == pytest.approx(0.0104, abs=1e-6)
    assert told.radius_px == pytest.approx(14.0, rel=1e-4)
    assert told.growth_s == pytest.approx(2.5e-3, rel=1e-3)
    assert (told.x_px, told.y_px) == pytest.approx((40.0, 30.0), abs=1e-3)


def test_errors_are_within_their_sigmas():
    told = growth(spots(noise=0.2), 0.010)
    assert abs(told.time_s - 0.0104) < 3 * told.sigma_s < 3e-4
    assert abs(told.y_px - 30.0) < 3 * told.y_sigma_px < 3.0
    assert told.radius_px is not None
    assert told.radius_sigma_px is not None
    assert abs(told.radius_px - 14.0) < 3 * told.radius_sigma_px


def test_what_an_edge_cuts_is_not_fitted():
    told = growth(spots(cut_from=12.0), 0.010)
    assert told.time_s == pytest.approx(0.0104, abs=2e-5)
    assert growth(spots(cut_from=0.0), 0.010).radius_px is None


def test_one_frame_tells_no_more_than_that_it_lies_between_two():
    told = growth(spots()[:1], 0.010)
    assert told.time_s == pytest.approx(0.0105)
    assert told.sigma_s == pytest.approx(1e-3 / np.sqrt(12))
    assert told.growth_s is None


def grown_before(first_px=7.0, rate=30.0, dark=31):
    """Radii that extrapolate to several frames before the first one that is lit."""
    time = np.arange(dark + 1, dark + 15) / rate
    since = time - time[0]
    radius = first_px + 7.6 * -np.expm1(-since / 0.12)
    return [
        Silhouette(t, r, 40.0, 30.0, 9.0, False)
        for t, r in zip(time, radius, strict=True)
    ]


@pytest.mark.parametrize("rate", [30.0, 120.0])
def test_first_light_is_not_before_a_dark_frame(rate):
    seen, dark = grown_before(rate=rate), 31 / rate
    told = growth(seen, dark)
    assert told.time_s == pytest.approx(31.5 / rate)
    assert told.sigma_s == pytest.approx(1 / rate / np.sqrt(12))
    assert told.growth_s is None  # the law does not hold


def test_a_fit_slightly_outside_its_interval_is_truncated_to_it():
    for start in (0.00995, 0.0110):
        told = growth(spots(start=start), 0.010)
        assert 0.010 < told.time_s < 0.011
        assert abs(told.time_s - start) < 2e-4
        assert told.sigma_s < 1e-4
        assert told.growth_s is not None


def test_light_begins_within_the_exposures_of_two_frames():
    one = spots()[:1]
    told = growth(one, 0.010, exposure_s=8e-4)
    assert told.time_s == pytest.approx(0.0109)
    # a faint frame ends the interval earlier, if its exposure is known
    told = growth(one, 0.009, 0.010, exposure_s=8e-4)
    assert told.time_s == pytest.approx(0.0099)
    told = growth(one, 0.009, 0.010)
    assert told.time_s == pytest.approx(0.010)
    assert told.sigma_s == pytest.approx(2e-3 / np.sqrt(12))
