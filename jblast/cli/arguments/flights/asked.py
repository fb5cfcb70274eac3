"""What `jblast fly` is asked: the scene, and how it is flown."""

import argparse
import math
from dataclasses import replace

from jblast.errors import InputError
from jblast.scene import UncertainScene, read_scene, read_scene_or_world
from jblast.study.flights.encounter import Profile
from jblast.study.flights.records import TOLERANCE_M, Options
from jblast.vehicle import STEP_S, read_custom_profile


def flown_scene(asked: argparse.Namespace) -> UncertainScene:
    """Return the scene; random blasts are drawn where a mission goes through them.

    Raises:
        InputError: It is none, or a hold is to go through random blasts.
    """
    uncertain, world = read_scene_or_world(asked.scene)
    if world is None:
        return uncertain
    vehicle = uncertain.scene.vehicle
    if vehicle is None or vehicle.mission is None:
        return read_scene(asked.scene)  # which says what is there instead
    from jblast.world import draw_world

    until = math.inf if asked.seconds is None else asked.seconds
    drawn = draw_world(uncertain, world, asked.seed, until_s=until)
    return replace(uncertain, scene=drawn.scene, beliefs={})


def flight_options(
    asked: argparse.Namespace,
    *,
    step_s: float = STEP_S,
    tolerance_m: float = TOLERANCE_M,
) -> Options:
    """Return how to fly.

    Args:
        asked: The options.
        step_s: Of the integrator, where nothing is said.
        tolerance_m: Of a recovery, likewise.

    Raises:
        InputError: A number cannot be used, or the profile is none.
    """
    if asked.profile_moments_about and not asked.profile:
        raise InputError(
            "--profile-moments-about: expected a --profile whose moments they are, got "
            "none"
        )
    profile = None
    if asked.profile:
        about = asked.profile_moments_about
        profile = Profile(read_custom_profile(asked.profile), about)
    return Options(
        seconds=asked.seconds,
        step_s=step_s if asked.step is None else asked.step,
        integrator=asked.integrator,
        backend=asked.backend,
        tolerance_m=tolerance_m if asked.tolerance is None else asked.tolerance,
        profile=profile,
        estimator=asked.estimator or "",
    )


def named_in(words: str | None) -> tuple[str, ...] | None:
    """Return the controllers that are named, with commas between; None: none are."""
    if words is None:
        return None
    return tuple(word.strip() for word in words.split(",") if word.strip())


def refuse_plan_out(asked: argparse.Namespace) -> None:
    """Refuse to write a plan where there is none.

    Raises:
        InputError: It is asked for.
    """
    if asked.plan_out:
        raise InputError(
            "--plan-out: expected a scene whose [vehicle] has a mission, got one that "
            "holds its place"
        )


def refuse_several(asked: argparse.Namespace) -> None:
    """Refuse several vehicles, or controllers, on one mission.

    Raises:
        InputError: They are asked for.
    """
    if asked.controllers is not None:
        raise InputError(
            "--controllers: expected none on a mission, which is flown by its own, got "
            f"{asked.controllers}"
        )
    if asked.vehicles != 1:
        raise InputError(
            f"--vehicles: expected 1 on a mission, got {asked.vehicles}; several are "
            "flown from Python, by jblast.missions.MissionControl in an Each"
        )
