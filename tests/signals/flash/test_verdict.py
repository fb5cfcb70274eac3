"""A bright spot has one cause by its radii: fireball, inflated object or flicker."""

import os
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from jblast.sensors.camera.image import srgb_to_linear
from jblast.signals.flash import detect_flashes
from jblast.signals.flash.fireball import Silhouette
from jblast.signals.flash.search import flash_threshold, verdict
from tests.signals.flash.films import disc

SHAPE = 60, 90
REFERENCE = os.environ.get("JBLAST_REFERENCE")


def spots(radius, rate=1000.0, frames=70):
    """Silhouettes with a radius for each number of frames since the first light."""
    times = (np.arange(frames) + 1.0) / rate
    reached, found = 0.0, []
    for k, time in enumerate(times):
        one = radius(k + 0.6)
        reached = max(reached, one)
        found.append(
            Silhouette(
                *(time, one, 40.0, 30.0, 9.0, False),
                reached_px=reached,
                lit_px=np.pi * reached**2,
            )
        )
    return found


RNG = np.random.default_rng(0)
SHAKEN = RNG.normal(0.0, 0.4, 70)
SOOT = np.where(np.arange(70) % 12 == 8, 0.4, 1.0)
FIREBALLS = {
    "1 ms": lambda k: -26.0 * np.expm1(-k),
    "10 ms": lambda k: -26.0 * np.expm1(-k / 10.0),
    "18 ms": lambda k: -26.0 * np.expm1(-k / 18.0),
    # a strong blast's power of 0.4 (Taylor 1950) that ends after 12 ms
    "Taylor": lambda k: 26.0 * min(k / 12.0, 1.0) ** 0.4,
    "hidden by soot in turn": lambda k: -26.0 * np.expm1(-k / 4.0) * SOOT[int(k)],
    "one frame": lambda k: 12.0,
    # the thesis's: it grows for 12 frames, then soot leaves bright parts of any size
    "fuel": lambda k: 3.0 * k if k < 12 else 36.0 * np.exp(-1.0 - abs(SHAKEN[int(k)])),
}
INFLATED = {
    "constant speed": lambda k: 0.3 * k,
    "constant flow": lambda k: 6.0 * k ** (1 / 3),
    "from 4 px": lambda k: 4.0 + 2.3 * k**0.5,
}


@pytest.mark.parametrize("rate", [1000.0, 30.0])
@pytest.mark.parametrize("radius", FIREBALLS.values(), ids=FIREBALLS)
def test_growth_that_slows_down_is_that_of_a_fireball(radius, rate):
    assert verdict(spots(radius, rate), 0.0) == "fireball"


@pytest.mark.parametrize("rate", [1000.0, 30.0])
@pytest.mark.parametrize("radius", INFLATED.values(), ids=INFLATED)
def test_growth_by_a_power_of_time_is_not(radius, rate):
    assert verdict(spots(radius, rate), 0.0) == "grows_on"


def test_sparkle_at_random_places_is_flicker():
    """Spots of 10 px in a patch of 600 px, each where it is first seen by chance."""
    rng, reached, lit, found = np.random.default_rng(0), 1.8, 0.0, []
    for k, one in enumerate(spots(lambda k: 3.0 * np.exp(SHAKEN[int(k)]))):
        beside = k == 0 or rng.random() < lit / 600.0
        reached, lit = max(reached, 1.8 if k < 1 else 14.0), lit + 10.0 * (not beside)
        found.append(one._replace(reached_px=reached, lit_px=lit, beside=beside))
    assert verdict(found, 0.0) == "flicker"
    assert verdict([], 0.0) == "flicker"


def searched(light, rate_hz=1000.0, false_alarms=1.0):
    times = np.arange(len(light)) / rate_hz
    blocks = [(times[a : a + 16], light[a : a + 16]) for a in range(0, len(times), 16)]
    return detect_flashes(blocks, rate_hz, flash_threshold(false_alarms))


def filmed(light, noise=0.01):
    """Frames of 8 bits with the noise of a sensor."""
    light = np.asarray(light)
    noisy = light + noise * np.random.default_rng(0).standard_normal(light.shape)
    return (np.rint(255 * np.clip(noisy, 0.0, 1.0)) / 255).astype(np.float32)


def film(radii, places, frames=115, first=30, dark=0.2, shape=SHAPE):
    """Film of discs with a radius for each number of frames since a frame."""
    behind = dark * (1.0 + 0.25 * np.random.default_rng(1).random(shape))
    light = np.repeat(behind[None], frames, axis=0)
    for radius, (x, y) in zip(radii, places, strict=True):
        for k in range(first, frames):
            cover = disc(x, y, radius(k - first + 0.4), shape)
            light[k] = cover + (1.0 - cover) * light[k]
    return filmed(light)


def test_an_inflated_object_is_listed_with_its_cause():
    seen = searched(film([INFLATED["constant speed"]], [(45.0, 30.0)]))
    assert not seen.flashes
    (other,) = seen.candidates
    assert other.cause == "grows_on"
    assert (other.x_px, other.y_px) == pytest.approx((45.0, 30.0), abs=1.0)


@pytest.mark.parametrize("seed", [0, 1])
def test_glitter_that_is_there_from_the_first_frame_on_is_no_blast(seed):
    # facets of water show the sun 5 frames on average: a stationary telegraph process
    rng, facets, share, light = np.random.default_rng(seed), 800, 0.1, []
    behind = 0.15 + 0.05 * rng.random((80, 120))
    rows, columns = rng.integers(30, 78, facets), rng.integers(8, 110, facets)
    on = rng.random(facets) < share
    for _ in range(110):
        draws = rng.random(facets)
        on = np.where(on, draws > 0.2, draws < 0.2 * share / (1.0 - share))
        image = behind.copy()
        for row, column in zip(rows[on], columns[on], strict=True):
            image[row : row + 2, column : column + 2] = 1.0
        light.append(image)
    assert not searched(filmed(light)).flashes


def test_a_fireball_in_the_dark_is_a_blast():
    # the logarithm of 0.02 of full scale is noisy: a tenth of all pixels at any time
    # change by more than a quarter
    seen = searched(film([FIREBALLS["1 ms"]], [(45.0, 30.0)], dark=0.02))
    assert [flash.frame for flash in seen.flashes] == [30]
    assert not seen.candidates


@pytest.mark.skipif(REFERENCE is None, reason="JBLAST_REFERENCE is not set")
@pytest.mark.parametrize(("rate", "sky"), [(30.0, 0.2), (1000.0, 0.5)])
def test_the_fireball_of_the_thesis_is_found_at_its_first_frame(rate, sky):
    frames = sorted((Path(REFERENCE or "") / "blast_clip").glob("*.png"))
    fire = np.stack([np.asarray(Image.open(one)) for one in frames]) / 255.0
    # averaged over 4 x 4 pixels, 60 frames behind the first
    fire = fire.reshape(len(fire), 80, 4, 80, 4, 4).mean(axis=(2, 4))
    fire = np.concatenate([np.zeros((60, *fire.shape[1:])), fire])
    cover, grey = fire[..., 3], fire[..., :3].mean(axis=-1)
    first = int(np.flatnonzero(cover.max(axis=(1, 2)) > 0.5)[0])
    grey = cover * grey + (1.0 - cover) * sky
    seen = searched(srgb_to_linear(filmed(grey, 0.004)), rate)
    (flash,) = seen.flashes
    assert flash.growth.time_s * rate == pytest.approx(first, abs=1.5)


PLACES = [(40.3, 60.2), (90.1, 50.4), (130.6, 80.7)]


def test_blasts_at_the_same_time_are_all_found():
    radii = [lambda k, r=r: -r * np.expm1(-k / 4.0) for r in (16.0, 12.0, 9.0)]
    seen = searched(film(radii, PLACES, shape=(120, 160)))
    assert [flash.frame for flash in seen.flashes] == [30, 30, 30]
    found = [(flash.growth.x_px, flash.growth.y_px) for flash in seen.flashes]
    np.testing.assert_allclose(sorted(found), PLACES, atol=1.0)
    assert not seen.candidates


def test_a_fire_at_the_edge_of_the_image_is_one_flash():
    # two flames that the edge separates, and one that rises out of soot after 60 ms
    flames = (13.0, 0.0), (11.0, 0.0), (5.0, 6.0)
    radii = [
        lambda k, r=r, at=at: -r * np.expm1(-max(k - at, 0.0) / 4.0) for r, at in flames
    ]
    places = [(20.2, 119.0), (48.3, 119.0), (14.6, 87.1)]
    seen = searched(film(radii, places, shape=(120, 160)))
    (flash,) = seen.flashes
    assert flash.frame == 30
    assert not seen.candidates


def test_small_flashes_of_a_slow_film_are_listed_with_their_frame():
    # diameters of 16, 12 and 7 px, grown in 30 ms at 30 frames a second
    radii = [lambda k, d=d: 0.5 * d * min(k / 0.9, 1.0) for d in (16, 12, 7)]
    slow = film(radii, PLACES, frames=90, shape=(120, 160))
    seen = searched(slow, 30.0)
    assert not seen.flashes
    assert [(one.frame, one.cause) for one in seen.candidates] == 3 * [(30, "faint")]
    places = [(one.x_px, one.y_px) for one in seen.candidates]
    np.testing.assert_allclose(sorted(places), PLACES, atol=1.0)
    # the largest is a flash at a lower threshold
    seen = searched(slow, 30.0, 20.0)
    assert [flash.frame for flash in seen.flashes] == [30, 30]
    assert len(seen.candidates) == 1
