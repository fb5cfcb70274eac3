"""Write a plan by a pattern: take-off, a field in lanes or a circle, return, landing.

What is written QGroundControl opens, and a scene's vehicle flies: [vehicle] mission =
"FILE.plan".
"""

import argparse
import sys

from jblast.cli.arguments.numbers import number, positive
from jblast.cli.arguments.options import path
from jblast.files import refuse_existing, save_text


def add_arguments(verb: argparse.ArgumentParser) -> None:
    """Say what the verb takes."""
    verb.add_argument(
        "out",
        metavar="OUT.plan",
        type=path,
        help="file to write: .plan as QGroundControl's, .waypoints as QGC WPL 110",
    )
    pattern = verb.add_mutually_exclusive_group(required=True)
    pattern.add_argument(
        "--grid",
        metavar="WIDTH,DEPTH,SPACING",
        type=_three,
        help="lanes over a field, east to west and north to south [m]",
    )
    pattern.add_argument(
        "--orbit",
        metavar="RADIUS[,TURNS]",
        type=_radius_and_turns,
        help="a circle [m], clockwise, counter-clockwise with a negative radius "
        "(default: 1 turn)",
    )
    verb.add_argument(
        "--home",
        metavar="LAT,LON[,ALT]",
        type=_home,
        required=True,
        help="where it takes off [degree], and its height above the sea [m] "
        "(default: 0)",
    )
    verb.add_argument(
        "--up",
        type=positive,
        default=30.0,
        metavar="M",
        help="height above home [m] (default: 30)",
    )
    verb.add_argument(
        "--at",
        metavar="EAST,NORTH",
        type=lambda text: _numbers(text, "EAST,NORTH", 2, 2),
        default=(0.0, 0.0),
        help="middle of the pattern, from home [m] (default: 0,0)",
    )
    verb.add_argument(
        "--speed",
        type=positive,
        metavar="M/S",
        help="of the flight [m/s] (default: the plan does not say)",
    )
    verb.add_argument("--force", action="store_true", help="overwrite an existing file")


def run(asked: argparse.Namespace) -> int:
    """Write the plan and return the exit code."""
    from jblast.missions.mission import grid_plan, orbit_plan
    from jblast.missions.plan import plan_text
    from jblast.scene import Place

    refuse_existing(asked.out, force=asked.force)
    common = {"up_m": asked.up, "centre_m": asked.at, "speed_m_s": asked.speed}
    home = Place(*asked.home)
    if asked.grid:
        width, depth, spacing = asked.grid
        plan = grid_plan(
            home, width_m=width, depth_m=depth, spacing_m=spacing, **common
        )
    else:
        radius, turns = asked.orbit
        plan = orbit_plan(home, radius_m=radius, turns=turns, **common)
    save_text(plan_text(plan, asked.out), asked.out)
    sys.stdout.write(f"wrote {asked.out}: {len(plan.items)} items\n")
    return 0


def _numbers(text: str, expected: str, least: int, most: int) -> tuple[float, ...]:
    """Return so many numbers between commas."""
    words = text.split(",")
    if not least <= len(words) <= most:
        raise argparse.ArgumentTypeError(f"expected {expected}, got {text!r}")
    return tuple(number(word) for word in words)


def _three(text: str) -> tuple[float, ...]:
    values = _numbers(text, "WIDTH,DEPTH,SPACING", 3, 3)
    if values[0] <= 0 or values[1] < 0 or values[2] <= 0:
        raise argparse.ArgumentTypeError(
            f"expected a WIDTH and a SPACING that are positive, and no negative DEPTH, "
            f"got {text!r}"
        )
    return values


def _radius_and_turns(text: str) -> tuple[float, ...]:
    values = _numbers(text, "RADIUS or RADIUS,TURNS", 1, 2)
    radius, turns = (*values, 1.0)[:2]
    if radius == 0 or turns <= 0:
        raise argparse.ArgumentTypeError(
            f"expected a RADIUS other than 0 and positive TURNS, got {text!r}"
        )
    return radius, turns


def _home(text: str) -> tuple[float, ...]:
    values = _numbers(text, "LAT,LON or LAT,LON,ALT", 2, 3)
    if abs(values[0]) > 90 or abs(values[1]) > 180:
        raise argparse.ArgumentTypeError(
            "expected a latitude of -90 to 90 and a longitude of -180 to 180 degrees, "
            f"got {text!r}"
        )
    return values
