"""Name the most accurate law for a scene, and whether it is within a tolerance.

All laws are evaluated at the sensors and compared with a reference. The cost of a
reading is printed for information. Exit code 4: no law is within the tolerance.

example:
  jblast choose scene.toml --quantity air_arrival_s --tolerance 0.01

input:
  SCENE.toml           path; scene file with charge, air and sensors; a parameter with a
                       prior counts over its 90 % interval
  --quantity QUANTITY!  text; quantity that the sensors measure, such as air_arrival_s
model:
  --tolerance SHARE    positive; largest accepted relative error, such as 0.01
                       (default: a third of the smallest sigma of the sensors)
output:
  ...json
"""

import argparse


def run(options: argparse.Namespace) -> int:
    """Compare the laws, print and return the exit code."""
    from jblast.report.choice import choice_answer
    from jblast.report.output import deliver
    from jblast.scene import read_scene
    from jblast.waves.choice import choose

    choice = choose(read_scene(options.scene), options.quantity, options.tolerance)
    return deliver(choice_answer(choice), options)
