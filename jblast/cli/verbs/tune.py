"""Tune sensors and media to what was recorded, or a vehicle's gains to blasts.

RECORDED is a sound file (WAV, FLAC, CSV) of a microphone or pressure gauge, a folder
of PNG frames, a video, or a file of events (.h5, .npz, .raw, .aedat4). The blast is
that of the scene; what the scene leaves free, or gives a prior, is looked for beside
what --free names. Exit code 3: the time is looked for, and no blast is heard; 4: the
record does not tell all, or is poorly explained.

With --gains nothing was recorded: the gains by which the scene's vehicle holds its
place are tuned by gradient through blasts drawn from its priors, within margins of
stability, and judged by 200 blasts that they were not tuned by. Exit code 4: the search
did not end.
"""

import argparse
import sys
from pathlib import Path

from jblast.cli.arguments.numbers import number, positive, positive_of_any_size, seed
from jblast.cli.arguments.options import (
    DOUBTFUL,
    NOT_FOUND,
    names_to_free,
    path,
)
from jblast.errors import InputError
from jblast.files import writing

OF_GAINS = ("margin_db", "margin_deg", "delay", "motor_lead", "vehicles", "seed")
OF_RECORDS = ("recorded", "sensor", "full_scale", "fps", "start", "background")


def add_arguments(verb: argparse.ArgumentParser) -> None:
    """Say what the verb takes."""
    verb.add_argument(
        "scene", metavar="SCENE.toml", nargs="?", type=path, help="what is there"
    )
    verb.add_argument(
        "recorded",
        metavar="RECORDED",
        nargs="?",
        type=path,
        help="what one of its sensors, or its camera, recorded",
    )
    verb.add_argument(
        "--free",
        metavar="NAME,...",
        default="",
        help="what to tune; --list tells the names",
    )
    verb.add_argument(
        "--list", action="store_true", help="list what can be tuned, and where it is"
    )
    verb.add_argument(
        "--sensor",
        metavar="NAME",
        help="who recorded (default: whose name the file has, or the only one)",
    )
    verb.add_argument(
        "--full-scale",
        metavar="PA",
        type=positive,
        help="pascals that a sample of 1 stands for (default: 1 of floats, of whole "
        "numbers the sensor's full_scale_pa)",
    )
    verb.add_argument(
        "--fps",
        metavar="HZ",
        type=positive_of_any_size,
        help="frames a second (default: the camera's frames_hz)",
    )
    verb.add_argument(
        "--start",
        metavar="S",
        type=number,
        help="when frame 0 was, or time 0 of events, on the scene's clock (default: "
        "the first explosion, as jblast render begins)",
    )
    verb.add_argument(
        "--background",
        metavar="GREY|R,G,B|FILE.png",
        type=path,
        help="what stands behind the blast: linear light from 0 to 1, or an sRGB image "
        "(default: a grey of 0.18)",
    )
    verb.add_argument(
        "--gains",
        action="store_true",
        help="tune the gains of the vehicle's hold to the scene's blasts",
    )
    verb.add_argument(
        "--margin-db",
        metavar="DB",
        type=positive,
        help="with --gains: least gain margin, up and down (default: 6)",
    )
    verb.add_argument(
        "--margin-deg",
        metavar="DEG",
        type=positive,
        help="with --gains: least phase margin (default: 35)",
    )
    verb.add_argument(
        "--delay",
        metavar="S",
        type=number,
        help="with --gains: of the real loop, that the flights do not have; margins "
        "are kept with it (default: 0)",
    )
    verb.add_argument(
        "--motor-lead",
        metavar="FACTOR",
        type=positive,
        help="with --gains: most by which the hold may shorten the motors' lag, fed "
        "back their speed (default: 1, not at all)",
    )
    verb.add_argument(
        "--vehicles",
        metavar="N",
        type=int,
        help="with --gains: blasts to tune by (default: 32)",
    )
    verb.add_argument(
        "--seed", type=seed, help="with --gains: of the blasts (default: 0)"
    )
    verb.add_argument(
        "--out",
        metavar="DIR",
        type=path,
        help="where to write the tuned scene.toml, tune.json and tune.png",
    )
    verb.add_argument("--json", action="store_true", help="print JSON")
    verb.add_argument(
        "--force", action="store_true", help="overwrite what --out holds of these files"
    )


def run(asked: argparse.Namespace) -> int:
    """Read, tune, write, print; return the exit code."""
    if asked.list:
        from jblast.report.tune import list_text

        sys.stdout.write(list_text())
        return 0
    refuse_of_other_kind(asked)
    if asked.gains:
        return DOUBTFUL if not tune_as_asked(asked) else 0
    if asked.scene is None or asked.recorded is None:
        raise InputError(
            "expected a scene and what was recorded: jblast tune SCENE.toml RECORDED "
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

    if asked.out:
        check_directory(asked.out, asked.force)
    begin("tuning")
    try:
        tuned = tune(
            asked.scene,
            asked.recorded,
            names_to_free(asked.free),
            sensor=asked.sensor,
            full_scale=asked.full_scale,
            fps=asked.fps,
            start=asked.start,
            background=asked.background,
        )
    except NothingHeardError as nothing:
        sys.stderr.write(f"jblast: {nothing}\n")
        return NOT_FOUND
    begin("writing")
    written: tuple[str, ...] = ()
    if asked.out:
        from jblast.report.tune_files import write_tuned

        with writing(asked.out):
            written = write_tuned(tuned, Path(asked.out), asked.scene, asked.recorded)
    answer = tune_answer(tuned, asked.scene, asked.recorded, written)
    if asked.json:
        sys.stdout.write(answer.to_json())
    else:
        sys.stdout.write(tune_text(answer))
        if written:
            sys.stdout.write(f"\nWritten: {asked.out}, {', '.join(written)}\n")
    doubtful = (
        not answer.identifiable or not answer.converged or tuned.explained.is_poor
    )
    return DOUBTFUL if doubtful else 0


def refuse_of_other_kind(asked: argparse.Namespace) -> None:
    """Refuse what goes with gains beside a record, and the other way round.

    Raises:
        InputError: Something does not go together.
    """
    wrong = OF_RECORDS if asked.gains else OF_GAINS
    for option in wrong:
        value = getattr(asked, option)
        if value is None:
            continue
        name = option.replace("_", "-")
        if asked.gains:
            name = "RECORDED" if option == "recorded" else f"--{name}"
            raise InputError(
                f"{name}: expected no record with --gains, which is tuned by the "
                f"scene's blasts, got {value!r}"
            )
        raise InputError(f"--{name}: expected it with --gains only, got {value!r}")
    if asked.gains and asked.free:
        raise InputError(
            f"--free: expected it with a record only, got {asked.free!r} with --gains"
        )
    if asked.gains and asked.scene is None:
        raise InputError("expected a scene: jblast tune SCENE.toml --gains")


def tune_as_asked(asked: argparse.Namespace) -> bool:
    """Tune, write and print; return whether the search ended of itself.

    Raises:
        InputError: Something in what is asked cannot be.
    """
    from jblast.cli.jax_start import start_jax
    from jblast.progress import stages

    begin = stages({"starting": 2.0, "tuning": 40.0, "writing": 2.0})
    begin("starting")
    start_jax(quick=True)
    from jblast.report.fit.files import check_directory
    from jblast.report.gain_files import write_gains
    from jblast.report.gains import gains_answer, gains_text
    from jblast.scene import read_scene
    from jblast.study.gains import Wish, tune_gains

    if asked.out:
        check_directory(asked.out, asked.force)
    uncertain = read_scene(asked.scene)
    keys = {"delay": "delay_s"}
    given = {
        keys.get(option, option): value
        for option in OF_GAINS
        if (value := getattr(asked, option)) is not None
    }
    begin("tuning")
    tuned = tune_gains(uncertain, Wish(**given))
    begin("writing")
    written: tuple[str, ...] = ()
    if asked.out:
        with writing(asked.out):
            written = write_gains(tuned, Path(asked.out), asked.scene)
    answer = gains_answer(tuned, asked.scene, written)
    sys.stdout.write(answer.to_json() if asked.json else gains_text(answer))
    if written and not asked.json:
        sys.stdout.write(f"\nWritten: {asked.out}, {', '.join(written)}\n")
    return tuned.converged
