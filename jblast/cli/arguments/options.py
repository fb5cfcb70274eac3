"""Options that verbs share; read without JAX, so that --help need not wait for it."""

import argparse
from typing import TYPE_CHECKING

from jblast.parameter_table import PARAMETERS

if TYPE_CHECKING:
    from jblast.errors import InputError


def add_free(verb: argparse.ArgumentParser) -> None:
    """Let a verb take `--free`."""
    verb.add_argument(
        "--free",
        metavar="PARAMETER,...",
        default="",
        help="these are not known either, and have no prior: some of "
        f"{', '.join(PARAMETERS)}; of one of several charges charge_mass_kg.NAME and "
        "so on; of a clock clock_offset_s.NAME",
    )


def names_to_free(words: str) -> list[str]:
    """Return the names after `--free`, which stand between commas."""
    return [name.strip() for name in words.split(",") if name.strip()]


def add_law(verb: argparse.ArgumentParser) -> None:
    """Let a verb take `--law` (`laws.chosen_laws` reads it)."""
    verb.add_argument(
        "--law",
        action="append",
        default=[],
        metavar="auto|NAME|QUANTITY=NAME",
        help="law for all it gives, or for one quantity; may be repeated",
    )


def add_noise(verb: argparse.ArgumentParser) -> None:
    """Let a verb take `--noise`."""
    verb.add_argument(
        "--noise",
        choices=("student", "gaussian"),
        default="student",
        help="distribution of the independent errors (default: student)",
    )


OTHERWISE = {
    "freed": "--free",
    "states": "--state",
    "inputs": "--input",
    "mass_kg": "--charge",
    "range_m": "--range",
    "rate_hz": "sampling rate",
    "address": "--listen",
    "packets_hz": "--rate",
    "lead_s": "--lead",
    "patience_s": "--patience",
    "ends_s": "--seconds",
    "certificate": "--tls-cert",
    "recording": "RECORDING.wav",
    "false_alarms_per_hour": "--false-alarms",
    "moment_point_m": "moment_point_m (--profile-moments-about X,Y,Z)",
}
"""Arguments of Python whose options have another name."""


def option_for(argument: str) -> str:
    """Return how the command line calls an argument that a message names."""
    return OTHERWISE.get(argument, f"--{argument.replace('_', '-')}")


def in_options(error: "InputError") -> "InputError":
    """Return an error in the words of the command line."""
    from jblast.errors import InputError

    return InputError(error.worded(option_for))
