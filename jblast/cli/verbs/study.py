"""Run a Monte Carlo study: sample a scene many times and compute outcomes.

`jblast study STUDY.toml --out STUDY.zarr` runs the study of a file. --resume continues
an interrupted run without computing a sample twice. `jblast study report STUDY.zarr
--out DIR` writes a page of results.

example:
  jblast study study.toml --out study.zarr

input:
  [STUDY...]           path; study file; or `report` and a store
model:
  --limit N            integer; approximate number of samples to compute in this run
                       (default: all)
  --resume             continuation of an existing store, also with more
                       samples, or start of a new one
output:
  --out STUDY.zarr     path; store, a folder; of a report the folder of page, figures
                       and study.json
  --list               list of the available outcomes, with their units
  ...out
advanced:
  --devices all|N      text; number of devices: GPUs of this machine, or cores of its
                       CPU (default: all)
  --scheduler ADDRESS  text; address of a Dask scheduler, such as tcp://HOST:8786, whose
                       workers all see --out under the same path (default: none)
  --allow-code         permission for outcomes that are Python functions, as
                       python:module.function
"""

import argparse

from jblast.errors import InputError, argument

USES = {
    "run": {"out", "limit", "resume", "devices", "scheduler", "allow_code"},
    "list": {"list"},
    "report": {"out", "force"},
}
"""Options of each task, next to --json."""


def run(options: argparse.Namespace) -> int:
    """Run or continue a study, list outcomes, or report on a store."""
    from jblast.cli.jax_start import start_jax

    first = "".join(options.study[:1])
    task = "list" if options.list else first if first == "report" else "run"
    paths = options.study[1:] if task == first else options.study
    for name in sorted(set().union(*USES.values()) - USES[task]):
        if getattr(options, name):
            raise InputError(
                f"{argument(name)}: expected no such option of study {task}, got one"
            )
    if task != "list" and len(paths) != 1:
        expected = "STUDY.toml" if task == "run" else "store"
        got = " ".join(paths) or "nothing"
        raise InputError(f"study {task}: expected one {expected}, got {got}")
    if task == "run" and not options.out:
        raise InputError(
            f"{argument('out')}: expected the folder of the store, got nothing"
        )
    # with a scheduler this process only distributes slabs
    start_jax(all_cores=task == "run" and not options.scheduler, quick=task != "run")
    from jblast.files import check_out
    from jblast.report import study as report
    from jblast.report.output import deliver

    if task == "list":
        return deliver(report.list_answer(), options)
    if task == "report":
        if options.out:
            check_out(options.out, report.NAMES, force=options.force)
        answer = report.store_answer(paths[0])
        return deliver(answer, options, folder=options.out, names=report.NAMES)
    from jblast.study import read_study, run_into
    from jblast.study.slabs import devices_of

    study = read_study(paths[0], allow_code=options.allow_code)
    # Each sample has a key of its own, so that results do not depend on the devices.
    ran = run_into(
        study,
        options.out,
        resume=options.resume,
        limit=options.limit,
        devices=devices_of(options.devices),
        scheduler=options.scheduler,
    )
    return deliver(report.run_answer(ran), options)
