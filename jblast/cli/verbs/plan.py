"""Write a mission plan: take-off, lanes over a field or a circle, return, landing.

QGroundControl opens the plan, and a scene's vehicle flies it with [vehicle] mission =
"FILE.plan".
"""

import argparse
import sys

from jblast.cli.arguments.numbers import number, positive
from jblast.cli.arguments.options import add_force, path
from jblast.cli.arguments.verb_parser import VerbParser
from jblast.files import refuse_existing, save_text


def add_arguments(verb: VerbParser) -> None:
    """Add the arguments of the verb."""
    pattern = verb.inputs.add_mutually_exclusive_group(required=True)
    pattern.add_argument(
        "--grid",
        metavar="WIDTH,DEPTH,SPACING",
        type=_width_depth_spacing,
        help="lanes over a field: width from east to west, depth from north to south, "
        "and spacing [m]",
    )
    pattern.add_argument(
        "--orbit",
        metavar="RADIUS[,TURNS]",
        type=_radius_and_turns,
        help="circle: radius [m], clockwise, or counter-clockwise if negative, and "
        "number of turns (default: 1)",
    )
    verb.inputs.add_argument(
        "--home",
        metavar="LAT,LON[,ALT]",
        type=_home,
        required=True,
        help="take-off position: latitude and longitude [degree], and height above the "
        "sea [m] (default: 0)",
    )
    verb.inputs.add_argument(
        "--up",
        type=positive,
        default=30.0,
        metavar="M",
        help="height above home [m] (default: 30)",
    )
    verb.inputs.add_argument(
        "--at",
        metavar="EAST,NORTH",
        type=lambda text: _numbers(text, "EAST,NORTH", 2, 2),
        default=(0.0, 0.0),
        help="centre of the pattern, relative to home [m] (default: 0,0)",
    )
    verb.inputs.add_argument(
        "--speed",
        type=positive,
        metavar="M/S",
        help="speed of the flight [m/s] (default: none in the plan)",
    )
    verb.outputs.add_argument(
        "out",
        metavar="OUT.plan",
        type=path,
        help="plan of QGroundControl",
    )
    add_force(verb, "an existing file")


def run(options: argparse.Namespace) -> int:
    """Write the plan and return the exit code."""
    from jblast.missions.mission import grid_plan, orbit_plan
    from jblast.missions.plan import plan_text
    from jblast.scene import Place

    refuse_existing(options.out, force=options.force)
    common = {"up_m": options.up, "centre_m": options.at, "speed_m_s": options.speed}
    home = Place(*options.home)
    if options.grid:
        width, depth, spacing = options.grid
        plan = grid_plan(
            home, width_m=width, depth_m=depth, spacing_m=spacing, **common
        )
    else:
        radius, turns = options.orbit
        plan = orbit_plan(home, radius_m=radius, turns=turns, **common)
    save_text(plan_text(plan, options.out), options.out)
    sys.stdout.write(f"wrote {options.out}: {len(plan.items)} items\n")
    return 0


def _numbers(text: str, expected: str, least: int, most: int) -> tuple[float, ...]:
    """Return `least` to `most` numbers between commas."""
    words = text.split(",")
    if not least <= len(words) <= most:
        raise argparse.ArgumentTypeError(f"expected {expected}, got {text!r}")
    return tuple(number(word) for word in words)


def _width_depth_spacing(text: str) -> tuple[float, ...]:
    # A depth of 0 is a single lane.
    values = _numbers(text, "WIDTH,DEPTH,SPACING", 3, 3)
    if values[0] <= 0 or values[1] < 0 or values[2] <= 0:
        raise argparse.ArgumentTypeError(
            f"expected a positive WIDTH and SPACING and a DEPTH of 0 or more, got "
            f"{text!r}"
        )
    return values


def _radius_and_turns(text: str) -> tuple[float, ...]:
    values = _numbers(text, "RADIUS or RADIUS,TURNS", 1, 2)
    radius, turns = (*values, 1.0)[:2]
    # A negative radius is valid: counter-clockwise, as in MAVLink.
    if radius == 0 or turns <= 0:
        raise argparse.ArgumentTypeError(
            f"expected a RADIUS other than 0 and positive TURNS, got {text!r}"
        )
    return radius, turns


def _home(text: str) -> tuple[float, ...]:
    values = _numbers(text, "LAT,LON or LAT,LON,ALT", 2, 3)
    # Of swapped coordinates only those with a longitude beyond 90 degrees are found.
    if abs(values[0]) > 90 or abs(values[1]) > 180:
        raise argparse.ArgumentTypeError(
            "expected a latitude of -90 to 90 and a longitude of -180 to 180 degrees, "
            f"got {text!r}"
        )
    return values
