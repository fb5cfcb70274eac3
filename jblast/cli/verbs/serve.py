"""Let other simulators take part in a world of random blasts, over gRPC.

With --mavlink an autopilot, as PX4, flies the scene's vehicle through its blasts; with
--ground-station one of these watches it, loads its mission and starts it
(docs/howto/autopilot.md).

Whoever registers is told of each blast ahead of time, with its own arrivals, pulse,
force and sound, and is sent what comes to it packet by packet; docs/howto/serve.md says
how a client talks to it. Time goes on as each client asks for packets (lockstep), or
with --speed by the wall clock. It serves until it is interrupted, then says what it
sent and whom it dropped.
"""

import argparse
import contextlib
import gc
import signal
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from jblast.cli.arguments.numbers import positive, seed
from jblast.cli.arguments.options import DOUBTFUL, path
from jblast.cli.progress_line import serve_line
from jblast.errors import InputError, read_text

if TYPE_CHECKING:
    from jblast.report.world import ServedAnswer
    from jblast.world import DrawnWorld
    from jblast.world.remote.serving import Options

USUAL = (700, 10, 10)
"""How often Python collects by itself."""


def add_arguments(verb: argparse.ArgumentParser) -> None:
    """Say what the verb takes."""
    verb.set_defaults(progress=False)  # it says itself where it is
    verb.add_argument(
        "scene",
        metavar="SCENE.toml",
        type=path,
        help="air, ground and blasts: [world] draws them, [charge] gives them; numbers "
        "with a prior are drawn",
    )
    verb.add_argument(
        "--listen",
        metavar="HOST:PORT",
        help="where to; a port of 0 is any free one (default: 127.0.0.1:50551)",
    )
    verb.add_argument(
        "--rate",
        type=positive,
        metavar="HZ",
        default=100.0,
        help="packets a second of the world's time, 1 to 1000 (default: 100)",
    )
    verb.add_argument(
        "--speed",
        type=positive,
        metavar="X",
        help="go by the wall clock, at so many seconds of the world a second (default: "
        "lockstep: as each client asks)",
    )
    verb.add_argument(
        "--lead",
        type=positive,
        metavar="S",
        default=5.0,
        help="tell of blasts so long before they happen [s] (default: 5)",
    )
    verb.add_argument(
        "--seconds",
        type=positive,
        metavar="S",
        help="when the world ends [s] (default: never)",
    )
    verb.add_argument(
        "--patience",
        type=positive,
        metavar="S",
        default=60.0,
        help="drop a client that keeps the server waiting for so long [s] (default: "
        "60)",
    )
    verb.add_argument(
        "--token",
        default="",
        help="that each client has to show; @FILE reads it from a file",
    )
    verb.add_argument(
        "--tls-cert", metavar="FILE.pem", type=path, help="certificate, for TLS"
    )
    verb.add_argument(
        "--tls-key", metavar="FILE.pem", type=path, help="its private key"
    )
    add_mavlink(verb)
    verb.add_argument(
        "--seed", type=seed, default=0, help="of all that is drawn (default: 0)"
    )
    verb.add_argument(
        "--json", action="store_true", help="print JSON when it has been stopped"
    )


def run(asked: argparse.Namespace) -> int:
    """Serve until interrupted; return the exit code."""
    if check_mavlink(asked):
        return _over_mavlink(asked)
    import os

    from jblast.world.remote.messages import grpc

    # whom it drops the server says itself, and more plainly
    os.environ.setdefault("GRPC_VERBOSITY", "NONE")
    grpc()  # who has not installed it need not wait for JAX
    from jblast.cli.jax_start import start_jax

    start_jax(quick=True)
    import math

    from jblast.report.world import served_text
    from jblast.scene import read_scene_or_world
    from jblast.world import draw_world
    from jblast.world.remote.serving import ADDRESS, Options, checked_address

    options = Options(
        address=asked.listen or ADDRESS,
        packets_hz=asked.rate,
        lead_s=asked.lead,
        speed=asked.speed,
        ends_s=math.inf if asked.seconds is None else asked.seconds,
        patience_s=asked.patience,
        token=token_of(asked.token),
        certificate=None if asked.tls_cert is None else Path(asked.tls_cert),
        key=None if asked.tls_key is None else Path(asked.tls_key),
    )
    checked_address(options)
    uncertain, spec = read_scene_or_world(asked.scene)
    world = draw_world(uncertain, spec, asked.seed, until_s=options.ends_s)
    answer = served(world, options)
    if asked.json:
        sys.stdout.write(answer.to_json())
    else:
        sys.stdout.write(served_text(answer))
    return 0


def _over_mavlink(asked: argparse.Namespace) -> int:
    """Let an autopilot fly, or a ground station watch; return the exit code."""
    from jblast.autopilot.mavlink import dialect

    dialect()  # who has not installed it need not wait for JAX
    from jblast.cli.jax_start import start_jax

    start_jax()
    from jblast.cli.arguments.mavlink import (
        served_autopilot,
        served_ground_station,
    )
    from jblast.report.autopilot import lockstep_text, watched_text

    if asked.mavlink:
        answer = served_autopilot(asked)
        words = lockstep_text(answer)
        short = asked.seconds is not None and answer.seconds < asked.seconds - 1e-3
    else:
        answer = served_ground_station(asked)
        words, short = watched_text(answer), False
    sys.stdout.write(answer.to_json() if asked.json else words)
    return DOUBTFUL if short else 0


def served(world: "DrawnWorld", options: "Options") -> "ServedAnswer":
    """Serve until SIGINT or SIGTERM comes; return what came of it.

    Raises:
        InputError: As in `listening`.
    """
    import asyncio

    return asyncio.run(_served(world, options))


async def _served(world: "DrawnWorld", options: "Options") -> "ServedAnswer":
    import asyncio

    from jblast.report.world import served_answer, serving_line
    from jblast.world.remote.serving import listening

    # a command that ends soon need not collect (`start_jax`); this one does not end
    gc.freeze()
    gc.set_threshold(*USUAL)
    over = asyncio.Event()
    loop = asyncio.get_running_loop()
    for number in (signal.SIGINT, signal.SIGTERM):
        with contextlib.suppress(NotImplementedError, ValueError):
            loop.add_signal_handler(number, over.set)
    async with listening(world, options, serve_line) as server:
        serve_line(serving_line(world, server.address, options))
        await over.wait()
    return served_answer(server)


def token_of(said: str) -> str:
    """Return the token that was said, or that a file holds.

    Raises:
        InputError: The file cannot be read, or the token has a blank in it.
    """
    if said.startswith("@"):
        said = read_text(said[1:], "a file with the token").strip()
        if not said:
            raise InputError("--token: expected a file with a word, got an empty one")
    if not (said.isascii() and said.isprintable()) or " " in said:
        raise InputError("--token: expected a word without blanks, of ASCII")
    return said


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
