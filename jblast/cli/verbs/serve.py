"""Serve a world of random blasts to other simulators over gRPC, or to an autopilot.

A client that opens a stream receives a forecast of each blast with its arrivals and
pulse, and force and sound packet by packet; docs/howto/serve.md describes the protocol.
Time advances as each client requests packets (lockstep), or with --speed by the wall
clock. The server runs until it is interrupted, and then prints what it sent and which
clients it disconnected.

With --mavlink an autopilot such as PX4 flies the scene's vehicle through the blasts.
With --ground-station a ground station displays the vehicle, loads a mission and starts
it (docs/howto/autopilot.md).

example:
  jblast serve world.toml --seed 3 --seconds 4

input:
  SCENE.toml            path; scene file with air, ground and blasts, sampled from
      [world] or stated in [charge]; parameters with a prior are sampled
model:
  --listen HOST:PORT    text; address of the server; port 0 is any free port (default:
      127.0.0.1:50551)
  --mavlink tcp|udp:HOST:PORT  text ? tcp; address for an autopilot that flies the
      scene's vehicle in lockstep, as in PX4's simulators: by TCP jblast listens
      (default: tcp:127.0.0.1:4560), by UDP it sends first (14560)
  --ground-station tcp|udp:HOST:PORT  text ? udp; address for a ground station
      (QGroundControl, MAVSDK) that displays and flies the scene's vehicle, and may load
      a mission: by UDP jblast sends first (default: udp:127.0.0.1:14550), by TCP it
      listens (5760)
  --seconds S           positive; duration of the world [s] (default: unlimited)
  --speed X             positive; world seconds per second of the wall clock (default:
      lockstep with the clients)
output:
  --tlog FILE           path; with --mavlink: log of all messages
  --json                summary at the end as JSON, instead of text
  --force               permission to overwrite an existing log
advanced:
  --rate HZ             positive; packets per second of world time [Hz], 1 to 1000
      (default: 100)
  --lead S              positive; lead time of the forecast of a blast [s] (default: 5)
  --patience S          positive; longest wait for a client before it is disconnected
      [s] (default: 60)
  --seed N              seed = 0; seed of all random numbers
"""

import argparse

from jblast.cli.options import given, refuse_unused
from jblast.errors import argument
from jblast.files import refuse_existing
from jblast.progress import serve_line

PROGRESS = False
"""The server prints its own state."""
UNUSED = {
    "mavlink": ("ground_station", "listen", "rate", "lead", "speed"),
    "ground_station": ("listen", "rate", "lead", "patience", "tlog"),
    "listen": ("tlog",),
}
"""Options that a server does not use, by the option that selects it."""
ARGUMENTS = {
    "listen": "address",
    "rate": "packets_hz",
    "lead": "lead_s",
    "speed": "speed",
    "patience": "patience_s",
    "tlog": "log",
}
"""The server's arguments, by option."""


def run(options: argparse.Namespace) -> int:
    """Serve until interrupted; return the exit code."""
    from jblast.cli.jax_start import start_jax

    server = next((one for one in UNUSED if getattr(options, one)), "listen")
    over = "gRPC" if server == "listen" else argument(server)
    refuse_unused(options, UNUSED[server], f"no such option with a server over {over}")
    if server == "ground_station":
        from jblast.missions.plan import check_mission

        check_mission(options.scene)
    if options.tlog:
        refuse_existing(options.tlog, force=options.force)
    # over MAVLink the step of the vehicle has to keep up with the autopilot
    start_jax(quick=server == "listen")
    from jblast.report.flights import served
    from jblast.report.output import deliver

    taken = given(options, **ARGUMENTS)
    if server != "listen":
        taken["address"] = getattr(options, server)
    answer = served(
        server,
        options.scene,
        seconds=options.seconds,
        seed=options.seed,
        report=serve_line,
        **taken,
    )
    return deliver(answer, options)
