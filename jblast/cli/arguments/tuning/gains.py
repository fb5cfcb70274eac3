"""`jblast tune --gains`: what is asked, tuned, written and printed."""

import argparse
import sys
from pathlib import Path

from jblast.errors import InputError

OF_GAINS = ("margin_db", "margin_deg", "delay", "motor_lead", "vehicles", "seed")
OF_RECORDS = ("recorded", "sensor", "full_scale", "fps", "start", "background")


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
    from jblast.cli.arguments.paths import writing
    from jblast.report.fit.files import check_directory
    from jblast.report.gain_files import as_json, write_gains
    from jblast.report.gains import gains_answer, gains_text
    from jblast.scene import read_scene
    from jblast.study.gains.records import Wish
    from jblast.study.gains.tune import tune_gains

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
    sys.stdout.write(as_json(answer) if asked.json else gains_text(answer))
    if written and not asked.json:
        sys.stdout.write(f"\nWritten: {asked.out}, {', '.join(written)}\n")
    return tuned.converged
