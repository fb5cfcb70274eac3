"""Write what a scene's sensors would record, errors and priors drawn."""

import argparse
import math
import sys

from jblast.cli.arguments.numbers import seed
from jblast.cli.arguments.options import path
from jblast.errors import InputError
from jblast.files import refuse_existing, writing


def add_arguments(verb: argparse.ArgumentParser) -> None:
    """Say what the verb takes."""
    verb.add_argument(
        "scene",
        metavar="SCENE.toml",
        type=path,
        help="what is there; every sensor says where it stands and what it records, "
        "as records = { QUANTITY = SIGMA }; radii are recorded at times_s = [...]",
    )
    verb.add_argument(
        "--out",
        metavar="OBSERVATIONS.csv",
        required=True,
        type=path,
        help="log to write",
    )
    verb.add_argument("--seed", type=seed, default=0, help="of the draws (default: 0)")
    verb.add_argument(
        "--force", action="store_true", help="overwrite an existing --out"
    )


def _refuse_senseless(observations, asked: argparse.Namespace) -> None:
    """Refuse readings that no log may hold: of a mass drawn below zero, for one."""
    from jblast.quantities import ADDITIVE

    for row, quantity in enumerate(observations.quantity):
        value, sigma = float(observations.value[row]), float(observations.sigma[row])
        if not (math.isfinite(value) and 0 < sigma < math.inf) or (
            quantity not in ADDITIVE and value <= 0
        ):
            drawn = ", ".join(c for c in observations.comments if "truth:" in c)
            raise InputError(
                f"{asked.scene}: sensor {observations.sensor[row]!r}: "
                f"seed {asked.seed} makes {quantity} {value:g} with sigma {sigma:g}"
                f"{f' ({drawn})' if drawn else ''}; expected priors and sigmas that "
                "allow a reading (lognormal keeps a mass positive)"
            )


def run(asked: argparse.Namespace) -> int:
    """Simulate, write the log and return the exit code."""
    from jblast.cli.jax_start import start_jax

    start_jax(quick=True)
    from jblast.observations import write
    from jblast.scene import read_scene
    from jblast.sensors import simulate

    refuse_existing(asked.out, force=asked.force)
    observations = simulate(read_scene(asked.scene), asked.seed)
    _refuse_senseless(observations, asked)
    with writing(asked.out):
        write(asked.out, observations)
    sys.stdout.write(
        f"wrote {asked.out}: {len(observations)} simulated readings; fit them with: "
        f"jblast fit {asked.out} (jblast scene {asked.out} writes a scene for it)\n"
    )
    return 0
