"""Fit a blast to a log of sensor readings: how big, where, when, and how sure."""

import argparse
import sys

HELP = "fit a blast to a log of sensor readings"


def add_arguments(verb: argparse.ArgumentParser) -> None:
    """Say what the verb takes."""
    verb.add_argument("observations", metavar="OBSERVATIONS.csv")
    verb.add_argument(
        "--scene", metavar="SCENE.toml", help="what is known of the scene"
    )
    verb.add_argument(
        "--free",
        metavar="PARAMETER,...",
        default="",
        help="fit these too, with no prior: charge_mass_kg, charge_east_m, "
        "origin_time_s, air_sound_speed_m_s, ...",
    )
    verb.add_argument(
        "--law",
        action="append",
        default=[],
        metavar="auto|NAME|QUANTITY=NAME",
        help="law for all it gives, or for one quantity; may be repeated",
    )
    verb.add_argument(
        "--noise",
        choices=("student", "gaussian"),
        default="student",
        help="distribution of the independent errors (default: student)",
    )
    verb.add_argument(
        "--out", metavar="DIR", help="write fit.json, figures, report.html"
    )
    verb.add_argument("--json", action="store_true", help="print the answer as JSON")
    verb.add_argument(
        "--force", action="store_true", help="overwrite an existing --out"
    )


def run(asked: argparse.Namespace) -> int:
    """Fit, report, and return the exit code."""
    from jblast.cli.start import start_jax

    start_jax()
    import json
    from pathlib import Path

    from jblast.cli.laws import chosen_laws
    from jblast.inference import fit
    from jblast.observations import read
    from jblast.report import check_directory, summary, write_report
    from jblast.scene import default_scene, freed, read_scene, with_laws

    if asked.out:
        check_directory(Path(asked.out), asked.force)
    observations = read(asked.observations)
    uncertain = read_scene(asked.scene) if asked.scene else default_scene()
    uncertain = freed(uncertain, [name for name in asked.free.split(",") if name])
    uncertain = with_laws(uncertain, chosen_laws(asked.law))
    answer = fit(observations, uncertain, noise=asked.noise)
    if asked.json:
        sys.stdout.write(json.dumps(answer.answer, indent=1, allow_nan=False) + "\n")
    out = Path(asked.out) if asked.out else None
    if out:
        write_report(answer, out, force=asked.force)
    if not asked.json:
        sys.stdout.write(summary(answer, out=out) + "\n")
    return answer.exit_code
