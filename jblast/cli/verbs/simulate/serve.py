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
import sys
from pathlib import Path

from jblast.cli.arguments.autopilot.options import add_mavlink, check_mavlink
from jblast.cli.arguments.numbers import positive, seed
from jblast.cli.arguments.paths import path


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
    import json
    import math

    from jblast.cli.arguments.serve import served, token_of
    from jblast.report.world import served_document, served_text
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
        document = served_document(answer)
        text = json.dumps(document, indent=2, ensure_ascii=False, allow_nan=False)
        sys.stdout.write(text + "\n")
    else:
        sys.stdout.write(served_text(answer))
    return 0


def _over_mavlink(asked: argparse.Namespace) -> int:
    """Let an autopilot fly, or a ground station watch; return the exit code."""
    from jblast.autopilot.mavlink import dialect

    dialect()  # who has not installed it need not wait for JAX
    from jblast.cli.jax_start import start_jax

    start_jax()
    import json

    from jblast.cli.arguments.autopilot.serving import (
        served_autopilot,
        served_ground_station,
    )
    from jblast.report.autopilot import document, lockstep_text, watched_text

    if asked.mavlink:
        flight = served_autopilot(asked)
        answer, words = document(flight), lockstep_text(flight)
        short = asked.seconds is not None and flight.seconds < asked.seconds - 1e-3
    else:
        watched = served_ground_station(asked)
        answer, words, short = document(watched), watched_text(watched), False
    text = json.dumps(answer, indent=2, ensure_ascii=False, allow_nan=False) + "\n"
    sys.stdout.write(text if asked.json else words)
    return 4 if short else 0
