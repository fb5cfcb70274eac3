"""Predict the uncertainty of a fit for a planned sensor layout.

No recording is needed: the prediction follows from positions and standard errors of the
sensors and from the laws.
"""

import argparse
import math
import sys
from collections.abc import Sequence

from jblast.cli.arguments.options import (
    add_force,
    add_free,
    add_json,
    add_law,
    add_noise,
    check_figure,
    names_between_commas,
    path,
    save_figure,
)
from jblast.cli.arguments.verb_parser import VerbParser
from jblast.errors import InputError


def add_arguments(verb: VerbParser) -> None:
    """Add the arguments of the verb."""
    verb.inputs.add_argument(
        "scene",
        metavar="SCENE.toml",
        type=path,
        help="scene file with priors and free parameters; each sensor has a position "
        "and its records (QUANTITY = SIGMA)",
    )
    verb.inputs.add_argument(
        "--at",
        action="append",
        default=[],
        metavar="PARAMETER=VALUE",
        help="assumed true value, such as charge_mass_kg=15; required for all free "
        "parameters except origin times and clocks (default: median of the prior); "
        "repeatable",
    )
    add_free(verb)
    add_law(verb)
    add_noise(verb)
    verb.outputs.add_argument(
        "--map",
        metavar="FILE",
        type=path,
        help="map of the standard deviations of mass and of position with one more "
        "sensor, over the position of that sensor (.png, .svg or .pdf)",
    )
    verb.outputs.add_argument(
        "--verbose",
        action="store_true",
        help="reason for each law and its scatter, in the printed text",
    )
    add_json(verb)
    add_force(verb, "an existing --map")


def run(options: argparse.Namespace) -> int:
    """Compute the bound, print it, and return the exit code."""
    from jblast.cli.jax_start import start_jax
    from jblast.progress import stages

    # Approximate durations, from which the progress line estimates the time left.
    shares = {"starting": 2.0, "the bound": 8.0}
    begin = stages(shares | ({"the map": 6.0} if options.map else {}))
    begin("starting")
    start_jax(quick=not options.map)  # a map needs thousands of bounds
    from jblast.inference import bound
    from jblast.report.design import BoundAnswer, bound_text
    from jblast.scene import freed, read_scene, with_laws
    from jblast.sensors.law_choice import laws_named

    if options.map:
        check_figure("--map", options.map, force=options.force)
    at = _values(options.at)
    # Each additional free parameter widens the bounds of the others.
    uncertain = freed(read_scene(options.scene), names_between_commas(options.free))
    held = {q for sensor in uncertain.scene.sensors for q, _ in sensor.records}
    if held:  # without readings `bound` itself has the better message
        uncertain = with_laws(uncertain, laws_named(options.law, held))
    begin("the bound")
    found = bound(uncertain, at, noise=options.noise)
    if options.map:
        begin("the map")
        from jblast.inference import bound_map
        from jblast.report.design_figure import bound_figure

        save_figure(bound_figure(bound_map(found)), options.map)
    if options.json:
        sys.stdout.write(BoundAnswer(found.summary).to_json())
    else:
        sys.stdout.write(bound_text(found, plot=options.map, verbose=options.verbose))
    return found.exit_code


def _values(words: Sequence[str]) -> dict[str, float]:
    """Return the values of each `--at`, which may have several between commas."""
    values = {}
    for word in (part.strip() for item in words for part in item.split(",")):
        name, equals, number = word.partition("=")
        try:
            value = float(number)
        except ValueError:
            # NaN fails the test below, which has the message for any wrong text.
            value = math.nan
        if not (equals and name.strip() and math.isfinite(value)):
            raise InputError(
                f"--at {word}: expected PARAMETER=VALUE with a finite number, as "
                "charge_mass_kg=15"
            )
        # A repeated value is probably a wrong name: the last must not win silently.
        if name.strip() in values:
            raise InputError(f"--at {name.strip()}: expected one value, got several")
        values[name.strip()] = value
    return values
