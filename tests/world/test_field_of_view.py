"""Who looks away does not see a blast, though its light comes by."""

import jax.numpy as jnp
import pytest

from jblast.vehicle import Trajectory
from jblast.world import arrivals_of, perceived
from jblast.world.drawn import CAMERA
from jblast.world.perceived import out_of_view
from tests.world.worlds import drawn

EYE = {"width": 24, "height": 16, "focal_px": 12.0}
ONE = {"count": 1, "time_s": 1.0, "mass_kg": 5.0}
EAST = ONE | {"region_m": {"box": [[44, -1, 0], [46, 1, 0]]}}


def looking(**camera):
    return drawn(world=EAST, camera=EYE | camera).scene


def turned(about_up_rad: float) -> Trajectory:
    """A vehicle that stands still, turned to the left of east."""
    half = 0.5 * about_up_rad
    turn = jnp.array([0.0, 0.0, jnp.sin(half), jnp.cos(half)])
    still, held = jnp.zeros((2, 3)), jnp.array([5.0, 0.0, 3.0])
    return Trajectory(
        time_s=jnp.array([0.0, 5.0]),
        position_m=jnp.stack([held, held]),
        velocity_m_s=still,
        quaternion=jnp.stack([turn, turn]),
        body_rate_rad_s=still,
        rotor_speed_rad_s=jnp.zeros((2, 4)),
        force_n=still,
        moment_n_m=still,
        lost=jnp.array(False),
    )


@pytest.mark.parametrize(
    ("look_at_m", "seen"), [([45, 0, 2], True), ([-45, 0, 2], False)]
)
def test_a_camera_that_stands_sees_what_it_looks_at(look_at_m, seen):
    scene = looking(position_m=[0, 0, 2], look_at_m=look_at_m)
    assert (out_of_view(scene) == ()) == seen


def test_a_camera_that_rides_along_looks_where_the_vehicle_is_turned():
    scene = looking(mount="vehicle")
    assert out_of_view(scene) == out_of_view(scene, turned(0.0)) == ()
    assert out_of_view(scene, turned(3.0)) == ("1",)


def test_what_is_out_of_view_is_not_perceived_by_the_camera_alone():
    scene = looking(mount="vehicle")
    arrivals = arrivals_of(scene)
    everything, late = perceived(scene, arrivals, 1e3)
    seen, as_late = perceived(scene, arrivals, 1e3, ("1",))
    missing = set(everything) - set(seen)
    assert {(one.entity, one.sense) for one in missing} == {(CAMERA, "flash")}
    assert late == as_late == 0


def test_without_a_camera_nothing_is_out_of_its_view():
    assert out_of_view(drawn(world=EAST).scene) == ()
