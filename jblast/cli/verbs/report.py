"""Write an HTML page for a run of `jblast world`.

The page is one self-contained file: the blasts, a table of the readings of each blast,
all recordings on one time axis, a map, and the recovery of the vehicle. With --fit the
readings of each blast are fitted separately, with [world] as the prior, and the answers
are printed next to the truth.

Exit code 4: a fit failed or is not reliable.

example:
  jblast report run --fit

input:
  FOLDER              path; folder written by `jblast world`
  --scene SCENE.toml  path; scene file of the run (default: the path in run.json)
model:
  --fit               fit of each blast's readings: answers next to the truth, and 90 %
                      ellipses on the map; fits.json in FOLDER has the whole answers
output:
  --out PAGE.html     path; page (default: report.html in FOLDER, overwritten)
  --json              run.json with the fits as JSON, instead of text
  --force             permission to overwrite an existing --out
"""

import argparse
from dataclasses import replace
from pathlib import Path


def run(options: argparse.Namespace) -> int:
    """Read, perhaps fit, draw, write; return the exit code."""
    from jblast.cli.jax_start import start_jax
    from jblast.progress import stages

    shares = {"starting": 3.0} | ({"fitting": 9.0} if options.fit else {})
    begin = stages(shares | {"drawing": 3.0})
    begin("starting")
    start_jax(quick=True)
    from jblast.files import PAGE, refuse_existing
    from jblast.report.output import Answer, deliver, page_of
    from jblast.report.world import FITS, fits_of, read_run, run_view, scene_of_run
    from jblast.report.world_figures import run_pictures

    if options.out:
        refuse_existing(options.out, force=options.force)
    folder, saved, fits = Path(options.folder), {}, []
    document = read_run(folder)
    path, scene = scene_of_run(folder, document, options.scene)
    if options.fit:
        begin("fitting")
        found, fits = fits_of(folder, document, path)
        document = replace(document, fits=found)
        saved[str(folder / FITS)] = found.to_json()
    begin("drawing")
    view = run_view(document, fits, run_pictures(document, folder, scene, fits))
    saved[options.out or str(folder / PAGE)] = page_of(view)
    return deliver(Answer(document, view, saved=saved), options)
