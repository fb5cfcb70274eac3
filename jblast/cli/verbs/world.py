"""Simulate a vehicle and all sensors of a scene through random or given blasts.

The scene's [world] gives number, times, positions and masses of random blasts, [charge]
given ones. The vehicle hovers or flies its mission, sensors record, and the camera
films; mounted sensors move with the vehicle. Times are on the clock of the scene, which
begins at 0; only the file and the readings of a sensor are on its own clock. Output:
blasts.csv (the truth), perceived.csv, observations.csv (for `jblast fit`), flight.csv,
sound/, camera/ and run.json.

example:
  jblast world world.toml --out run --seed 1

input:
  SCENE.toml              path; scene file with [world] or [charge]; parameters with a
                          prior are sampled
model:
  --seconds S             positive; duration of the world [s] (default: until 5 s after
                          the arrival of the last wave, without a vehicle 0.5 s; a
                          mission also until it is disarmed)
  --estimator ekf         choice; state estimator of the vehicle, fed by simulated
                          instruments (default: true state)
  --controllers NAME,...  names; controllers of a hovering vehicle, as for `jblast fly`;
                          the first one flies the recorded flight (default:
                          with_integral,without_integral)
  --detect                search of microphones and camera for blasts while they are
                          recorded; detections.csv has each detection with its latency
  --frames all            choice; storage of every frame (default: of those with a
                          fireball in view)
  --fit                   fit of each blast's readings with [world] as the prior,
                          fits.json and report.html
output:
  --out FOLDER!           path; folder for the run
  --live [SPEED]          positive ? 1.0; view in a browser while the run is computed,
                          SPEED times as fast as its clock (default: no view; without a
                          number 1)
  --viewer rerun          choice; view in a browser as fast as the run is computed
  --save FILE.rrd         path; recording for the viewer Rerun
  --mcap FILE.mcap        path; recording as a bag of ROS 2, for Foxglove too
  ...out
advanced:
  --seed N                seed = 0; seed of all random numbers
"""

import argparse
import subprocess
import sys


def run(options: argparse.Namespace) -> int:
    """Run the world, write, print; return the exit code."""
    from jblast.cli.jax_start import start_jax
    from jblast.missions.plan import check_mission
    from jblast.progress import stages
    from jblast.report.exports.subscribers import check_watchers, watchers

    begin = stages({"starting": 1.0, "flying": 6.0, "recording": 9.0})
    begin("starting")
    shown = {"save": options.save, "mcap": options.mcap}
    shown["serves"] = bool(options.live or options.viewer)
    check_watchers(**shown, force=options.force)  # fails here, before JAX starts
    # Optimised code for a camera: a frame takes a fifth of the time.
    start_jax(quick="camera" not in check_mission(options.scene))
    from jblast.report.exports.rerun import Viewer
    from jblast.report.output import Answer, deliver
    from jblast.report.world import run_view, run_world

    watching = []
    speed = float(options.live) if options.live else None

    def watched(run):
        watching.extend(watchers(run, **shown, speed=speed))
        return watching

    came = run_world(
        options.scene,
        options.out,
        seconds=options.seconds,
        seed=options.seed,
        estimator=options.estimator or "",
        controllers=options.controllers or None,
        detect=options.detect,
        every_frame=options.frames == "all",
        watched=watched,
        force=options.force,
        # run.json has the command, so that the run can be repeated.
        command=options.words,
        begin=begin,
    )
    del begin  # fits have their own progress, a viewer has none
    if options.fit:
        # a process of its own: optimised code for frames takes minutes to compile here
        words = ["report", options.out, "--scene", options.scene, "--fit"]
        words += ["--json"] if options.json else []
        # -P: a file of the working folder must not stand for a module
        program = [sys.executable, "-P", "-m", "jblast", *words]
        done = subprocess.run(program, stdout=subprocess.PIPE, text=True, check=False)
        sys.stdout.write(done.stdout)
        code = done.returncode
    else:
        after = [f"Written: {options.out}"]
        view = run_view(came.document)
        code = deliver(Answer(came.document, view, after=after), options)
    sys.stdout.flush()
    for one in watching:
        if isinstance(one, Viewer):
            one.wait()
    return code
