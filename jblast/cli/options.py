"""Options that verbs share; read without JAX, so that --help need not wait for it."""

import argparse

NAMES = (
    "charge_mass_kg, tnt_factor, charge_east_m, charge_north_m, charge_up_m, "
    "charge_range_m, origin_time_s, air_temperature_k, air_pressure_pa, "
    "air_relative_humidity, air_altitude_m, air_sound_speed_m_s, wind_east_m_s, "
    "wind_north_m_s, ground_p_speed_m_s, sedov_gamma, fireball_growth_s"
)
"""The names of `scene.PARAMETERS`."""


def add_free(verb: argparse.ArgumentParser) -> None:
    """Let a verb take `--free`."""
    verb.add_argument(
        "--free",
        metavar="PARAMETER,...",
        default="",
        help=f"these are not known either, and have no prior: some of {NAMES}; of one "
        "of several charges charge_mass_kg.NAME and so on; of a clock "
        "clock_offset_s.NAME",
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
