"""Choose the cheapest method that is accurate enough for a scene, with the reason.

Exit code 4: no method is accurate enough.

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
    """Choose, print and return the exit code."""
    from jblast.cli.jax_start import start_jax
    from jblast.progress import stages

    begin = stages({"starting": 2.0, "choosing": 1.0})
    begin("starting")
    start_jax(quick=True)
    from jblast.fidelity import choose
    from jblast.report.choice import choice_answer
    from jblast.report.output import deliver
    from jblast.scene import read_scene

    begin("choosing")
    # Errors and costs are read from measured tables, so that no method is timed here.
    choice = choose(read_scene(options.scene), options.quantity, options.tolerance)
    return deliver(choice_answer(choice), options)
