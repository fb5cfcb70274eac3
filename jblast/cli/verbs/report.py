"""Write an HTML page for a run of `jblast world`.

The page is one self-contained file: the blasts, a table of the readings of each blast,
all recordings on one time axis, a map, and the recovery of the vehicle. With --fit the
readings of each blast are fitted separately, with [world] as the prior, and the answers
are printed next to the truth.
"""

import argparse
import sys
from pathlib import Path

from jblast.cli.arguments.options import (
    add_force,
    add_live,
    check_live,
    path,
    show_live,
)
from jblast.cli.arguments.verb_parser import VerbParser
from jblast.errors import InputError
from jblast.files import refuse_existing, save_text


def add_arguments(verb: VerbParser) -> None:
    """Add the arguments of the verb."""
    verb.inputs.add_argument(
        "folder", metavar="RUN", type=path, help="folder written by `jblast world`"
    )
    verb.inputs.add_argument(
        "--scene",
        metavar="SCENE.toml",
        type=path,
        help="scene file of the run (default: the path in run.json)",
    )
    verb.model.add_argument(
        "--fit",
        action="store_true",
        help="fit of each blast's readings: answers next to the truth, and 90 %% "
        "ellipses on the map",
    )
    verb.outputs.add_argument(
        "--out",
        metavar="PAGE.html",
        type=path,
        help="page (default: report.html in RUN, overwritten)",
    )
    add_live(verb)
    add_force(verb, "an existing --out")


def run(options: argparse.Namespace) -> int:
    """Read, perhaps fit, draw, write; return the exit code."""
    from jblast.cli.jax_start import start_jax
    from jblast.progress import stages

    shares = {"starting": 3.0} | ({"fitting": 9.0} if options.fit else {})
    begin = stages(shares | {"drawing": 3.0})
    begin("starting")
    start_jax(quick=True)
    from jblast.report.provenance import provenance_of
    from jblast.report.world_page import answers_of, read_run, world_page
    from jblast.world import preset_named, read_world_by

    check_live(options)
    if options.out:
        refuse_existing(options.out, force=options.force)
    world = read_run(options.folder)
    # The run stores the path only; the file may have been moved since.
    scene = options.scene or world.document["scene"]
    if not Path(scene).is_file():
        raise InputError(
            f"{scene}: no such file; expected the scene file of {options.folder}: give "
            "its path by --scene"
        )
    now = provenance_of((), scene).scene
    # Another scene would be drawn and fitted with other priors than those of the run.
    if now and now.sha256 != world.document["scene_sha256"]:
        raise InputError(
            f"{scene}: has changed since {options.folder} was made; expected SHA-256 "
            f"{world.document['scene_sha256']}, got {now.sha256}"
        )
    preset = preset_named((world.document.get("preset") or {}).get("name"))
    # The laws of a fit are those of real blasts: the masses would be wrong.
    if options.fit and preset is not None:
        raise InputError(
            f"--fit: expected a run without a preset, got preset {preset.name}, whose "
            "readings are not those of real blasts"
        )
    uncertain, _ = read_world_by(scene, preset)
    answers = ()
    if options.fit:
        begin("fitting")
        answers = answers_of(world.path, world.document, scene)
    begin("drawing")
    out = Path(options.out) if options.out else world.path / "report.html"
    save_text(world_page(world, uncertain.scene, answers), out)
    sys.stdout.write(f"Written: {out}\n")
    del begin  # the work is done: no progress beside the window
    show_live(options, world.path)
    return 0
