"""Fit a blast to a log of sensor readings: how big, where, when, and how sure."""

import argparse
import sys

from jblast.cli.files import path, unwritable

HELP = "fit a blast to a log of sensor readings"

FREE = (
    "charge_mass_kg, tnt_factor, charge_east_m, charge_north_m, charge_up_m, "
    "charge_range_m, origin_time_s, air_temperature_k, air_pressure_pa, "
    "air_relative_humidity, air_altitude_m, air_sound_speed_m_s, wind_east_m_s, "
    "wind_north_m_s, ground_p_speed_m_s, sedov_gamma"
)
"""The names of `scene.PARAMETERS`, here so that --help need not wait for JAX."""


def add_arguments(verb: argparse.ArgumentParser) -> None:
    """Say what the verb takes."""
    verb.add_argument(
        "observations",
        metavar="OBSERVATIONS.csv",
        type=path,
        help="one measurement a row: sensor,quantity,value,sigma and where it stood: "
        "east_m,north_m,up_m or range_m",
    )
    verb.add_argument(
        "--scene",
        metavar="SCENE.toml",
        type=path,
        help="what is known of the scene; jblast scene writes one to start from "
        "(default: a surface charge of unknown mass at the origin at time 0)",
    )
    verb.add_argument(
        "--free",
        metavar="PARAMETER,...",
        default="",
        help=f"fit these too, with no prior: some of {FREE}; of one of several "
        "charges charge_mass_kg.NAME and so on; of a clock clock_offset_s.NAME",
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
        "--out",
        metavar="DIR",
        type=path,
        help="write fit.json, figures, report.html",
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
    from jblast.report import check_directory, plain, summary, write_report
    from jblast.scene import default_scene, freed, read_scene, with_laws

    out = Path(asked.out) if asked.out else None
    if out:
        check_directory(out, asked.force)
    observations = read(asked.observations)
    uncertain = read_scene(asked.scene) if asked.scene else default_scene()
    free = [name.strip() for name in asked.free.split(",") if name.strip()]
    uncertain = freed(uncertain, free)
    laws = chosen_laws(asked.law, observations.quantity)
    uncertain = with_laws(uncertain, laws)
    answer = fit(observations, uncertain, noise=asked.noise)
    if asked.json:
        text = json.dumps(plain(answer.answer), indent=1, allow_nan=False)
        sys.stdout.write(text + "\n")
    if out:
        try:
            write_report(answer, out, force=asked.force)
        except OSError as error:
            raise unwritable(out, error) from None
    if not asked.json:
        sys.stdout.write(summary(answer, out=out) + "\n")
    return answer.exit_code
