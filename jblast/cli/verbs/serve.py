"""Serve a world of random blasts to other simulators over gRPC, or to an autopilot.

A client that registers receives a forecast of each blast with its arrivals, pulse,
force and sound, and the simulated signals packet by packet; docs/howto/serve.md
describes the protocol. Time advances as each client requests packets (lockstep), or
with --speed by the wall clock. The server runs until it is interrupted, and then prints
what it sent and which clients it disconnected.

With --mavlink an autopilot such as PX4 flies the scene's vehicle through the blasts.
With --ground-station a ground station displays the vehicle, loads a mission and starts
it (docs/howto/autopilot.md).
"""

import argparse
import contextlib
import gc
import signal
import sys
from typing import TYPE_CHECKING

from jblast.cli.arguments.numbers import positive, seed
from jblast.cli.arguments.options import DOUBTFUL, add_force, add_json, given, path
from jblast.cli.arguments.verb_parser import VerbParser
from jblast.errors import InputError, argument
from jblast.files import refuse_existing
from jblast.progress import serve_line

if TYPE_CHECKING:
    from jblast.report.world import ServedAnswer
    from jblast.world import DrawnWorld
    from jblast.world.remote.serving import Options

UNUSED = {
    "mavlink": ("listen", "rate", "lead", "speed"),
    "ground_station": ("listen", "rate", "lead", "patience", "tlog"),
    "listen": ("tlog",),
}
"""Options that a server does not use, by the option that selects it."""
GARBAGE_THRESHOLDS = (700, 10, 10)
"""Python's default thresholds of garbage collection, restored for the server.

Under the threshold of `start_jax` a server that runs for days would collect rarely, and
its memory would grow.
"""


def add_arguments(verb: VerbParser) -> None:
    """Add the arguments of the verb."""
    verb.set_defaults(progress=False)  # the server prints its own state
    verb.inputs.add_argument(
        "scene",
        metavar="SCENE.toml",
        type=path,
        help="scene file with air, ground and blasts, sampled from [world] or stated "
        "in [charge]; parameters with a prior are sampled",
    )
    verb.model.add_argument(
        "--listen",
        metavar="HOST:PORT",
        help="address of the server; port 0 is any free port (default: "
        "127.0.0.1:50551)",
    )
    verb.model.add_argument(
        "--mavlink",
        nargs="?",
        const="tcp",
        metavar="tcp|udp:HOST:PORT",
        help="address for an autopilot that flies the scene's vehicle in lockstep, as "
        "in PX4's simulators: by TCP jblast listens (default: tcp:127.0.0.1:4560), by "
        "UDP it sends first (14560)",
    )
    verb.model.add_argument(
        "--ground-station",
        nargs="?",
        const="udp",
        metavar="tcp|udp:HOST:PORT",
        help="address for a ground station (QGroundControl, MAVSDK) that displays and "
        "flies the scene's vehicle, and may load a mission: by UDP jblast sends first "
        "(default: udp:127.0.0.1:14550), by TCP it listens (5760)",
    )
    verb.model.add_argument(
        "--seconds",
        type=positive,
        metavar="S",
        help="duration of the world [s] (default: unlimited)",
    )
    verb.model.add_argument(
        "--speed",
        type=positive,
        metavar="X",
        help="world seconds per second of the wall clock (default: lockstep with the "
        "clients)",
    )
    verb.advanced.add_argument(
        "--rate",
        type=positive,
        metavar="HZ",
        help="packets per second of world time [Hz], 1 to 1000 (default: 100)",
    )
    verb.advanced.add_argument(
        "--lead",
        type=positive,
        metavar="S",
        help="lead time of the forecast of a blast [s] (default: 5)",
    )
    verb.advanced.add_argument(
        "--patience",
        type=positive,
        metavar="S",
        help="longest wait for a client before it is disconnected [s] (default: 60)",
    )
    verb.advanced.add_argument(
        "--seed", type=seed, default=0, help="seed of all random numbers (default: 0)"
    )
    verb.outputs.add_argument(
        "--tlog",
        metavar="FILE",
        type=path,
        help="with --mavlink: log of all messages",
    )
    add_json(verb, "summary at the end as JSON, instead of text")
    add_force(verb, "an existing log")


def run(options: argparse.Namespace) -> int:
    """Serve until interrupted; return the exit code."""
    if check_mavlink(options):
        return _over_mavlink(options)
    import os

    from jblast.world.remote.messages import grpc

    # the server prints each disconnected client itself; gRPC's own lines repeat it
    os.environ.setdefault("GRPC_VERBOSITY", "NONE")
    grpc()  # fails here, before JAX starts, if gRPC is not installed
    from jblast.cli.jax_start import start_jax

    start_jax(quick=True)
    from jblast.report.world import served_text
    from jblast.scene import read_scene_or_world
    from jblast.world import draw_world
    from jblast.world.remote.serving import Options, checked_address

    settings = Options(
        **given(
            options,
            listen="address",
            rate="packets_hz",
            lead="lead_s",
            speed="speed",
            seconds="ends_s",
            patience="patience_s",
        )
    )
    # An address beyond this machine is refused before any work.
    checked_address(settings)
    uncertain, spec = read_scene_or_world(options.scene)
    world = draw_world(uncertain, spec, options.seed, until_s=settings.ends_s)
    answer = served(world, settings)
    if options.json:
        sys.stdout.write(answer.to_json())
    else:
        sys.stdout.write(served_text(answer))
    return 0


def _over_mavlink(options: argparse.Namespace) -> int:
    """Serve an autopilot or a ground station; return the exit code."""
    from jblast.autopilot.mavlink import dialect

    dialect()  # fails here, before JAX starts, if pymavlink is not installed
    from jblast.cli.jax_start import start_jax
    from jblast.missions.plan import check_mission

    if options.ground_station:
        check_mission(options.scene)
    if options.tlog:
        refuse_existing(options.tlog, force=options.force)
    # Optimised code: the step of the vehicle has to keep up with the autopilot.
    start_jax()
    from jblast.report.autopilot import lockstep_text, watched_text
    from jblast.study.mavlink_servers import serve_autopilot, serve_ground_station

    common = {
        "seconds": options.seconds,
        "seed": options.seed,
        "report": serve_line,
        **given(options, speed="speed", patience="patience_s", tlog="log"),
    }
    if options.mavlink:
        answer = serve_autopilot(options.scene, options.mavlink, **common)
        words = lockstep_text(answer)
        # A millisecond of tolerance: the time is a sum of periods in floating point.
        short = options.seconds is not None and answer.seconds < options.seconds - 1e-3
    else:
        answer = serve_ground_station(options.scene, options.ground_station, **common)
        words, short = watched_text(answer), False
    sys.stdout.write(answer.to_json() if options.json else words)
    return DOUBTFUL if short else 0


def served(world: "DrawnWorld", settings: "Options") -> "ServedAnswer":
    """Serve until SIGINT or SIGTERM, and return the summary.

    Raises:
        InputError: As in `listening`.
    """
    import asyncio

    return asyncio.run(_served(world, settings))


async def _served(world: "DrawnWorld", settings: "Options") -> "ServedAnswer":
    import asyncio

    from jblast.report.world import served_answer, serving_line
    from jblast.world.remote.serving import listening

    # `start_jax` all but stops collection, which suits short commands only
    # Objects of the imports live to the end: they need not be visited again.
    gc.freeze()
    gc.set_threshold(*GARBAGE_THRESHOLDS)
    over = asyncio.Event()
    loop = asyncio.get_running_loop()
    # An event instead of an exception: the server closes and the summary is printed.
    for number in (signal.SIGINT, signal.SIGTERM):
        # The event loops of Windows have no handlers of signals.
        with contextlib.suppress(NotImplementedError, ValueError):
            loop.add_signal_handler(number, over.set)
    async with listening(world, settings, serve_line) as server:
        serve_line(serving_line(world, server.address, settings))
        await over.wait()
    return served_answer(server)


def check_mavlink(options: argparse.Namespace) -> bool:
    """Return whether to serve MAVLink, in place of gRPC.

    Raises:
        InputError: The options contradict one another.
    """
    if options.mavlink and options.ground_station:
        raise InputError(
            "--ground-station: expected --ground-station or --mavlink, got both; the "
            "autopilot itself connects to ground stations"
        )
    server = next((x for x in UNUSED if getattr(options, x)), "listen")
    for option in UNUSED[server]:
        if (value := getattr(options, option)) is not None:
            raise InputError(
                f"--{option}: expected no such option with a server over "
                f"{'gRPC' if server == 'listen' else argument(server)}, which does not "
                f"use it, got {value}"
            )
    return server != "listen"
