"""The calculator backwards: every root, where it lies, or that there is none."""

import numpy as np
import pytest

from jblast.constants import STANDARD_PRESSURE, STANDARD_SOUND_SPEED
from jblast.scene import Scene
from jblast.sensors.calculator import Question, calculate, charge_radius, roots
from jblast.waves import (
    kingery_bulmash_duration,
    kingery_bulmash_pressure,
    wu_hao_air_arrival_time,
)
from tests.sensors.calculator.scenes import scene_with

MEASURED = (
    "peak_overpressure_pa",
    "positive_impulse_pa_s",
    "air_arrival_s",
    "positive_duration_s",
    "reflected_pressure_pa",
    "reflected_impulse_pa_s",
)


def asking(scene, quantity, target, *, mass=None, at=None):
    """Ask for the range at which a mass, or the mass that at a range, gives a value."""
    return Question(
        scene,
        slant_range=() if at is None else (at,),
        charge_mass=() if mass is None else (mass,),
        quantity=quantity,
        target=float(target),
    )


@pytest.mark.parametrize("quantity", MEASURED)
@pytest.mark.parametrize("known", ["mass", "range"])
def test_roots_put_back_give_the_value(quantity, known):
    scene = scene_with(explosive="C4")
    given = {"at": 50.0} if known == "range" else {"mass": 15.0}
    start = calculate(scene, np.array([50.0]), np.array([15.0]))[quantity]
    target = 1.07 * start["kingery_bulmash"].value[0]
    found = roots(asking(scene, quantity, target, **given))
    count = 0
    for name, of_law in found.items():
        n = len(of_law.value)
        ranges = np.full(n, 50.0) if known == "range" else of_law.value
        masses = of_law.value if known == "range" else np.full(n, 15.0)
        if n:
            back = calculate(scene, ranges, masses)[quantity][name]
            np.testing.assert_allclose(back.value, target, rtol=1e-9)
            # a root inside the charge is none, whatever the law says of its range
            outside = ranges > charge_radius(masses)
            np.testing.assert_array_equal(of_law.valid, back.valid & outside)
        count += n
    assert count >= len(found) - 1  # acoustic arrivals tell no mass


def test_a_duration_that_turns_back_has_several_roots():
    z = np.geomspace(0.148, 40.0, 4000)
    duration = np.asarray(kingery_bulmash_duration(z, 1.0, burst="free-air"))
    # it falls, rises to 1.82 ms at Z = 1.09, falls to 1.68 at 1.54 and rises again
    (turns,) = np.nonzero(np.diff(np.sign(np.diff(duration))))
    target = duration[turns[1:]].mean()
    (crossings,) = np.nonzero(np.diff(duration > target))
    assert len(crossings) == 3
    scene = scene_with(STANDARD_SOUND_SPEED, STANDARD_PRESSURE, burst="free-air")
    question = asking(scene, "positive_duration_s", target, mass=1.0)
    found = roots(question)["kingery_bulmash"]
    inside = found.value[found.valid]
    np.testing.assert_allclose(inside, z[crossings], rtol=0.0015)  # a step of z
    assert (np.diff(found.value) > 0).all()
    best = found.best()
    assert best is not None
    assert best[1]


def test_a_pressure_nothing_makes_has_no_root():
    question = asking(Scene(), "peak_overpressure_pa", 1e14, mass=15.0)
    found = roots(question)["kingery_bulmash"]
    assert found.best() is None
    assert found.attained is not None
    ends = kingery_bulmash_pressure(np.array([40.0, 0.0674]) * np.cbrt(15.0), 15.0)
    np.testing.assert_allclose(found.attained, ends, rtol=0.02)  # a step of the grid


def test_roots_outside_the_range_are_marked():
    target = kingery_bulmash_pressure(100.0, 1.0)  # its table ends at Z = 40
    question = asking(Scene(), "peak_overpressure_pa", target, mass=1.0)
    found = roots(question)["kingery_bulmash"]
    assert found.valid.tolist() == [False]
    assert found.best() == (pytest.approx(100.0), False)


def test_a_root_inside_the_charge_is_marked():
    # Wu and Hao's arrival knows no charge radius: 0.0527 m for 1 kg
    target = wu_hao_air_arrival_time(0.04, 1.0, 330.0)
    found = roots(asking(scene_with(), "air_arrival_s", target, mass=1.0))["wu_hao"]
    assert found.value == pytest.approx([0.04])
    assert found.valid.tolist() == [False]


def test_sound_tells_no_mass():
    found = roots(asking(scene_with(), "air_arrival_s", 0.1, at=30.0))["acoustic"]
    assert found.best() is None
    assert found.attained is None or found.attained[0] == found.attained[1]
