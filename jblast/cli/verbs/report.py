"""Show a world on one page: who perceived which blast, and what became of the vehicle.

The page needs nothing beside it: the blasts, a table of who perceived what when, every
sense on one time axis, a map, the vehicle's recovery. With --fit the readings of each
blast are fitted by themselves, with [world] as the prior, and their answers stand
beside the truth.
"""

import argparse
import sys
from pathlib import Path

from jblast.cli.arguments.options import add_live, check_live, path, show_live
from jblast.errors import InputError
from jblast.files import refuse_existing, save_text


def add_arguments(verb: argparse.ArgumentParser) -> None:
    """Say what the verb takes."""
    verb.add_argument(
        "folder", metavar="RUN", type=path, help="directory that `jblast world` wrote"
    )
    verb.add_argument(
        "--scene",
        metavar="SCENE.toml",
        type=path,
        help="what it was drawn from (default: where run.json says that it is)",
    )
    verb.add_argument(
        "--fit",
        action="store_true",
        help="fit the readings of each blast: answers beside the truth, and 90 %% "
        "ellipses on the map",
    )
    verb.add_argument(
        "--out",
        metavar="PAGE.html",
        type=path,
        help="the page (default: report.html in RUN, made anew)",
    )
    add_live(verb)
    verb.add_argument(
        "--force", action="store_true", help="overwrite an existing --out"
    )


def run(asked: argparse.Namespace) -> int:
    """Read, perhaps fit, draw, write; return the exit code."""
    from jblast.cli.jax_start import start_jax
    from jblast.progress import stages

    shares = {"starting": 3.0} | ({"fitting": 9.0} if asked.fit else {})
    begin = stages(shares | {"drawing": 3.0})
    begin("starting")
    start_jax(quick=True)
    from jblast.report.provenance import provenance_of
    from jblast.report.world_page import answers_of, read_run, world_page
    from jblast.world import preset_named, read_world_by

    check_live(asked)
    if asked.out:
        refuse_existing(asked.out, force=asked.force)
    world = read_run(asked.folder)
    scene = asked.scene or world.document["scene"]
    if not Path(scene).is_file():
        raise InputError(
            f"{scene}: no such file; expected the scene that {asked.folder} was drawn "
            "from: name it by --scene"
        )
    now = provenance_of((), scene).scene
    if now and now.sha256 != world.document["scene_sha256"]:
        raise InputError(
            f"{scene}: has changed since {asked.folder} was drawn; expected SHA-256 "
            f"{world.document['scene_sha256']}, got {now.sha256}"
        )
    preset = preset_named((world.document.get("preset") or {}).get("name"))
    if asked.fit and preset is not None:
        raise InputError(
            f"--fit: expected a run whose readings are those of blasts, got one by the "
            f"preset {preset.name}"
        )
    uncertain, _ = read_world_by(scene, preset)
    answers = ()
    if asked.fit:
        begin("fitting")
        answers = answers_of(world.path, world.document, scene)
    begin("drawing")
    out = Path(asked.out) if asked.out else world.path / "report.html"
    save_text(world_page(world, uncertain.scene, answers), out)
    sys.stdout.write(f"Written: {out}\n")
    del begin  # nothing is being waited for any more
    show_live(asked, world.path)
    return 0
