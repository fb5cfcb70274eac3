"""The flight of a scene's vehicle: a position controller, or the mission it names.

`fly_scene` does what `jblast fly` does with the same defaults: it reads the scene,
draws the random blasts of a mission, reads the profile of a load, and flies.
"""

import math
import os
from collections.abc import Sequence
from dataclasses import replace

from jblast.errors import InputError, argument
from jblast.kept_programs import kept_between_runs
from jblast.scene import UncertainScene, read_scene, read_scene_or_world
from jblast.study.flight_results import TOLERANCE_M, Flights, Options, Profile
from jblast.study.flights import fly
from jblast.study.missions import (
    MISSION_STEP_S,
    TOLERANCE_M as MISSION_TOLERANCE_M,
    MissionFlight,
    fly_mission,
)
from jblast.vehicle import STEP_S, read_custom_profile
from jblast.world import draw_world


@kept_between_runs()
def fly_scene(
    scene: UncertainScene | str | os.PathLike[str],
    *,
    vehicles: int = 1,
    controllers: Sequence[str] | None = None,
    seconds: float | None = None,
    step_s: float | None = None,
    integrator: str = Options.integrator,
    backend: str = Options.backend,
    estimator: str = Options.estimator,
    tolerance_m: float | None = None,
    profile: str | os.PathLike[str] | None = None,
    profile_moments_about: tuple[float, float, float] | None = None,
    seed: int = 0,
) -> Flights | MissionFlight:
    """Fly a scene's vehicle through its blasts, on its mission if it names one.

    Args:
        scene: The scene, or its file; parameters with a prior are drawn.
        vehicles: Number of scenes that are drawn.
        controllers: As for `jblast.fly`.
        seconds: Duration of the flight; default: until 5 s after the last arrival, of a
            mission until the vehicle is disarmed.
        step_s: Of the integrator; default: 0.5 ms, with an estimator or on a mission
            4 ms.
        integrator: "rk4" or "euler".
        backend: "auto", "jax", "warp", "warp:cpu" or "warp:cuda:0".
        estimator: "ekf" to fly by filtered instruments; "": by the true state.
        tolerance_m: Path error within which the vehicle has recovered; default: 0.05 m,
            of a mission 0.2 m.
        profile: File of the impulses of blasts, in place of the laws.
        profile_moments_about: From the point that the profile's moments are about to
            the centre of mass, body axes [m].
        seed: Of the draws.

    Returns:
        Flights by controller, or the flight of the mission.

    Raises:
        InputError: The scene cannot be flown, or an argument cannot be used.

    Example:
        `jblast.fly_scene("scene.toml", vehicles=100, controllers=["cascade"])`
    """
    uncertain = scene
    if not isinstance(uncertain, UncertainScene):
        uncertain = scene_to_fly(uncertain, seconds=seconds, seed=seed)
    on_mission = has_mission(uncertain)
    if on_mission and controllers is not None:
        raise InputError(
            f"{argument('controllers')}: expected none on a mission, which is flown by "
            f"its own, got {','.join(controllers)}"
        )
    if on_mission and vehicles != 1:
        raise InputError(
            f"{argument('vehicles')}: expected 1 on a mission, got {vehicles}; several "
            "are flown from Python, by jblast.missions.MissionControl in an Each"
        )
    usual_step = MISSION_STEP_S if on_mission or estimator else STEP_S
    usual_tolerance = MISSION_TOLERANCE_M if on_mission else TOLERANCE_M
    options = Options(
        seconds=seconds,
        step_s=usual_step if step_s is None else step_s,
        integrator=integrator,
        backend=backend,
        tolerance_m=usual_tolerance if tolerance_m is None else tolerance_m,
        profile=_profile(profile, profile_moments_about),
        estimator=estimator,
    )
    if on_mission:
        return fly_mission(uncertain, options, seed=seed)
    return fly(
        uncertain, options, vehicles=vehicles, seed=seed, controllers=controllers
    )


def scene_to_fly(
    path: str | os.PathLike[str], *, seconds: float | None = None, seed: int = 0
) -> UncertainScene:
    """Read a scene; random blasts are drawn for a mission, which flies through them.

    Raises:
        InputError: It cannot be read, or a position controller meets random blasts.
    """
    uncertain, world = read_scene_or_world(path)
    if world is None:
        return uncertain
    if not has_mission(uncertain):
        return read_scene(path)  # its message has what is there instead
    until = math.inf if seconds is None else seconds
    drawn = draw_world(uncertain, world, seed, until_s=until)
    return replace(uncertain, scene=drawn.scene, beliefs={})


def has_mission(uncertain: UncertainScene) -> bool:
    """Return whether the scene's vehicle names a mission."""
    vehicle = uncertain.scene.vehicle
    return vehicle is not None and vehicle.mission is not None


def _profile(
    path: str | os.PathLike[str] | None, about: tuple[float, float, float] | None
) -> Profile | None:
    if path is None and about is not None:
        raise InputError(
            f"{argument('profile_moments_about')}: expected a {argument('profile')} "
            "whose moments they are, got none"
        )
    return None if path is None else Profile(read_custom_profile(path), about)
