"""Does a server hold? A hundred clients for ten minutes of the world, and bad ones.

`jblast serve` runs as a process of its own, in lockstep at 100 packets a second, with a
blast every ten seconds or so. A hundred clients take all packets of 600 s, each by
itself: most see and feel the ground, some are sent pressure, sound and force. Each one
checks that packet k comes once, after k - 1 and at k/100 s; that each blast is told
before it happens, by the lead; that what is perceived stands in its own packet. Two of
them are held against the same packets in this process, to the last bit. Meanwhile one
client asks once and never again, one dies half-way, one sends garbage. Before, 1,000
entities take a packet each and leave. The server's memory is read all along.

    python -m calibration.server_soak            # an hour or less, two cores
    python -m calibration.server_soak --seconds 20 --clients 10
"""

import argparse
import asyncio
import hashlib
import json
import multiprocessing
import re
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import grpc

from jblast.files import write_text
from jblast.scene import read_world
from jblast.world import draw_world
from jblast.world.serve import (
    Entity,
    Knot,
    Options,
    Playback,
    ServedWorld,
    connect,
    packets_of,
)
from jblast.world.serve.messages import SERVICE, Request, decoded, encoded

RESULTS = Path(__file__).parent / "results" / "server_soak.txt"
SEED, LEAD_S, RATE_HZ, AHEAD = 7, 5.0, 100.0, 25
PATIENCE_S = 20.0
SCENE = """
[world]
rate_hz = 0.1
region_m = { ring = [20, 400] }
time_s = { uniform = [1, 1e4] }
"""
END: Any = vars(grpc.aio)["EOF"]
"""What is read where a stream is over; types do not know of it."""
KINDS: tuple[tuple[int, list[str], dict[str, Any]], ...] = (
    (60, ["flash", "ground"], {}),
    (25, ["flash", "pressure"], {"samples_hz": 1000.0}),
    (10, ["flash", "force"], {"vehicle": "hummingbird"}),
    (5, ["flash", "ground", "sound"], {"samples_hz": 8000.0}),
)
"""Of a hundred clients so many sense this."""
REGISTRATIONS = 1000


def entity_of(number: int) -> Entity:
    """Return the entity of a client, the kinds mixed."""
    position = [float(number % 10) * 12.0, float(number // 10) * 12.0, 1.5]
    place = number * 37 % 100
    for count, senses, options in KINDS:
        if place < count:
            return Entity(f"client-{number}", senses, [Knot(position)], **options)
        place -= count
    raise AssertionError


async def client(channel: Any, number: int, seconds: float) -> dict:
    """Take all packets of one entity; return what was wrong, and what came."""
    call = channel.stream_stream(f"/{SERVICE}/Stream")()
    await call.write(encoded("Request", Request(entity_of(number))))
    more = encoded("Request", Request(packets=AHEAD))
    came, perceived, told, wrong = 0, 0, {}, []
    digest = hashlib.sha256()
    await call.write(more)
    await call.write(more)
    asked, whole = 2 * AHEAD, round(seconds * RATE_HZ)
    last = False
    while not last:
        data = await call.read()
        if data is END:
            break
        digest.update(data)
        packet = decoded("Packet", data)
        if packet.number != came or packet.time_s != came / RATE_HZ:
            wrong.append(f"packet {packet.number} at {packet.time_s} in place {came}")
        end = (came + 1) / RATE_HZ
        for one in packet.announcements:
            ahead = one.time_s - packet.time_s
            early = came and ahead <= LEAD_S - 1 / RATE_HZ - 1e-9
            if ahead > LEAD_S or early or one.shot in told:
                wrong.append(f"blast {one.shot} told {ahead} s ahead")
            told[one.shot] = one.time_s
        for one in packet.perceived:
            perceived += 1
            if not packet.time_s <= one.time_s < end or one.shot not in told:
                wrong.append(f"{one.sense} of {one.shot} at {one.time_s} in {came}")
        came += 1
        last = packet.last
        if came % AHEAD == 0 and asked < whole:
            await call.write(more)
            asked += AHEAD
    await call.done_writing()
    return {
        "number": number,
        "came": came,
        "missing": round(seconds * RATE_HZ) - came,
        "told": len(told),
        "perceived": perceived,
        "wrong": wrong,
        "digest": digest.hexdigest(),
    }


async def clients(address: str, numbers: range, seconds: float) -> list[dict]:
    """Run clients, some on each connection."""
    options = [("grpc.use_local_subchannel_pool", 1)]
    channels = [grpc.aio.insecure_channel(address, options) for _ in range(10)]
    found = await asyncio.gather(
        *(client(channels[n % 10], n, seconds) for n in numbers)
    )
    for channel in channels:
        await channel.close()
    return found


def run_clients(address: str, count: int, seconds: float, out: Any) -> None:
    """Be the process of the clients."""
    out.put(asyncio.run(clients(address, range(count), seconds)))


def observer(name: str) -> Entity:
    """Return an entity that sees only."""
    return Entity(name, ["flash"], [Knot([20.0, 0.0, 1.0])])


def misbehave(address: str, out: Any) -> None:
    """Be slow, die half-way, send garbage."""
    said = {}
    dies = connect(address)
    stream = dies.stream(observer("dies"))
    stream.ask(50)
    stream.next()
    dies.close()
    with grpc.insecure_channel(address) as channel:
        hello = encoded("Request", Request(observer("garbage")))
        try:
            list(channel.stream_stream(f"/{SERVICE}/Stream")(iter([hello, b"\xff"])))
        except grpc.RpcError as error:
            said["garbage"] = error.code().name
    slow = connect(address)
    stream = slow.stream(observer("slow"))
    stream.ask(1)
    time.sleep(PATIENCE_S + 10.0)
    try:
        while stream.next() is not None:
            pass
    except ValueError as error:
        said["slow"] = str(error)
    slow.close()
    out.put(said)


def register(address: str) -> float:
    """Let a thousand take a packet each and leave; return the duration [s]."""
    begun = time.perf_counter()
    with connect(address) as one:
        for number in range(REGISTRATIONS):
            stream = one.stream(observer(f"r{number}"))
            stream.ask()
            stream.next()
            stream.close()
    return time.perf_counter() - begun


def held_mib(pid: int) -> float:
    """Return the memory that a process holds [MiB]."""
    status = Path(f"/proc/{pid}/status").read_text()
    (found,) = re.findall(r"VmRSS:\s+(\d+) kB", status)
    return int(found) / 1024


def in_process(scene: Path, number: int, seconds: float) -> str:
    """Return the digest of a client's packets, made in this process."""
    drawn, digest = (
        draw_world(*read_world(scene), SEED, until_s=seconds),
        hashlib.sha256(),
    )
    world = ServedWorld(
        drawn, Options(lead_s=LEAD_S, packets_hz=RATE_HZ, ends_s=seconds)
    )
    for packet in packets_of(Playback(entity_of(number), world)):
        digest.update(encoded("Packet", packet))
    return digest.hexdigest()


def soak(count: int, seconds: float) -> list[str]:
    """Do it all; return the lines of the report."""
    from tests.tools.import_time import import_time

    begun = time.perf_counter()
    unit = import_time()
    with tempfile.TemporaryDirectory() as folder:
        scene = Path(folder) / "soak.toml"
        write_text(scene, SCENE)
        command = [sys.executable, "-m", "jblast.cli.main", "serve", str(scene)]
        command += ["--listen", "127.0.0.1:0", "--seconds", f"{seconds:g}", "--json"]
        command += ["--seed", str(SEED), "--lead", f"{LEAD_S:g}"]
        command += ["--patience", f"{PATIENCE_S:g}"]
        server = subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        assert server.stderr is not None
        first = server.stderr.readline()
        (address,) = re.findall(r" on (\S+:\d+),", first)
        registering = register(address)
        context = multiprocessing.get_context("spawn")
        out, bad = context.Queue(), context.Queue()
        flown = context.Process(target=run_clients, args=(address, count, seconds, out))
        worst = context.Process(target=misbehave, args=(address, bad))
        began = time.perf_counter()
        flown.start()
        worst.start()
        memory, found = [], None
        with connect(address) as watcher:
            while found is None:
                try:
                    found = out.get(timeout=5.0)
                except Exception:
                    if not flown.is_alive():
                        raise
                now = watcher.describe().now_s
                memory.append((now, held_mib(server.pid)))
        wall = time.perf_counter() - began
        flown.join()
        said = bad.get(timeout=120.0)
        worst.join()
        memory.append((seconds, held_mib(server.pid)))
        server.send_signal(signal.SIGINT)
        told = json.loads(server.communicate(timeout=60.0)[0])
        compared = [n for n in range(count) if "force" in entity_of(n).senses][:1]
        compared += [n for n in range(count) if "sound" in entity_of(n).senses][:1]
        alike = [in_process(scene, n, seconds) == found[n]["digest"] for n in compared]
    lines = report(
        count, seconds, found, memory, told, said, alike, wall, registering, unit
    )
    return [*lines, f"all of it: {(time.perf_counter() - begun) / unit:,.0f} J"]


def report(
    count: int,
    seconds: float,
    found: list[dict],
    memory: list[tuple[float, float]],
    told: dict,
    said: dict,
    alike: list[bool],
    wall: float,
    registering: float,
    unit: float,
) -> list[str]:
    """Return the lines of the report."""
    wrong = [line for one in found for line in one["wrong"]]
    missing = sum(one["missing"] for one in found)
    came = sum(one["came"] for one in found)
    each = registering / REGISTRATIONS
    lines = [
        "A hundred clients of one server: `python -m calibration.server_soak`",
        f"grpcio {grpc.__version__}; two cores, shared by server and clients",
        "J: how long `import jax` takes",
        "",
        f"clients                          {count}",
        f"seconds of the world             {seconds:g}",
        f"packets that came                {came:,}",
        f"packets missing                  {missing:,}",
        f"repeated, late or out of order   {len(wrong):,}",
        f"blasts told to each              {min(o['told'] for o in found)} to "
        f"{max(o['told'] for o in found)} of {told['blasts']}",
        f"perceptions                      {sum(o['perceived'] for o in found):,}",
        f"streams equal to one process     {sum(alike)} of {len(alike)}, bit by bit",
        f"registrations                    {REGISTRATIONS:,}",
        f"a registration, packet and leave {each / unit:.1e} J",
        f"a packet                         {wall / came / unit:.1e} J",
        f"the world's time over real time  {seconds / wall:.2f}",
        "",
        "dropped, as the server names them:",
        *(f"  {one['entity']}: {one['why']}" for one in told["dropped"]),
        f"and told so: {', '.join(f'{k}: {v}' for k, v in sorted(said.items()))}",
        "",
        "memory of the server",
        "  world s     MiB",
    ]
    step = max(1, len(memory) // 12)
    kept = [*memory[:-1:step], memory[-1]]
    lines += [f"  {time:7.0f} {mib:7.0f}" for time, mib in kept]
    lines += wrong[:20]
    return lines


def main() -> None:
    """Soak, print, and keep what came of the whole."""
    words = argparse.ArgumentParser(description=__doc__)
    words.add_argument("--clients", type=int, default=100)
    words.add_argument("--seconds", type=float, default=600.0)
    asked = words.parse_args()
    from jblast.cli.jax_start import start_jax

    start_jax(quick=True)
    text = "\n".join(soak(asked.clients, asked.seconds)) + "\n"
    print(text)
    if asked.clients >= 100 and asked.seconds >= 600:
        write_text(RESULTS, text)


if __name__ == "__main__":
    main()
