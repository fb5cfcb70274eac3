"""The weight of the free-air curves by the height of burst, and the note on it."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.constants import STANDARD_SOUND_SPEED
from jblast.scene import Air, Charge, Scene, Sensor
from jblast.sensors.forward_model import record
from jblast.sensors.law_choice import height_notes
from jblast.sensors.layout import planned_layout
from jblast.waves.laws.kingery_bulmash import kingery_bulmash_impulse
from jblast.waves.paths import path_between

QUANTITY = "positive_impulse_pa_s"
LAW = {QUANTITY: "kingery_bulmash"}


def scene(up, burst=None, heights=(12.0, 0.0)):
    sensors = tuple(
        Sensor(f"s{h}", np.array([5.0, 0.0, h]), records=((QUANTITY, 0.05),))
        for h in heights
    )
    charge = Charge(mass_kg=1.0, position_m=(0.0, 0.0, up), burst=burst)
    return Scene(charge, air=Air(sound_speed=STANDARD_SOUND_SPEED), sensors=sensors)


# At 12 m up and 12 m high the reflection follows the phase, on the ground it is one
# with the front. At 1.5 m up and 1.6 m high it comes within the phase.
HIGH = scene(12.0, heights=(12.0, 0.0))
LAYOUT, _, _ = planned_layout(HIGH)


@jax.jit
def recorded(up, heights):
    position = jnp.stack([jnp.array([5.0, 5.0]), jnp.zeros(2), heights], axis=1)
    layout = LAYOUT.only(np.arange(2))
    layout = jax.tree.map(lambda x: position if x.ndim == 2 else x, layout)
    return record(scene(up), layout, LAW)


def test_each_reading_is_by_the_curves_of_its_height():
    found = recorded(12.0, jnp.array([12.0, 0.0]))
    expected = [
        kingery_bulmash_impulse(5.0, 1.0, burst="free-air"),
        kingery_bulmash_impulse(13.0, 1.0, burst="surface"),
    ]
    np.testing.assert_allclose(found.value, expected, rtol=1e-12)
    assert found.valid.tolist() == [True, True]


def test_between_the_limits_a_reading_is_smooth_and_marked():
    heights = jnp.linspace(0.0, 8.0, 201)
    found = jax.vmap(lambda h: recorded(1.5, jnp.array([h, 0.0])))(heights)
    slant = np.hypot(5.0, np.asarray(heights) - 1.5)
    low, free = (
        np.asarray(kingery_bulmash_impulse(slant, 1.0, burst=burst))
        for burst in ("surface", "free-air")
    )
    weight = (np.asarray(found.value)[:, 0] - low) / (free - low)
    assert weight[0] == 0.0
    assert weight[-1] == pytest.approx(1.0, abs=1e-9)
    between = (weight > 1e-9) & (weight < 1 - 1e-9)
    assert 5 < between.sum() < 150
    np.testing.assert_array_equal(np.asarray(found.valid)[:, 0], ~between)
    # no jump: a step of 4 cm changes the weight by less than a tenth
    assert np.abs(np.diff(weight)).max() < 0.1
    slope = jax.jit(jax.grad(lambda up: recorded(up, heights[100:102]).value[0]))
    step = 1e-5
    up = jnp.asarray(1.5)
    difference = [recorded(up + s * step, heights[100:102]).value[0] for s in (1, -1)]
    expected = (difference[0] - difference[1]) / (2 * step)
    assert float(slope(up)) == pytest.approx(float(expected), rel=1e-6)


# A place 5 m from a charge 12 m up is 7 m up or higher: its reflection comes over
# sqrt(5^2 + 4 * 12 * 7) = 19 m or more, 14 m or 35 ms later, after a phase of 2.6 ms.
# A place 40 m away may be on the ground, where both come simultaneously.
@pytest.mark.parametrize(
    ("up", "distance", "weight"), [(12.0, 5.0, 1), (12.0, 40.0, 0), (0.0, 5.0, 0)]
)
@pytest.mark.parametrize("given_by", ["row", "charge"])
def test_a_range_alone_leaves_a_place_as_low_as_it_allows(
    given_by, up, distance, weight
):
    of_charge = distance if given_by == "charge" else None
    charge = Charge(1.0, position_m=(0.0, 0.0, up), range_m=of_charge)
    place = jnp.full((1, 3), jnp.nan) if given_by == "row" else jnp.zeros((1, 3))
    stated = jnp.array([distance if given_by == "row" else jnp.nan])
    path = path_between(Scene(charge), charge, place, stated, jnp.full(1, jnp.nan))
    assert np.broadcast_to(path.free_air, 1).tolist() == [weight]


@pytest.mark.parametrize(
    ("up", "burst", "heights", "words"),
    [
        (0.0, None, (12.0, 0.0), []),
        (
            12.0,
            None,
            (12.0, 11.0),
            ["height of 12 m/kg^(1/3)", "free-air curves at 2 of 2"],
        ),
        (12.0, None, (12.0, 0.0), ["free-air curves at 1, surface curves at 1 of 2"]),
        (1.5, None, (1.6, 0.0), ["a mean of both sets (not valid) at 1 of 2"]),
        (12.0, "surface", (12.0, 0.0), ['"surface" contradicts the height']),
        (0.0, "free-air", (12.0, 0.0), ['"free-air" contradicts the height']),
    ],
)
def test_one_note_states_the_curves_of_a_height(up, burst, heights, words):
    this = scene(up, burst, heights)
    notes = height_notes(this, planned_layout(this)[0], 0)
    assert len(notes) == bool(words)
    for part in words:
        assert part in notes[0]
