"""Logs of a flight as autopilots and ground stations keep them."""

import argparse
from typing import TYPE_CHECKING

from jblast.cli.arguments.paths import path, refuse_existing
from jblast.errors import InputError

if TYPE_CHECKING:
    from jblast.autopilot.logs import FlightRecord


def add_logs(verb: argparse.ArgumentParser) -> None:
    """Add the options."""
    verb.add_argument(
        "--tlog",
        metavar="FILE",
        type=path,
        help="also write the flight's telemetry, as a ground station keeps it",
    )
    verb.add_argument(
        "--ulog",
        metavar="FILE",
        type=path,
        help="also write the flight as a log of PX4",
    )


def check_logs(asked: argparse.Namespace) -> None:
    """Refuse logs that cannot be.

    Raises:
        InputError: Several vehicles are flown, or a file is there already.
    """
    for option, file in (("--tlog", asked.tlog), ("--ulog", asked.ulog)):
        if file and asked.vehicles != 1:
            raise InputError(
                f"{option}: expected one vehicle, whose log it is, got {asked.vehicles}"
            )
        if file:
            refuse_existing(file, force=asked.force)


def write_logs(
    asked: argparse.Namespace, record: "FlightRecord", *, has_mission: bool
) -> None:
    """Write the logs that are asked for."""
    from jblast.autopilot.ground_station import telemetry_log
    from jblast.autopilot.logs import flight_ulog
    from jblast.files import write_bytes

    if asked.tlog:
        write_bytes(asked.tlog, telemetry_log(record, has_mission=has_mission))
    if asked.ulog:
        write_bytes(asked.ulog, flight_ulog(record))
