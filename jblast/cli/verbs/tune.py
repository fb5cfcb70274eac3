"""Estimate sensor and medium parameters from a recording, or tune a vehicle's gains.

RECORDED is a sound file (WAV, FLAC, CSV) of a microphone or pressure gauge, a folder
of PNG frames, a video, or a file of camera events (.h5, .npz, .raw, .aedat4,
.dat). The blast is that of the scene. Parameters that the scene leaves free, or gives a
prior, are estimated together with those of --free. Exit code 3: the origin time is
free, and no blast is detected. Exit code 4: a parameter is not identifiable, the fit
did not converge, or the residuals are large.

--gains needs no recording. It tunes the gains of the vehicle's position controller by
gradient on blasts sampled from the scene's priors, within stability margins, and tests
them on 200 other blasts. Exit code 4: the search did not converge.
"""

import argparse
import sys
from pathlib import Path

from jblast.cli.arguments.numbers import number, positive, positive_of_any_size, seed
from jblast.cli.arguments.options import (
    DOUBTFUL,
    NOT_FOUND,
    add_force,
    add_json,
    names_between_commas,
    path,
)
from jblast.cli.arguments.verb_parser import VerbParser
from jblast.errors import InputError
from jblast.files import writing

# options of one kind of tuning: the other kind rejects them
OF_GAINS = ("margin_db", "margin_deg", "delay", "vehicles", "seed")
OF_RECORDS = ("recorded", "sensor", "full_scale", "fps", "start", "background")


def add_arguments(verb: VerbParser) -> None:
    """Add the arguments of the verb."""
    verb.inputs.add_argument(
        "scene", metavar="SCENE.toml", nargs="?", type=path, help="scene file"
    )
    verb.inputs.add_argument(
        "recorded",
        metavar="RECORDED",
        nargs="?",
        type=path,
        help="recording of one of its sensors, or of its camera",
    )
    verb.inputs.add_argument(
        "--sensor",
        metavar="NAME",
        help="sensor of the recording (default: the one that the file is named after, "
        "or the only one)",
    )
    verb.inputs.add_argument(
        "--full-scale",
        metavar="PA",
        type=positive,
        help="pressure of a sample of 1 [Pa] (default: 1 for floats, the sensor's "
        "full_scale_pa for integers)",
    )
    verb.inputs.add_argument(
        "--fps",
        metavar="HZ",
        type=positive_of_any_size,
        help="frame rate [Hz] (default: the camera's frames_hz)",
    )
    verb.inputs.add_argument(
        "--start",
        metavar="S",
        type=number,
        help="time of frame 0, or of time 0 of camera events, on the scene's clock [s] "
        "(default: the first explosion, as in jblast render)",
    )
    verb.inputs.add_argument(
        "--background",
        metavar="GREY|R,G,B|FILE.png",
        type=path,
        help="background of the film: linear light from 0 to 1, or an sRGB image "
        "(default: a grey of 0.18)",
    )
    verb.model.add_argument(
        "--free",
        metavar="NAME,...",
        default="",
        help="parameters to estimate; --list prints their names",
    )
    verb.model.add_argument(
        "--gains",
        action="store_true",
        help="tuning of the vehicle's position controller to the scene's blasts",
    )
    verb.advanced.add_argument(
        "--margin-db",
        metavar="DB",
        type=positive,
        help="with --gains: minimum gain margin, up and down [dB] (default: 6)",
    )
    verb.advanced.add_argument(
        "--margin-deg",
        metavar="DEG",
        type=positive,
        help="with --gains: minimum phase margin [deg] (default: 35)",
    )
    verb.advanced.add_argument(
        "--delay",
        metavar="S",
        type=number,
        help="with --gains: additional loop delay [s], included in the stability "
        "margins but not in the flights (default: 0)",
    )
    verb.advanced.add_argument(
        "--vehicles",
        metavar="N",
        type=int,
        help="with --gains: number of blasts to tune on (default: 32)",
    )
    verb.advanced.add_argument(
        "--seed", type=seed, help="with --gains: seed of the blasts (default: 0)"
    )
    verb.outputs.add_argument(
        "--out",
        metavar="DIR",
        type=path,
        help="folder for the tuned scene.toml, tune.json and tune.png",
    )
    verb.outputs.add_argument(
        "--list",
        action="store_true",
        help="list of the parameters that can be tuned, and of their keys in a scene",
    )
    add_json(verb)
    add_force(verb)


def run(options: argparse.Namespace) -> int:
    """Read, tune, write, print; return the exit code."""
    if options.list:
        from jblast.report.tune import list_text

        sys.stdout.write(list_text())
        return 0
    # Before JAX starts, as these mistakes depend on the options alone.
    check_kind(options)
    if options.gains:
        return 0 if tune_gains_of(options) else DOUBTFUL
    if options.scene is None or options.recorded is None:
        raise InputError(
            "expected a scene and a recording: jblast tune SCENE.toml RECORDED "
            "--free NAME,...; or SCENE.toml --gains; or --list"
        )
    from jblast.cli.jax_start import start_jax
    from jblast.progress import stages

    begin = stages({"starting": 2.0, "tuning": 8.0, "writing": 2.0})
    begin("starting")
    start_jax(quick=True)
    from jblast.inference.tuning import NothingHeardError
    from jblast.inference.tuning.tune_recording import tune
    from jblast.report.fit.files import check_directory
    from jblast.report.tune import tune_answer, tune_text

    if options.out:
        check_directory(options.out, options.force)
    begin("tuning")
    try:
        tuned = tune(
            options.scene,
            options.recorded,
            names_between_commas(options.free),
            sensor=options.sensor,
            full_scale=options.full_scale,
            fps=options.fps,
            start=options.start,
            background=options.background,
        )
    except NothingHeardError as nothing:
        sys.stderr.write(f"jblast: {nothing}\n")
        return NOT_FOUND
    begin("writing")
    written: tuple[str, ...] = ()
    if options.out:
        from jblast.report.tune_files import write_tuned

        with writing(options.out):
            written = write_tuned(
                tuned, Path(options.out), options.scene, options.recorded
            )
    answer = tune_answer(tuned, options.scene, options.recorded, written)
    if options.json:
        sys.stdout.write(answer.to_json())
    else:
        sys.stdout.write(tune_text(answer))
        if written:
            sys.stdout.write(f"\nWritten to {options.out}: {', '.join(written)}\n")
    # A fit may converge with large residuals, for example if the physics differs.
    doubtful = (
        not answer.identifiable or not answer.converged or tuned.explained.is_poor
    )
    return DOUBTFUL if doubtful else 0


def check_kind(options: argparse.Namespace) -> None:
    """Check that no option of a recording is given with gains, and the reverse.

    Raises:
        InputError: The options contradict one another.
    """
    wrong = OF_RECORDS if options.gains else OF_GAINS
    for option in wrong:
        value = getattr(options, option)
        # Defaults are None, so that an option of the wrong kind is found.
        if value is None:
            continue
        name = option.replace("_", "-")
        if options.gains:
            name = "RECORDED" if option == "recorded" else f"--{name}"
            raise InputError(
                f"{name}: expected no recording with --gains, which uses the scene's "
                f"blasts, got {value!r}"
            )
        raise InputError(f"--{name}: expected it with --gains only, got {value!r}")
    if options.gains and options.free:
        raise InputError(
            f"--free: expected it with a recording only, got {options.free!r} with "
            "--gains"
        )
    if options.gains and options.scene is None:
        raise InputError("expected a scene: jblast tune SCENE.toml --gains")


def tune_gains_of(options: argparse.Namespace) -> bool:
    """Tune gains, write and print; return whether the search converged.

    Raises:
        InputError: The scene or an option cannot be used.
    """
    from jblast.cli.jax_start import start_jax
    from jblast.progress import stages

    # The search flies each blast at every step; the other stages take seconds.
    begin = stages({"starting": 2.0, "tuning": 40.0, "writing": 2.0})
    begin("starting")
    start_jax(quick=True)
    from jblast.report.fit.files import check_directory
    from jblast.report.gain_files import write_gains
    from jblast.report.gains import gains_answer, gains_text
    from jblast.scene import read_scene
    from jblast.study.gains import TuningSettings, tune_gains

    if options.out:
        check_directory(options.out, options.force)
    uncertain = read_scene(options.scene)
    # The other options have the names of the fields.
    keys = {"delay": "delay_s"}
    given = {
        keys.get(option, option): value
        for option in OF_GAINS
        if (value := getattr(options, option)) is not None
    }
    begin("tuning")
    tuned = tune_gains(uncertain, TuningSettings(**given))
    begin("writing")
    written: tuple[str, ...] = ()
    if options.out:
        with writing(options.out):
            written = write_gains(tuned, Path(options.out), options.scene)
    answer = gains_answer(tuned, options.scene, written)
    sys.stdout.write(answer.to_json() if options.json else gains_text(answer))
    if written and not options.json:
        sys.stdout.write(f"\nWritten to {options.out}: {', '.join(written)}\n")
    return tuned.converged
