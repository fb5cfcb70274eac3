"""Predict the uncertainty of a fit for a planned sensor layout.

No recording is needed: the prediction follows from positions and standard errors of the
sensors and from the laws.

example:
  jblast bound scene.toml --at charge_mass_kg=25 --map map.png

input:
  SCENE.toml              path; scene file with priors and free parameters; each sensor
      has a position and its records (QUANTITY = SIGMA)
  --at PARAMETER=VALUE    text*; assumed true value, such as charge_mass_kg=15; required
      for all free parameters except origin times and clocks (default: median of the
      prior); repeatable
  ...free
  ...law
output:
  --map FILE              path; map of the standard deviations of mass and of position
      with one more sensor, over the position of that sensor (.png, .svg or .pdf)
  --verbose               reason for each law and its scatter, in the printed text
  ...json
  --force                 permission to overwrite an existing --map
  ...noise
"""

import argparse
import math
from collections.abc import Sequence
from dataclasses import replace

from jblast.errors import InputError


def run(options: argparse.Namespace) -> int:
    """Compute the bound, print it, and return the exit code."""
    from jblast.cli.jax_start import start_jax
    from jblast.cli.options import check_figure
    from jblast.progress import stages

    # approximate durations, from which the progress line estimates the time left
    shares = {"starting": 2.0, "the bound": 8.0}
    begin = stages(shares | ({"the map": 6.0} if options.map else {}))
    begin("starting")
    start_jax(quick=not options.map)  # a map needs thousands of bounds
    from jblast.inference import bound, bound_map
    from jblast.inference.laws import laws_named
    from jblast.report.design import bound_answer, bound_figure
    from jblast.report.output import deliver, figure_file
    from jblast.scene import freed, read_scene, with_laws

    if options.map:
        check_figure("--map", options.map, force=options.force)
    at = _values(options.at)
    # each additional free parameter widens the bounds of the others
    uncertain = freed(read_scene(options.scene), options.free or ())
    held = {q for sensor in uncertain.scene.sensors for q, _ in sensor.records}
    if held:  # without readings `bound` itself has the better message
        uncertain = with_laws(uncertain, laws_named(options.law, held))
    begin("the bound")
    found = bound(uncertain, at, noise=options.noise)
    answer = bound_answer(found)
    if options.map:
        begin("the map")
        drawn = bound_map(found)
        content = figure_file(lambda: bound_figure(drawn), options.map)
        answer = replace(answer, saved={options.map: content})
    return deliver(answer, options)


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
