"""Make a set of explosion images with Blender, for `jblast render --views SET`.

Blender simulates an explosion on the ground (Mantaflow) and renders it from each
direction without a background. The set stores the heat, darkness and opacity of each
pixel; size, time and light come from the scene that uses it. The same command continues
an interrupted run. Blender is a separate program (3.4 or later; on Debian: apt-get
install blender). Two sets of one seed are similar, not identical.
"""

import argparse
import sys
from pathlib import Path

from jblast.cli.arguments.numbers import seed
from jblast.cli.arguments.options import add_force, path
from jblast.cli.arguments.verb_parser import VerbParser
from jblast.files import writing


def add_arguments(verb: VerbParser) -> None:
    """Add the arguments of the verb."""
    verb.model.add_argument(
        "--views",
        type=int,
        default=32,
        metavar="N",
        help="number of directions (default: 32)",
    )
    verb.model.add_argument(
        "--frames",
        type=int,
        default=40,
        metavar="N",
        help="number of times, from burst to smoke (default: 40)",
    )
    verb.model.add_argument(
        "--size",
        type=int,
        default=128,
        metavar="PX",
        help="side of a frame [pixels] (default: 128)",
    )
    verb.model.add_argument(
        "--seed",
        type=seed,
        default=0,
        help="seed of the explosion's lobes (default: 0)",
    )
    verb.advanced.add_argument(
        "--engine",
        choices=("cycles", "eevee"),
        default="cycles",
        help="renderer of Blender; eevee shows less fire (default: cycles)",
    )
    verb.advanced.add_argument(
        "--sampling",
        choices=("hardin", "fibonacci", "grid"),
        default="hardin",
        help="directions on the hemisphere: a Fibonacci lattice offset from the pole "
        "(hardin), a plain one (fibonacci), or rings of latitude (grid) (default: "
        "hardin)",
    )
    verb.advanced.add_argument(
        "--blender",
        metavar="PATH",
        type=path,
        help="Blender program (default: blender, on the PATH)",
    )
    verb.outputs.add_argument(
        "--out",
        required=True,
        metavar="SET",
        type=path,
        help="folder for views.toml and a WebP file for each view",
    )
    add_force(verb, "a set, or a part of another set, in SET")


def run(options: argparse.Namespace) -> int:
    """Simulate, render and write the missing views; print the files written."""
    from jblast.sensors.camera.bake.baking import Baking, blender_found
    from jblast.sensors.camera.bake.recipe import Recipe

    recipe = Recipe(
        views=options.views,
        frames=options.frames,
        size=options.size,
        engine=options.engine,
        seed=options.seed,
        sampling=options.sampling,
    )
    baking = Baking(recipe, Path(options.out))
    # Blender is searched first, so that no folder remains if it is not installed.
    program, version = blender_found(options.blender)
    with writing(options.out):
        # Finished parts of the same set are kept, so that the command may be repeated.
        baking.begin(force=options.force)
        files = baking.make(program, version)
    size = sum((baking.out / file).stat().st_size for file in files)
    sys.stdout.write(
        # The first file is views.toml, the index of the set.
        f"{len(files) - 1} views of {recipe.frames} frames of {recipe.size} x "
        f"{recipe.size} pixels, {size / 1e6:.1f} MB\n"
        f"Written to {options.out}: {files[0]} and {files[1]} to {files[-1]}\n"
    )
    return 0
