"""Options of `jblast serve` for MAVLink: an autopilot, a ground station, their logs."""

import argparse

from jblast.cli.arguments.paths import path
from jblast.errors import InputError

AUTOPILOT_PORT, GROUND_PORT = {"tcp": 4560, "udp": 14560}, {"tcp": 5760, "udp": 14550}
"""The usual ones: of PX4's simulators, and of ground stations."""


def add_mavlink(verb: argparse.ArgumentParser) -> None:
    """Add the options."""
    verb.add_argument(
        "--mavlink",
        nargs="?",
        const="tcp",
        metavar="tcp|udp:HOST:PORT",
        help="let an autopilot fly the scene's vehicle, in lockstep as PX4's "
        "simulators do: by TCP it listens (default: tcp:127.0.0.1:4560), by UDP it "
        "speaks first (14560)",
    )
    verb.add_argument(
        "--ground-station",
        nargs="?",
        const="udp",
        metavar="tcp|udp:HOST:PORT",
        help="show the scene's vehicle to a ground station, which may load a mission "
        "and start it: by UDP it speaks first (default: udp:127.0.0.1:14550), by TCP "
        "it listens (5760)",
    )
    verb.add_argument(
        "--tlog",
        metavar="FILE",
        type=path,
        help="of --mavlink: keep each message that goes or comes",
    )
    verb.add_argument(
        "--ulog",
        metavar="FILE",
        type=path,
        help="of --mavlink: write the flight as a log of PX4",
    )
    verb.add_argument(
        "--force", action="store_true", help="overwrite what the logs' files hold"
    )


def check_mavlink(asked: argparse.Namespace) -> bool:
    """Return whether MAVLink is to be spoken, in place of gRPC.

    Raises:
        InputError: Options are asked for that do not go together.
    """
    both = asked.mavlink and asked.ground_station
    if both:
        raise InputError(
            "--ground-station: expected none beside --mavlink, whose autopilot speaks "
            "to ground stations itself, got one"
        )
    speaks = bool(asked.mavlink or asked.ground_station)
    for option, value in (("--tlog", asked.tlog), ("--ulog", asked.ulog)):
        if value and not asked.mavlink:
            raise InputError(f"{option}: expected --mavlink, whose log it is, got none")
    if speaks:
        for option, value in (
            ("--listen", asked.listen),
            ("--token", asked.token),
            ("--tls-cert", asked.tls_cert),
        ):
            if value:
                raise InputError(
                    f"{option}: expected none over MAVLink, which has no such thing, "
                    f"got {value}"
                )
    return speaks
