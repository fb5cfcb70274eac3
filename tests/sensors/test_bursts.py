from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jblast.constants import STANDARD_SOUND_SPEED
from jblast.scene import Air, Charge, Scene, Sensor
from jblast.sensors.law_choice import height_notes, settled
from jblast.sensors.layout import planned_layout
from jblast.sensors.record import record
from jblast.waves.laws.kingery_bulmash import kingery_bulmash_impulse
from jblast.waves.paths import path_between

LAW = {"positive_impulse_pa_s": "kingery_bulmash"}
QUANTITY = "positive_impulse_pa_s"


def scene(up, burst=None, heights=(12.0, 0.0), name=""):
    sensors = tuple(
        Sensor(
            position_m=np.array([5.0, 0.0, h]),
            name=f"s{h}",
            records=((QUANTITY, 0.05),),
        )
        for h in heights
    )
    charge = Charge(mass_kg=1.0, position_m=(0.0, 0.0, up), burst=burst, name=name)
    air = Air(sound_speed=STANDARD_SOUND_SPEED)
    return Scene(charge, air=air, sensors=sensors)


def distances(up, heights=(12.0, 0.0)):
    return np.hypot(5.0, np.array(heights) - up)


def test_each_reading_is_by_the_curves_that_the_height_leaves():
    high = scene(12.0)
    layout, _, _ = planned_layout(high)
    value = record(high, layout, LAW).value
    near, far = distances(12.0)
    expected = [
        kingery_bulmash_impulse(near, 1.0, burst="free-air"),
        kingery_bulmash_impulse(far, 1.0, burst="surface"),
    ]
    np.testing.assert_allclose(value, expected, rtol=1e-12)
    # and settled beforehand, row by row, the same
    fixed, rows = settled(high, layout)
    assert rows.free_air == (True, False)
    np.testing.assert_allclose(record(fixed, rows, LAW).value, expected, rtol=1e-12)


def test_where_all_readings_are_of_one_set_the_charge_is_given_it():
    for up, heights, burst in (
        (12.0, (12.0, 10.0), "free-air"),
        (0.3, (12.0, 0.0), "surface"),
        (0.0, (12.0, 0.0), "surface"),
    ):
        this = scene(up, heights=heights)
        fixed, rows = settled(this, planned_layout(this)[0])
        assert (fixed.charge.burst, rows.free_air) == (burst, ())
        assert fixed.charge.by_height


def test_what_is_settled_has_derivatives_across_the_limit():
    high = scene(2.0, heights=(2.0, 0.0))
    fixed, rows = settled(high, planned_layout(high)[0])
    assert rows.free_air == (True, False)

    def impulse(mass):
        heavier = replace(fixed, charges=(replace(fixed.charge, mass_kg=mass),))
        return record(heavier, rows, LAW).value

    # at 8 kg the reflection comes within the phase: what was settled stays
    value, slope = jax.jit(jax.vmap(jax.value_and_grad(lambda m: impulse(m)[0])))(
        jnp.array([1.0, 8.0])
    )
    free = kingery_bulmash_impulse(5.0, np.array([1.0, 8.0]), burst="free-air")
    np.testing.assert_allclose(value, free, rtol=1e-12)
    assert np.isfinite(slope).all()


# A place 5 m from a charge 12 m up stands 7 m up or higher: its reflection comes over
# sqrt(5^2 + 4 * 12 * 7) = 19 m or more, 14 m or 35 ms later, after a phase of 2.6 ms.
# 40 m off it may stand on the ground, where both come at once.
@pytest.mark.parametrize(
    ("up", "distance", "free"),
    [(12.0, 5.0, True), (12.0, 40.0, False), (0.0, 5.0, False)],
)
@pytest.mark.parametrize("told_by", ["row", "charge"])
def test_a_range_alone_leaves_a_place_as_low_as_it_allows(told_by, up, distance, free):
    charge = Charge(
        mass_kg=1.0,
        position_m=(0.0, 0.0, up),
        range_m=distance if told_by == "charge" else None,
    )
    told = jnp.array([distance if told_by == "row" else jnp.nan])
    path = path_between(
        Scene(charge),
        charge,
        jnp.full((1, 3), jnp.nan) if told_by == "row" else jnp.zeros((1, 3)),
        told,
        jnp.full(1, jnp.nan),
    )
    assert path.free_air is not None
    assert path.free_air.tolist() == [free]


@pytest.mark.parametrize(
    ("up", "burst", "heights", "said"),
    [
        (0.0, None, (12.0, 0.0), []),
        (12.0, None, (12.0, 11.0), ["every reading", "free-air curves were used"]),
        (12.0, None, (12.0, 0.0), ["1 of 2 readings", "neither set is valid"]),
        (0.3, None, (1.0, 0.0), ["between the limits", "the surface ones were used"]),
        (12.0, "surface", (12.0, 0.0), ['"surface" contradicts the height', "1 of 2"]),
        (0.0, "free-air", (12.0, 0.0), ['"free-air" contradicts the height']),
    ],
)
def test_what_is_said_of_a_height(up, burst, heights, said):
    this = scene(up, burst, heights)
    fixed, rows = settled(this, planned_layout(this)[0])
    told = height_notes(fixed, rows, 0)
    assert len(told) == bool(said)
    for words in said:
        assert words in told[0]
