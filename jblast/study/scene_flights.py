"""Flight of a scene's vehicle with position controllers or on its mission.

`fly_scene` is the library function of `jblast fly`, with the same defaults: it reads
the scene, samples the random blasts of a mission, reads the profile of a load, and
flies.
"""

import math
import os
from collections.abc import Sequence
from dataclasses import replace

from jblast.errors import InputError, argument
from jblast.kept_programs import kept_between_runs
from jblast.progress_line import Progress, reported
from jblast.scene import UncertainScene, read_scene, read_scene_or_world, scene_of
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
@reported("fly_scene")
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
    progress: Progress = False,
) -> Flights | MissionFlight:
    """Fly a scene's vehicle through its blasts, on its mission if it has one.

    Args:
        scene: Scene, or its file; parameters with a prior are sampled.
        vehicles: Number of sampled scenes.
        controllers: As for `jblast.fly`.
        seconds: Duration of the flight; default: until 5 s after the last arrival, of a
            mission until the vehicle is disarmed.
        step_s: Time step of the integrator; default: 0.5 ms, with an estimator or on a
            mission 4 ms.
        integrator: "rk4" or "euler".
        backend: "auto", "jax", "warp", "warp:cpu" or "warp:cuda:0".
        estimator: "ekf" for the state of a Kalman filter; "" for the true state.
        tolerance_m: Path error within which the vehicle has recovered; default: 0.05 m,
            of a mission 0.2 m.
        profile: File of the impulses of blasts, in place of the laws.
        profile_moments_about: Vector from the reference point of the profile's moments
            to the centre of mass, body axes [m].
        seed: Seed of the samples.
        progress: As for `jblast.fit`.

    Returns:
        Flights by controller, or the flight of the mission.

    Raises:
        InputError: The scene cannot be flown, or an argument cannot be used.

    Example:
        `jblast.fly_scene("scene.toml", vehicles=100, controllers=["cascade"])`
    """
    if isinstance(scene, str | os.PathLike):
        scene = scene_to_fly(scene, seconds=seconds, seed=seed)
    uncertain = scene_of(scene)
    on_mission = has_mission(uncertain)
    if on_mission and controllers is not None:
        raise InputError(
            f"{argument('controllers')}: expected none on a mission, which has its own "
            f"controller, got {','.join(controllers)}"
        )
    if on_mission and vehicles != 1:
        raise InputError(
            f"{argument('vehicles')}: expected 1 on a mission, got {vehicles}; for "
            "several use jblast.missions.MissionControl in an Each, in Python"
        )
    # an estimator samples its instruments at each step: PX4 has 250 Hz
    default_step = MISSION_STEP_S if on_mission or estimator else STEP_S
    default_tolerance = MISSION_TOLERANCE_M if on_mission else TOLERANCE_M
    options = Options(
        seconds=seconds,
        step_s=default_step if step_s is None else step_s,
        integrator=integrator,
        backend=backend,
        tolerance_m=default_tolerance if tolerance_m is None else tolerance_m,
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
    """Read a scene, and sample its random blasts if the vehicle has a mission.

    Raises:
        InputError: The file cannot be read, or a scene without a mission has random
            blasts.
    """
    uncertain, world = read_scene_or_world(path, needs_charge=False)
    if world is None:
        return uncertain
    if not has_mission(uncertain):
        return read_scene(path)  # raises the error for a [world]
    until = math.inf if seconds is None else seconds
    drawn = draw_world(uncertain, world, seed, until_s=until)
    return replace(uncertain, scene=drawn.scene, beliefs={})


def has_mission(uncertain: UncertainScene) -> bool:
    """Return whether the scene's vehicle has a mission."""
    vehicle = uncertain.scene.vehicle
    return vehicle is not None and vehicle.mission is not None


def _profile(
    path: str | os.PathLike[str] | None, about: tuple[float, float, float] | None
) -> Profile | None:
    if path is None and about is not None:
        raise InputError(
            f"{argument('profile_moments_about')}: expected it with "
            f"{argument('profile')} only, got no profile"
        )
    return None if path is None else Profile(read_custom_profile(path), about)
