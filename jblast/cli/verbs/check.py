"""List all errors and warnings of a log before a fit.

An error is anything that a fit would refuse (exit code 2). A warning reports a reading
that no blast produces, or a probable mistake in a unit, a clock or a position; it does
not prevent a fit.
"""

import argparse
import sys

from jblast.cli.arguments.logs import add_scale, scaling_of
from jblast.cli.arguments.options import (
    add_force,
    add_json,
    add_reading,
    in_options,
    path,
    reading_options,
)
from jblast.cli.arguments.verb_parser import VerbParser
from jblast.errors import InputError
from jblast.files import refuse_existing, writing


def add_arguments(verb: VerbParser) -> None:
    """Add the arguments of the verb."""
    verb.inputs.add_argument(
        "observations", metavar="LOG", type=path, help="log, as for jblast fit"
    )
    add_reading(verb)
    add_scale(verb)
    verb.model.add_argument(
        "--scene",
        metavar="SCENE.toml",
        type=path,
        help="scene file (default: that of jblast fit, with the charge at any "
        "position)",
    )
    verb.outputs.add_argument(
        "--out",
        metavar="LOG.csv",
        type=path,
        help="copy of the log in columns and units of jblast, if there is no error",
    )
    add_json(verb)
    add_force(verb, "an existing --out")


def run(options: argparse.Namespace) -> int:
    """Check, print, perhaps write; return the exit code."""
    from jblast.cli.jax_start import start_jax
    from jblast.progress import stages

    begin = stages({"starting": 2.0, "reading": 0.3, "checking": 2.0})
    begin("starting")
    start_jax(quick=True)
    import jblast.waves as _waves  # noqa: F401  registers the laws
    from jblast.inference.sanity import doubts
    from jblast.observations import read, write
    from jblast.observations.check import refusals, with_places
    from jblast.observations.table import SAMPLES
    from jblast.report.check import check_answer, check_text, setting_lines
    from jblast.report.messages import conversion_comments, sentences_of
    from jblast.scene import default_scene, read_scene

    if options.out:
        refuse_existing(options.out, force=options.force)
    # A fit without --scene has the same default.
    uncertain = read_scene(options.scene) if options.scene else default_scene()
    begin("reading")
    faults: list[InputError] = []
    log = read(options.observations, faults=faults, **reading_options(options))
    if not len(log) and len(faults) == 1 and not options.json:
        raise faults[0]  # no file, or no table: a list of one is no help
    begin("checking")
    readings = log
    if SAMPLES in log.quantity:
        from jblast.signals.picks.pick_log import picked_log

        scale, high = scaling_of(options), options.high_pass
        readings = picked_log(log, scale, high_pass_hz=high, faults=faults)
    # All faults are collected, so that one run is enough to correct a log.
    faults += refusals(readings, uncertain) if len(readings) else []
    # Positions come from the scene where the log has none, as in a fit.
    placed, readings = with_places(log, uncertain), with_places(readings, uncertain)
    odd = doubts(readings, uncertain) if len(readings) else []
    worded = [in_options(fault) for fault in faults]
    setting = setting_lines(readings if len(readings) else placed, uncertain)
    understood = [*sentences_of(log.understood), *setting]
    answer = check_answer(placed, worded, odd, understood, readings)
    if options.json:
        sys.stdout.write(answer.to_json())
    else:
        sys.stdout.write(check_text(answer, worded))
    # A log with errors would be refused by the fit that reads the converted one.
    if options.out and not faults:
        with writing(options.out):
            write(options.out, log, comments=conversion_comments(log))
    return answer.exit_code
