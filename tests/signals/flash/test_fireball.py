"""First light, place and growth from silhouettes of the law."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from jblast.scene import Camera, look_at
from jblast.sensors.camera import project
from jblast.signals.flash.fireball import (
    Growth,
    Silhouette,
    direction_of,
    growth,
    radius_in_middle,
    silhouette,
)
from tests.signals.flash.films import SHAPE, disc


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


SEED = np.ones(SHAPE, bool)


@given(
    st.floats(4.0, 20.0), st.floats(30.0, 45.0), st.floats(28.0, 34.0), st.booleans()
)
@settings(max_examples=25, deadline=None)
def test_disc_and_half_disc_have_their_radius(radius, x, y, half):
    seen = silhouette(0.0, disc(x, y, radius, half=half), SEED, np.zeros(SHAPE))
    assert seen is not None
    # the error that is told: its columns are few, and its lowest row is lit by half
    assert seen.radius_px == pytest.approx(radius, abs=0.3)
    assert seen.x_px == pytest.approx(x, abs=0.15)
    above = 4 * radius / (3 * np.pi) if half else 0.0
    assert seen.y_px == pytest.approx(y - above, abs=0.3)
    assert not seen.cut


def test_only_the_spot_at_the_seed_counts():
    share = np.maximum(disc(20, 30, 6), disc(60, 30, 10))
    seed = np.zeros(SHAPE, bool)
    seed[30, 18:22] = True
    seen = silhouette(0.0, share, seed, np.zeros(SHAPE))
    assert seen is not None
    assert seen.x_px == pytest.approx(20, abs=0.1)
    assert silhouette(0.0, share, np.zeros(SHAPE, bool), np.zeros(SHAPE)) is None
    assert silhouette(0.0, np.zeros(SHAPE), SEED, np.zeros(SHAPE)) is None


def test_a_spot_at_the_edge_is_cut():
    seen = silhouette(0.0, disc(3, 30, 10), SEED, np.zeros(SHAPE))
    assert seen is not None
    assert seen.cut


EYE = np.array([60.0, -80.0, 1.5])


def camera(**changed):
    numbers: dict[str, Any] = {
        "position": EYE,
        "quaternion": look_at(EYE, np.array([0.0, 0.0, 5.0])),
        "focal": np.array([180.0, 180.0]),
        "center": np.array([79.5, 59.5]),
    }
    return Camera(**(numbers | changed), width=160, height=120)


def seen_at(x, y):
    return Growth(0.0, 1e-4, x, 0.5, y, 0.5, None, None, None, None, 0.1)


@pytest.mark.parametrize("distortion", [np.zeros(5), np.array([-0.1, 0, 0, 0, 0.0])])
def test_a_direction_is_that_of_the_place_seen_there(distortion):
    through = camera(distortion=distortion)
    place = np.array([[12.0, 30.0, 7.0]])
    x, y = np.asarray(project(through, place).pixel)[0]
    told = direction_of(through, seen_at(float(x), float(y)))
    east, north, up = (place - EYE)[0]
    assert told.bearing_rad == pytest.approx(np.arctan2(east, north) % (2 * np.pi))
    assert told.elevation_rad == pytest.approx(np.arctan2(up, np.hypot(east, north)))
    # half a pixel of 180 or so
    assert told.bearing_sd_rad == pytest.approx(0.5 / 180, rel=0.2)


def test_a_sphere_off_the_middle_has_the_radius_it_would_have_there():
    through = camera()
    # 5 m at 100 m, 20 degrees off the axis: wider in the image by 1 / cos^2
    half, off = np.arcsin(0.05), np.radians(20.0)
    edges = 180 * np.tan([off - half, off + half])
    spot = Silhouette(
        0.0, float(np.ptp(edges)) / 2, 79.5 + float(edges.mean()), 59.5, 9.0, False
    )
    assert radius_in_middle(through, spot) == pytest.approx(
        180 * np.tan(half), rel=1e-4
    )
    assert spot.radius_px > 1.1 * 180 * np.tan(half)
