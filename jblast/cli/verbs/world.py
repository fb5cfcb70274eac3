"""Simulate a vehicle and all sensors of a scene through random or given blasts.

The scene's [world] gives number, times, positions and masses of random blasts, [charge]
given ones. The vehicle hovers or flies its mission, sensors record, and the camera
films; mounted sensors move with the vehicle. Times are on the clock of the scene, which
begins at 0; only the file and the readings of a sensor are on its own clock. Output:
blasts.csv (the truth), perceived.csv, observations.csv (for `jblast fit`), flight.csv,
sound/, camera/ and run.json.
"""

import argparse
import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from jblast.cli.arguments.numbers import positive, seed
from jblast.cli.arguments.options import (
    add_force,
    add_json,
    names_between_commas,
    path,
)
from jblast.cli.arguments.verb_parser import VerbParser
from jblast.errors import InputError, needed
from jblast.files import refuse_existing

if TYPE_CHECKING:
    from jblast.report.world_viewer import Viewer
    from jblast.study.running import Run, Subscriber


def add_arguments(verb: VerbParser) -> None:
    """Add the arguments of the verb."""
    verb.inputs.add_argument(
        "scene",
        metavar="SCENE.toml",
        type=path,
        help="scene file with [world] or [charge]; parameters with a prior are sampled",
    )
    verb.model.add_argument(
        "--seconds",
        type=positive,
        metavar="S",
        help="duration of the world [s] (default: until 5 s after the arrival of the "
        "last wave, without a vehicle 0.5 s; a mission also until it is disarmed)",
    )
    verb.model.add_argument(
        "--estimator",
        choices=("ekf",),
        help="state estimator of the vehicle, fed by simulated instruments (default: "
        "true state)",
    )
    verb.model.add_argument(
        "--controllers",
        metavar="NAME,...",
        help="controllers of a hovering vehicle, as for `jblast fly`; the first one "
        "flies the recorded flight (default: with_integral,without_integral)",
    )
    verb.model.add_argument(
        "--detect",
        action="store_true",
        help="search of microphones and camera for blasts while they are recorded; "
        "detections.csv has each detection with its latency",
    )
    verb.model.add_argument(
        "--fit",
        action="store_true",
        help="fit of each blast's readings with [world] as the prior, fits.json and "
        "report.html",
    )
    verb.advanced.add_argument(
        "--seed", type=seed, default=0, help="seed of all random numbers (default: 0)"
    )
    verb.outputs.add_argument(
        "--out", metavar="RUN", required=True, type=path, help="folder for the run"
    )
    verb.outputs.add_argument(
        "--live",
        type=positive,
        nargs="?",
        const=1.0,
        metavar="SPEED",
        help="view in a browser while the run is computed, SPEED times as fast as its "
        "clock (default: no view; without a number 1)",
    )
    verb.outputs.add_argument(
        "--viewer",
        choices=("rerun",),
        help="view in a browser as fast as the run is computed",
    )
    verb.outputs.add_argument(
        "--save", metavar="FILE.rrd", type=path, help="recording for the viewer Rerun"
    )
    verb.outputs.add_argument(
        "--mcap",
        metavar="FILE.mcap",
        type=path,
        help="recording as a bag of ROS 2, for Foxglove too",
    )
    add_json(verb)
    add_force(verb)


def run(options: argparse.Namespace) -> int:
    """Run the world, write, print; return the exit code."""
    from jblast.cli.jax_start import start_jax
    from jblast.missions.plan import check_mission
    from jblast.progress import stages

    begin = stages({"starting": 1.0, "flying": 6.0, "recording": 9.0})
    begin("starting")
    check(options)  # fails here, before JAX starts
    # Optimised code for a camera: a frame takes a fifth of the time.
    films = "camera" in check_mission(options.scene)
    start_jax(quick=not films)
    from jblast.report.world import world_answer, world_text
    from jblast.report.world_files import run_world

    viewers: list[Viewer] = []
    controllers = options.controllers and names_between_commas(options.controllers)
    came = run_world(
        options.scene,
        options.out,
        seconds=options.seconds,
        seed=options.seed,
        estimator=options.estimator or "",
        controllers=controllers,
        detect=options.detect,
        watched=lambda run: watchers(options, run, viewers),
        force=options.force,
        # run.json has the command, so that the run can be repeated.
        command=options.words,
        begin=begin,
    )
    del begin  # fits have their own progress, a viewer has none
    fits, code = "", 0
    if options.fit:
        # a process of its own: optimised code for frames takes minutes to compile here
        words = ("report", options.out, "--scene", options.scene, "--fit")
        done = subprocess.run(
            # -P: a file of the working folder must not stand for a module
            [sys.executable, "-P", "-m", "jblast", *map(os.fspath, words)],
            stdout=subprocess.PIPE,
            text=True,
            check=False,
        )
        fits, code = done.stdout, done.returncode
    if options.json:
        sys.stdout.write(world_answer(came).to_json())
    else:
        sys.stdout.write(world_text(came) + fits)
        sys.stdout.write(f"\nWritten: {options.out}\n")
    sys.stdout.flush()
    for viewer in viewers:
        viewer.wait()
    return code


def check(options: argparse.Namespace) -> None:
    """Check before the run what can be refused.

    Raises:
        InputError: A file exists or has another suffix, or an extra is not installed.
    """
    for option, suffix in (("save", ".rrd"), ("mcap", ".mcap")):
        file = getattr(options, option)
        if file and Path(file).suffix != suffix:
            raise InputError(f"--{option}: expected a name in {suffix}, got {file}")
        if file:
            refuse_existing(file, force=options.force)
    # Extras are imported here: a missing one would otherwise be found after the flight.
    if options.live or options.viewer or options.save:
        needed("rerun", "viewer", options.save or "viewer", "a run is shown")
    if options.mcap:
        needed("mcap_ros2", "ros", options.mcap, "a ROS 2 bag is written")


def watchers(
    options: argparse.Namespace, run: "Run", viewers: list["Viewer"]
) -> Sequence["Subscriber"]:
    """Return the requested views of a run; one that serves a browser is added."""
    from jblast.report.ros_bag import RosBag
    from jblast.report.world_viewer import Viewer
    from jblast.study.running import Paced
    from jblast.waves.propagation import sound_speed_of

    found: list[Subscriber] = []
    scene = run.world.scene
    if options.mcap:
        bag = Path(options.mcap)
        found.append(
            RosBag(path=bag, scene=scene, seconds=run.seconds, place=run.place)
        )
    serves = bool(options.live or options.viewer)
    if serves or options.save:
        viewer = Viewer(
            scene=scene,
            sound_speed_m_s=float(sound_speed_of(scene.air)),
            recording_id=f"{Path(options.scene).stem}-{options.seed}",
            save=Path(options.save) if options.save else None,
            live=serves,
        )
        viewers += [viewer] if serves else []
        found.append(viewer)
    if options.live:
        found.append(Paced(options.live))
    return found
