"""Say what a planned layout of sensors could tell, before any shot."""

import argparse
import math
import sys
from collections.abc import Sequence

from jblast.cli.arguments.options import (
    add_free,
    add_law,
    add_noise,
    check_figure,
    names_to_free,
    path,
    save_figure,
)
from jblast.errors import InputError


def add_arguments(verb: argparse.ArgumentParser) -> None:
    """Say what the verb takes."""
    verb.add_argument(
        "scene",
        metavar="SCENE.toml",
        type=path,
        help="what is there and what is not known of it; every sensor says where it "
        "stands and what it records, as records = { QUANTITY = SIGMA }",
    )
    verb.add_argument(
        "--at",
        action="append",
        default=[],
        metavar="PARAMETER=VALUE",
        help="number taken for true, as charge_mass_kg=15; needed for all that is free "
        "but origin times and clocks (default: the median of the prior); repeatable",
    )
    add_free(verb)
    verb.add_argument(
        "--map",
        metavar="FILE",
        type=path,
        help="draw the sd of mass, and of place, over where a next sensor could stand "
        "(.png, .svg or .pdf)",
    )
    add_law(verb)
    add_noise(verb)
    verb.add_argument(
        "--verbose",
        action="store_true",
        help="also print why each law was chosen, and its scatter",
    )
    verb.add_argument("--json", action="store_true", help="print the answer as JSON")
    verb.add_argument(
        "--force", action="store_true", help="overwrite an existing --map"
    )


def run(asked: argparse.Namespace) -> int:
    """Compute the bound, print it, and return the exit code."""
    from jblast.cli.jax_start import start_jax
    from jblast.progress import stages

    shares = {"starting": 2.0, "the bound": 8.0}
    begin = stages(shares | ({"the map": 6.0} if asked.map else {}))
    begin("starting")
    start_jax(quick=not asked.map)  # a map is drawn from thousands of places
    from jblast.inference import bound
    from jblast.report.design import BoundAnswer, bound_text
    from jblast.scene import freed, read_scene, with_laws
    from jblast.sensors.law_choice import laws_named

    if asked.map:
        check_figure("--map", asked.map, force=asked.force)
    at = _values(asked.at)
    uncertain = freed(read_scene(asked.scene), names_to_free(asked.free))
    held = {q for sensor in uncertain.scene.sensors for q, _ in sensor.records}
    if held:  # else the message that nothing is recorded comes first
        uncertain = with_laws(uncertain, laws_named(asked.law, held))
    begin("the bound")
    found = bound(uncertain, at, noise=asked.noise)
    if asked.map:
        begin("the map")
        from jblast.inference import bound_map
        from jblast.report.design_figure import bound_figure

        save_figure(bound_figure(bound_map(found)), asked.map)
    if asked.json:
        sys.stdout.write(BoundAnswer(found.summary).to_json())
    else:
        sys.stdout.write(bound_text(found, plot=asked.map, verbose=asked.verbose))
    return found.exit_code


def _values(words: Sequence[str]) -> dict[str, float]:
    """Return the numbers after each `--at`; one may hold several, after commas."""
    values = {}
    for word in (part.strip() for item in words for part in item.split(",")):
        name, equals, number = word.partition("=")
        try:
            value = float(number)
        except ValueError:
            value = math.nan
        if not (equals and name.strip() and math.isfinite(value)):
            raise InputError(
                f"--at {word}: expected PARAMETER=VALUE with a finite number, as "
                "charge_mass_kg=15"
            )
        if name.strip() in values:
            raise InputError(f"--at {name.strip()}: expected one value, got several")
        values[name.strip()] = value
    return values
