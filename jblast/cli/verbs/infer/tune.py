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
from jblast.cli.arguments.options import names_to_free
from jblast.cli.arguments.paths import path

NOT_FOUND, DOUBTFUL = 3, 4


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
    from jblast.errors import InputError

    if asked.list:
        from jblast.report.tune import list_text

        sys.stdout.write(list_text())
        return 0
    from jblast.cli.arguments.tuning.gains import refuse_of_other_kind, tune_as_asked

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
    from jblast.cli.arguments.tuning.asked import tuned_as_asked
    from jblast.inference.tuning import NothingHeardError
    from jblast.report.fit.files import check_directory
    from jblast.report.tune import as_json, tune_answer, tune_text

    if asked.out:
        check_directory(asked.out, asked.force)
    begin("tuning")
    try:
        tuned = tuned_as_asked(asked, names_to_free(asked.free))
    except NothingHeardError as nothing:
        sys.stderr.write(f"jblast: {nothing}\n")
        return NOT_FOUND
    begin("writing")
    written: tuple[str, ...] = ()
    if asked.out:
        from jblast.cli.arguments.paths import writing
        from jblast.report.tune_files import write_tuned

        with writing(asked.out):
            written = write_tuned(tuned, Path(asked.out), asked.scene, asked.recorded)
    answer = tune_answer(tuned, asked.scene, asked.recorded, written)
    if asked.json:
        sys.stdout.write(as_json(answer))
    else:
        sys.stdout.write(tune_text(answer))
        if written:
            sys.stdout.write(f"\nWritten: {asked.out}, {', '.join(written)}\n")
    doubtful = (
        not answer.identifiable or not answer.converged or tuned.explained.is_poor
    )
    return DOUBTFUL if doubtful else 0
