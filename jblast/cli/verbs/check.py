"""List all errors and warnings of a log before a fit.

An error is anything that a fit would refuse (exit code 2). A warning reports a reading
that no blast produces, or a probable mistake in a unit, a clock or a position; it does
not prevent a fit.

example:
  jblast check log.csv

input:
  LOG                  path; log, as for jblast fit
  ...reading
  ...scale
model:
  --scene SCENE.toml   path; scene file (default: that of jblast fit, with the charge at
      any position)
output:
  --out LOG.csv        path; copy of the log in columns and units of jblast, if there is
      no error
  ...out
"""

import argparse


def run(options: argparse.Namespace) -> int:
    """Check, print, perhaps write; return the exit code."""
    from jblast.files import refuse_existing, writing
    from jblast.progress import stages

    begin = stages({"starting": 2.0, "reading": 0.3, "checking": 2.0})
    begin("starting")
    import jblast.waves as _waves  # noqa: F401  registers the laws
    from jblast.cli.options import in_options, reading_options, scaling_of
    from jblast.errors import InputError
    from jblast.inference.sanity import doubts
    from jblast.observations import read, write
    from jblast.observations.check import refusals, with_places
    from jblast.report.check import check_answer, setting_lines
    from jblast.report.messages import conversion_comments, sentences_of
    from jblast.report.output import deliver
    from jblast.scene import default_scene, read_scene
    from jblast.signals.picks.pick_log import picked_log

    if options.out:
        refuse_existing(options.out, force=options.force)
    # a fit without --scene has the same default
    scene = read_scene(options.scene) if options.scene else default_scene()
    begin("reading")
    faults: list[InputError] = []
    log = read(options.log, faults=faults, **reading_options(options))
    if not len(log) and len(faults) == 1 and not options.json:
        raise faults[0]  # no file, or no table: a list of one is no help
    begin("checking")
    scale, high = scaling_of(options), options.high_pass
    readings = picked_log(log, scale, high_pass_hz=high, faults=faults)
    # all faults are collected, so that one run is enough to correct a log
    faults += refusals(readings, scene) if len(readings) else []
    # positions come from the scene where the log has none, as in a fit
    placed, readings = with_places(log, scene), with_places(readings, scene)
    odd = doubts(readings, scene) if len(readings) else []
    setting = setting_lines(readings if len(readings) else placed, scene)
    understood = [*sentences_of(log.understood), *setting]
    worded = [in_options(fault) for fault in faults]
    answer = check_answer(placed, worded, odd, understood, readings)
    # a log with errors would be refused by the fit that reads the converted one
    if options.out and not faults:
        with writing(options.out):
            write(options.out, log, comments=conversion_comments(log))
    return deliver(answer, options)
