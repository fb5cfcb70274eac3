"""Say everything that is wrong with a log at once, before it is fitted.

What a fit would refuse is a fault (exit code 2); what no blast does, or what looks like
a slip of a unit, a clock or a place, is a warning and stops nothing.
"""

import argparse
import sys

from jblast.cli.arguments.logs import add_scale, scaling_of
from jblast.cli.arguments.options import add_reading, in_options, path, reading_asked
from jblast.errors import InputError
from jblast.files import refuse_existing, writing


def add_arguments(verb: argparse.ArgumentParser) -> None:
    """Say what the verb takes."""
    verb.add_argument("observations", metavar="LOG", type=path, help="the log")
    verb.add_argument(
        "--scene",
        metavar="SCENE.toml",
        type=path,
        help="what is known of the scene (default: as fit takes it, but rows may agree "
        "on a charge anywhere)",
    )
    add_reading(verb)
    add_scale(verb)
    verb.add_argument(
        "--out",
        metavar="LOG.csv",
        type=path,
        help="write the log in our columns and units, if nothing stops a fit",
    )
    verb.add_argument("--json", action="store_true", help="print the answer as JSON")
    verb.add_argument(
        "--force", action="store_true", help="overwrite an existing --out"
    )


def run(asked: argparse.Namespace) -> int:
    """Check, print, perhaps write; return the exit code."""
    from jblast.cli.jax_start import start_jax
    from jblast.progress import stages

    begin = stages({"starting": 2.0, "reading": 0.3, "checking": 2.0})
    begin("starting")
    start_jax(quick=True)
    import jblast.waves as _waves  # noqa: F401  which laws there are is asked below
    from jblast.inference.sanity import doubts
    from jblast.observations import read, write
    from jblast.observations.check import refusals, with_places
    from jblast.observations.table import SAMPLES
    from jblast.report.check import check_answer, check_text, setting_lines
    from jblast.report.understood import conversion_comments, understood_lines
    from jblast.scene import default_scene, read_scene

    if asked.out:
        refuse_existing(asked.out, force=asked.force)
    uncertain = read_scene(asked.scene) if asked.scene else default_scene()
    begin("reading")
    faults: list[InputError] = []
    log = read(asked.observations, faults=faults, **reading_asked(asked))
    if not len(log) and len(faults) == 1 and not asked.json:
        raise faults[0]  # no file, or no table: one message says it
    begin("checking")
    readings = log
    if SAMPLES in log.quantity:
        from jblast.signals.picks.pick_log import picked_log

        scale, high = scaling_of(asked), asked.high_pass
        readings = picked_log(log, scale, high_pass_hz=high, faults=faults).observations
    faults += refusals(readings, uncertain) if len(readings) else []
    placed, readings = with_places(log, uncertain), with_places(readings, uncertain)
    odd = doubts(readings, uncertain) if len(readings) else []
    worded = [in_options(fault) for fault in faults]
    setting = setting_lines(readings if len(readings) else placed, uncertain)
    understood = [*understood_lines(log.understood), *setting]
    answer = check_answer(placed, worded, odd, understood, readings)
    if asked.json:
        sys.stdout.write(answer.to_json())
    else:
        sys.stdout.write(check_text(answer))
    if asked.out and not faults:
        with writing(asked.out):
            write(asked.out, log, comments=conversion_comments(log))
    return answer.exit_code
