"""Simulate the readings of a scene's sensors, with random errors."""

import argparse
import math
import sys

from jblast.cli.arguments.numbers import seed
from jblast.cli.arguments.options import add_force, path
from jblast.cli.arguments.verb_parser import VerbParser
from jblast.errors import InputError
from jblast.files import refuse_existing, writing


def add_arguments(verb: VerbParser) -> None:
    """Add the arguments of the verb."""
    verb.inputs.add_argument(
        "scene",
        metavar="SCENE.toml",
        type=path,
        help="scene file; each sensor has a position and its records (QUANTITY = "
        "SIGMA; radii also times_s); parameters with a prior are sampled",
    )
    verb.outputs.add_argument(
        "--out",
        metavar="OBSERVATIONS.csv",
        required=True,
        type=path,
        help="log of the readings",
    )
    verb.advanced.add_argument(
        "--seed", type=seed, default=0, help="seed of errors and priors (default: 0)"
    )
    add_force(verb, "an existing --out")


def _check_readings(observations, options: argparse.Namespace) -> None:
    """Check that a log may contain the readings; a sampled mass may be negative.

    Raises:
        InputError: A value or a sigma is not finite, or not positive.
    """
    from jblast.quantities import ADDITIVE

    for row, quantity in enumerate(observations.quantity):
        value, sigma = float(observations.value[row]), float(observations.sigma[row])
        if not (math.isfinite(value) and 0 < sigma < math.inf) or (
            quantity not in ADDITIVE and value <= 0
        ):
            # The sampled truth is in the comments of the log, and explains a bad value.
            drawn = ", ".join(c for c in observations.comments if "truth:" in c)
            raise InputError(
                f"{options.scene}: sensor {observations.sensor[row]!r}: "
                f"seed {options.seed} gives {quantity} {value:g} with sigma {sigma:g}"
                f"{f' ({drawn})' if drawn else ''}; expected priors and sigmas that "
                "give a valid reading (a lognormal prior keeps a mass positive)"
            )


def run(options: argparse.Namespace) -> int:
    """Simulate, write the log and return the exit code."""
    from jblast.cli.jax_start import start_jax

    start_jax(quick=True)
    from jblast.observations import write
    from jblast.scene import read_scene
    from jblast.sensors import simulate

    # Checked before the simulation compiles.
    refuse_existing(options.out, force=options.force)
    observations = simulate(read_scene(options.scene), options.seed)
    _check_readings(observations, options)
    with writing(options.out):
        write(options.out, observations)
    sys.stdout.write(
        f"wrote {options.out}: {len(observations)} simulated readings; fit them with: "
        f"jblast fit {options.out} (jblast scene {options.out} writes a scene for it)\n"
    )
    return 0
