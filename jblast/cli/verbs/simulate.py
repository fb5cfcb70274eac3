"""Simulate the readings of a scene's sensors, with random errors.

example:
  jblast simulate scene.toml --out log.csv --seed 1

input:
  SCENE.toml              path; scene file; each sensor has a position and its records
                          (QUANTITY = SIGMA; radii also times_s); parameters with a
                          prior are sampled
output:
  --out OBSERVATIONS.csv!  path; log of the readings
  --force                 permission to overwrite an existing --out
advanced:
  --seed N                seed = 0; seed of errors and priors
"""

import argparse
import sys

from jblast.files import refuse_existing, writing


def run(options: argparse.Namespace) -> int:
    """Simulate, write the log and return the exit code."""
    from jblast.cli.jax_start import start_jax

    start_jax(quick=True)
    from jblast.observations import write
    from jblast.scene import read_scene
    from jblast.sensors import simulate
    from jblast.sensors.simulated_readings import check_readings

    # Checked before the simulation compiles.
    refuse_existing(options.out, force=options.force)
    observations = simulate(read_scene(options.scene), options.seed)
    check_readings(observations, options.scene, options.seed)
    with writing(options.out):
        write(options.out, observations)
    sys.stdout.write(
        f"wrote {options.out}: {len(observations)} simulated readings; fit them with: "
        f"jblast fit {options.out} (jblast scene {options.out} writes a scene for it)\n"
    )
    return 0
