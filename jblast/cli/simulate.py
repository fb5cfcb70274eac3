"""Write what a scene's sensors would record, errors and priors drawn."""

import argparse
import sys

HELP = "write what a scene's sensors would record"


def add_arguments(verb: argparse.ArgumentParser) -> None:
    """Say what the verb takes."""
    verb.add_argument("scene", metavar="SCENE.toml")
    verb.add_argument("--out", metavar="OBSERVATIONS.csv", required=True)
    verb.add_argument("--seed", type=int, default=0, help="of the draws (default: 0)")
    verb.add_argument(
        "--force", action="store_true", help="overwrite an existing --out"
    )


def run(asked: argparse.Namespace) -> int:
    """Simulate, write the log and return the exit code."""
    from jblast.cli.start import start_jax

    start_jax()
    from jblast.cli.files import refuse_existing
    from jblast.observations import write
    from jblast.scene import read_scene
    from jblast.sensors import simulate

    refuse_existing(asked.out, force=asked.force)
    observations = simulate(read_scene(asked.scene), asked.seed)
    write(asked.out, observations)
    sys.stdout.write(
        f"wrote {asked.out}: {len(observations)} simulated readings; fit them with: "
        f"jblast fit {asked.out}\n"
    )
    return 0
