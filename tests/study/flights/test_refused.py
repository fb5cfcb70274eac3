"""What cannot be flown is refused, and so are draws that cannot be."""

import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest

from jblast.errors import InputError
from jblast.scene import Charge, Free, Normal, VehicleSpec
from jblast.study.flights import fly
from tests.study.flights.scenes import SHORT, SPEC, scene

REFUSED = {
    "charges that never happen": (
        lambda: scene(charge=Charge(mass_kg=1.0, time_s=np.inf)),
        {},
        ["scene.toml: [charge] time_s: expected a charge with a finite", "got inf"],
    ),
    "no vehicle": (lambda: scene(None), {}, ["[vehicle]", "got none"]),
    "a charge without a place": (
        lambda: scene(charge=Charge(mass_kg=1.0, range_m=10.0)),
        {},
        ["[charge] range_m", "expected position_m"],
    ),
    "below ground": (
        lambda: scene(VehicleSpec("iris", jnp.array([5.0, 0.0, -1.0]))),
        {},
        ["[vehicle] position_m", "expected a height of 0 m", "-1 m"],
    ),
    "a target below ground": (
        lambda: scene(dataclasses.replace(SPEC, target=jnp.array([5.0, 0.0, -2.0]))),
        {},
        ["control target_m", "-2 m"],
    ),
    "a free mass": (
        lambda: scene(beliefs={"charge_mass_kg": Free(positive=True)}),
        {},
        ["free and cannot be drawn"],
    ),
    "several alike": (scene, {"vehicles": 3}, ["expected a prior", "all flights"]),
    "none": (scene, {"vehicles": 0}, ["vehicles", "got 0"]),
    "a blast that is over": (
        lambda: scene(charge=Charge(mass_kg=1.0, time_s=-1.0)),
        {},
        ["[charge] time_s", "when the flight begins", "-0.9908 s"],
    ),
    "too short": (
        scene,
        {"seconds": 0.005},
        ["seconds: expected more than 0.0092 s", "got 0.005 s"],
    ),
    "too long": (scene, {"seconds": 1e6}, ["seconds", "at most"]),
    "a step too large": (
        scene,
        {"seconds": 2.0, "step_s": 0.3},
        ["step_s: expected at most"],
    ),
    "a negative tolerance": (
        scene,
        {"tolerance_m": -1.0},
        ["tolerance: expected a positive number"],
    ),
}


@pytest.mark.parametrize(("make", "options", "said"), REFUSED.values(), ids=REFUSED)
def test_what_cannot_be_flown_is_refused(make, options, said):
    with pytest.raises(InputError) as caught:
        fly(make(), **options)
    for words in said:
        assert words in str(caught.value), caught.value


def test_draws_that_cannot_be_are_refused():
    """A normal mass with 3 sd to zero is negative in one of 741 draws."""
    uncertain = scene(beliefs={"charge_mass_kg": Normal(3.0, 1.0)})
    with pytest.raises(
        InputError, match=r"a prior of charge_mass_kg .* got -.* of 10000 samples"
    ):
        fly(uncertain, **SHORT, vehicles=10_000)


def test_a_profile_whose_moments_are_about_another_place_is_not_flown():
    case = np.array([0.01, 8.0, np.pi / 2, np.pi, 1e-3, 0.0, 0.0, 0.0, 0.1, 0.0])
    with pytest.raises(InputError, match=r"at most 0\.13 m.*got one of 100 m"):
        fly(scene(), **SHORT, profile=case[None])
