"""Make a set of views of an explosion: `jblast render SCENE.toml --views SET` uses it.

Blender simulates an explosion on the ground (Mantaflow) and renders it from every view
without what is behind it. The set says how hot, how dark and how opaque each pixel is;
size, time and light come from the scene it is used in. What is finished is kept: the
same command goes on after an interruption. Blender is another program (3.4 or later, of
Debian: apt-get install blender). Two bakes of one seed are alike, and not the same.
"""

import argparse
import sys
from pathlib import Path

from jblast.cli.arguments.numbers import seed
from jblast.cli.arguments.options import path
from jblast.files import writing


def add_arguments(verb: argparse.ArgumentParser) -> None:
    """Say what the verb takes."""
    verb.add_argument(
        "--out",
        required=True,
        metavar="SET",
        type=path,
        help="directory to write to: views.toml, and a WebP file for each view",
    )
    verb.add_argument(
        "--views", type=int, default=32, metavar="N", help="directions (default: 32)"
    )
    verb.add_argument(
        "--frames",
        type=int,
        default=40,
        metavar="N",
        help="instants, from burst to smoke (default: 40)",
    )
    verb.add_argument(
        "--size",
        type=int,
        default=128,
        metavar="PX",
        help="side of a frame (default: 128)",
    )
    verb.add_argument(
        "--engine",
        choices=("cycles", "eevee"),
        default="cycles",
        help="renderer of Blender; eevee has less fire (default: cycles)",
    )
    verb.add_argument(
        "--seed",
        type=seed,
        default=0,
        help="of the explosion: where its lobes are (default: 0)",
    )
    verb.add_argument(
        "--sampling",
        choices=("hardin", "fibonacci", "grid"),
        default="hardin",
        help="directions on the hemisphere: a Fibonacci lattice offset from the pole "
        "(default), a plain one, or rings of latitude",
    )
    verb.add_argument(
        "--blender",
        metavar="PATH",
        type=path,
        help="the program (default: blender, on the PATH)",
    )
    verb.add_argument(
        "--force",
        action="store_true",
        help="overwrite a set, or a part of another one, that SET holds",
    )


def run(asked: argparse.Namespace) -> int:
    """Simulate, render and write what is missing; say what was written."""
    from jblast.sensors.camera.bake.baking import Baking, blender_found
    from jblast.sensors.camera.bake.recipe import Recipe

    recipe = Recipe(
        views=asked.views,
        frames=asked.frames,
        size=asked.size,
        engine=asked.engine,
        seed=asked.seed,
        sampling=asked.sampling,
    )
    baking = Baking(recipe, Path(asked.out))
    program, version = blender_found(asked.blender)
    with writing(asked.out):
        baking.begin(force=asked.force)
        files = baking.make(program, version)
    size = sum((baking.out / file).stat().st_size for file in files)
    sys.stdout.write(
        f"{len(files) - 1} views of {recipe.frames} frames of {recipe.size} x "
        f"{recipe.size} pixels, {size / 1e6:.1f} MB\n"
        f"Written: {asked.out}, {files[0]} and {files[1]} to {files[-1]}\n"
    )
    return 0
