"""Samples a second of studies, and what the engine adds to what it runs.

    python -m calibration.benchmark_study [air|flights|fits ...] [--seconds N]

On a GPU by the wall clock; on a CPU by processor time over the number of cores, which
is the wall clock of an idle machine, and tells alike beside others. The best of a few.

The engine's share: the programs of a tile are called again as they were, on what they
were given, all of it on the devices already, nothing copied back, one wait at the end.
What the tile takes beyond that is the engine's: to count, to hand out, to fetch, to
merge, to write. Both in this run, by the same lanes.

Air: mass and range of a charge are drawn, Kingery and Bulmash's laws give arrival and
peak pressure at 16 sensors, or at one; draws and statistics (mean, standard deviation,
quantiles) included, nothing else kept: `keep = "summary"`. An evaluation is both at one
sensor. Of two devices of a GPU machine: the same samples for each as for one.

Flights: vehicle-seconds a second of the outcome `flies_on`, against the same flights by
`simulate` alone (a blast of its own for each, the hold asked at every step, as many
rows stored, over ground), and against `benchmarks flights`, whose hold is asked
every 4 ms and whose last row alone is stored; all at the same step and in the same
precision: float64 on a CPU, float32 on a GPU.

Fits: logs a second of the outcome `fit_error`, against `fit_many` of readings that lie
on the host, its answer copied back, and the draws of the readings alone.

The table of a CPU goes to calibration/results/benchmark_study.txt, that of a GPU to
benchmark_study_gpu.txt, as each part is done.
"""

import argparse
import contextlib
import os
import tempfile
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from calibration import benchmarks
from jblast.files import write_text
from jblast.inference import fit_many
from jblast.scene import Charge, Scene
from jblast.sensors import planned_layout
from jblast.study import Study, read_study
from jblast.study.engine.launch import Launcher, mesh_of
from jblast.study.engine.summary import SummaryStore
from jblast.study.engine.tiles import calculated
from jblast.study.flights import BATCH_ROWS
from jblast.study.outcome.fit import AGAIN_Z
from jblast.study.sampling.work import Reduced, Work
from jblast.vehicle import PositionHold, blast_load, named, named_gains, simulate

REPEATS = 2


AIR = """
[charge]
mass_kg = { lognormal = [10.0, 2.0] }
position_m = [{ normal = [0.0, 1.0] }, 0.0, 0.0]
[law]
scatter = false
air_arrival_s = "kingery_bulmash"
peak_overpressure_pa = "kingery_bulmash"
"""
HOVER = """
[charge]
mass_kg = { lognormal = [1.0, 1.2] }
position_m = [5.0, 0.0, 0.0]
time_s = 0.5
[vehicle]
model = "crazyflie"
position_m = [0.0, 0.0, 2.0]
"""
PLACES = [(20.0 + 5.0 * n, 3.0 * n, 0.0) for n in range(16)]


AIR_TILES = {"cpu": 1 << 21, "gpu": 1 << 29}
"""Samples of a tile at 16 sensors: about a second."""


FITTED = {"cpu": 1 << 16, "gpu": 1 << 22}


FLOWN = {"cpu": 1 << 7, "gpu": 1 << 16}
STEP_S = 1e-3


RESULTS = Path(__file__).parent / "results"
PARTS = ("air", "flights", "fits")
"""Each may be named on the command line."""


def study_text(
    asked: tuple[str, ...] = PARTS,
    seconds: float = float("inf"),
    kept: Path | None = None,
) -> str:
    """Measure and return the table.

    Args:
        asked: Its parts.
        seconds: No part is begun later than that.
        kept: Where to keep it, as parts are done.
    """
    before = jax.config.read("jax_enable_x64")
    jax.config.update("jax_enable_x64", True)
    start = time.perf_counter()
    measure = {"air": air_lines, "flights": flight_lines, "fits": fit_lines}
    try:
        device = jax.devices()[0]
        name = device.device_kind if platform() == "gpu" else f"{os.cpu_count()} cores"
        lines = [
            f"Studies: {platform()}, {name}, {len(jax.devices())} devices of JAX "
            f"{jax.__version__}, float64, load average {os.getloadavg()[0]:.1f}"
        ]
        for part in asked:
            begun = time.perf_counter()
            if begun - start > seconds:
                lines += ["", f"{part}: not measured, {seconds:g} s are over"]
                continue
            lines += ["", *measure[part]()]
            lines.append(f"  ({time.perf_counter() - begun:.0f} s to measure)")
            if kept is not None:
                write_text(kept, "\n".join(lines) + "\n")
        return "\n".join(lines)
    finally:
        jax.config.update("jax_enable_x64", before)


def main() -> None:
    """Measure parts; print and keep."""
    parser = argparse.ArgumentParser(description="Measure how fast studies are.")
    parser.add_argument("part", nargs="*", metavar="PART", help=", ".join(PARTS))
    parser.add_argument("--seconds", type=float, default=float("inf"))
    asked = parser.parse_args()
    if unknown := [part for part in asked.part if part not in PARTS]:
        parser.error(f"no part {unknown[0]!r}: expected {', '.join(PARTS)}")
    with contextlib.suppress(RuntimeError):  # the devices stand already
        jax.config.update("jax_num_cpu_devices", os.cpu_count() or 1)
    suffix = "_gpu" if platform() == "gpu" else ""
    kept = RESULTS / f"benchmark_study{suffix}.txt"
    if asked.part:
        kept = None
    print(study_text(tuple(asked.part) or PARTS, asked.seconds, kept))


def study_of(scene: str, study: str) -> Study:
    """Return a study from texts."""
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "scene.toml").write_text(scene)
        path = Path(folder) / "study.toml"
        path.write_text(f'scene = "scene.toml"\n{study}')
        return read_study(path)


def sensors(count: int, records: str = "") -> str:
    """Return the tables of so many sensors."""
    return "".join(
        f'[[sensor]]\nname = "s{n}"\nposition_m = {list(PLACES[n])}\n{records}\n'
        for n in range(count)
    )


def air_study(count: int, samples: int) -> Study:
    """Return the study of arrivals and pressures at so many sensors."""
    asked = '["air_arrival_s", "peak_overpressure_pa"]'
    head = f'samples = {samples}\nkeep = "summary"\noutcomes = {asked}\n'
    return study_of(AIR + sensors(count), head)


def platform() -> str:
    """Return "cpu" or "gpu"."""
    return "cpu" if jax.default_backend() == "cpu" else "gpu"


def clock() -> float:
    """Return seconds: see the top of this file."""
    if platform() == "gpu":
        return time.perf_counter()
    return time.process_time() / (os.cpu_count() or 1)


def timed(call: Callable[[], Any]) -> float:
    """Return the seconds of a call and of what it leaves running."""
    begun = clock()
    jax.block_until_ready(call())
    return clock() - begun


def best(*calls: Callable[[], Any]) -> list[float]:
    """Return the least seconds of calls, which take turns; each is called before."""
    for call in calls:
        jax.block_until_ready(call())
    turns = [[timed(call) for call in calls] for _ in range(REPEATS)]
    return [min(one) for one in zip(*turns, strict=True)]


@contextlib.contextmanager
def watched() -> Iterator[list[tuple[Any, tuple[Any, ...]]]]:
    """Give the programs that launchers run meanwhile, and what each was given."""
    found: list[tuple[Any, tuple[Any, ...]]] = []
    program = Launcher._program

    def watching(self: Launcher, capacity: int) -> Any:
        compiled = program(self, capacity)

        def run(*given: Any) -> Any:
            found.append((compiled, given))
            return compiled(*given)

        return run

    Launcher._program = watching  # pyright: ignore[reportAttributeAccessIssue]  for the time of the block
    try:
        yield found
    finally:
        Launcher._program = program


def programs_of(call: Callable[[], Any]) -> Callable[[], Any]:
    """Return what runs the programs of a call alone, on what they were given.

    Each device has a thread of its own: a loop of a GPU asks the host whether to go on.
    """
    with watched() as found:
        call()
    by_device: dict[Any, list[tuple[Any, tuple[Any, ...]]]] = {}
    for program, given in found:
        (device,) = jax.tree.leaves(given)[0].devices()
        by_device.setdefault(device, []).append((program, given))

    def in_turn(programs: list[tuple[Any, tuple[Any, ...]]]) -> Any:
        last = None
        for program, given in programs:
            last = program(*given)
        return last

    def alone() -> Any:
        with ThreadPoolExecutor(len(by_device)) as pool:
            return list(pool.map(in_turn, by_device.values()))

    return alone


def air(count: int, samples: int, devices: int | None = None) -> tuple[float, float]:
    """Return the seconds of a tile of so many samples, and of its programs alone."""
    study = air_study(count, 256 * samples)  # the most tiles there are
    reduced = Reduced(Work(study, mesh_of(devices)))
    assert reduced.tile == samples, (reduced.tile, samples)
    with tempfile.TemporaryDirectory() as folder:
        store = SummaryStore(folder, reduced.work.variables, 1, reduced.tiles)
        store.create(reduced.anchors, reduced.tile)

        def tile() -> None:
            store.write(0, reduced.states(0))

        whole, alone = best(tile, programs_of(tile))
    return whole, alone


def air_lines() -> list[str]:
    """Measure arrivals and pressures."""
    lines = ["arrival + pressure, draws and statistics included"]
    samples = AIR_TILES[platform()]
    for count in (16, 1):
        each = samples if count == 16 else 8 * samples
        whole, alone = air(count, each)
        lines.append(
            f"  {count:2} sensors, evaluations/s           {count * each / whole:14.3g}"
            f"   a tile {whole:.2g} s, {1 - alone / whole:.1%} of it the engine's"
        )
    if platform() == "gpu" and len(jax.devices()) > 1:
        one = samples / air(16, samples, 1)[0]
        two = 2 * samples / air(16, 2 * samples, 2)[0]
        lines.append(
            f"  16 sensors, 1 and 2 devices          {16 * one:14.3g}{16 * two:12.3g}"
            f"   weak scaling {two / one / 2:.1%}"
        )
    return lines


def fit_lines() -> list[str]:
    """Measure fits, and `fit_many` of the same logs."""
    count = FITTED[platform()]
    records = 'records = { air_arrival_s = 2e-4, peak_overpressure_pa = "20%" }'
    scene = AIR.replace("[{ normal = [0.0, 1.0] }, 0.0, 0.0]", "[0.0, 0.0, 0.0]")
    study = study_of(
        scene + sensors(6, records), f'samples = {count}\noutcomes = ["fit_error"]\n'
    )
    work = Work(study)
    believed = study.believed[0]
    layout, sigma, _ = planned_layout(believed.scene)
    quantities: tuple[str, ...] = ("air_arrival_s", "peak_overpressure_pa")
    laws: dict[str, str] = dict.fromkeys(quantities, "kingery_bulmash")
    blocks = np.arange(count // work.numbering.block)
    drawn = work.launcher(0)(*work.given(blocks))["_readings"]
    readings = np.ascontiguousarray(drawn.reshape(count, -1))
    batch = max(work.at_once * work.numbering.tile, 1 << 16)

    def tiles() -> None:
        for _ in calculated(work, range(work.numbering.tiles)):
            pass

    def fit(**how: Any) -> None:
        for begin in range(0, count, batch):
            some = readings[begin : begin + batch]
            fits = fit_many(believed, layout, some, np.asarray(sigma), laws, **how)
            jax.device_get(jax.tree.leaves(fits))

    def alike() -> None:
        fit(again_z=AGAIN_Z)

    ours, draws, alone, same = best(tiles, programs_of(tiles), fit, alike)
    return [
        f"fits of a mass to 12 readings: {count:,}, float64",
        f"  fits/s, draws and outcomes included  {count / ours:14,.0f}",
        f"  by fit_many, host to host            {count / alone:14,.0f}"
        f"   (the study's share of it: {alone / ours:.1%})",
        f"  by fit_many, begun again as there    {count / same:14,.0f}"
        f"   (the study's share of it: {same / ours:.1%})",
        f"  draws of the readings alone          {count / draws:14,.0f}"
        f"   (its share of draws and fit_many: {(same + draws) / ours:.1%})",
    ]


def flight_lines() -> list[str]:
    """Measure flights, and the same by `simulate`."""
    count = FLOWN[platform()]
    asked = f'samples = {count}\noutcomes = ["flies_on"]\n'
    work = Work(study_of(HOVER, f"{asked}[options]\nflight_step_s = {STEP_S}\n"))
    said = next(n for n in work.notes if "flights of" in n)
    seconds = float(said.split("flights of ")[1].split()[0])
    masses = jnp.asarray(np.random.default_rng(0).lognormal(0.0, np.log(1.2), count))
    precision = np.float64 if platform() == "cpu" else np.float32

    def blast(mass: Any) -> Any:
        return blast_load(Scene(Charge(mass_kg=mass, time_s=0.5)))

    state = benchmarks.starts(count, precision)
    hold = PositionHold(benchmarks.TARGET, named_gains("crazyflie", integral=True))
    steps = round(seconds / STEP_S)

    def simulated(**more: Any) -> Callable[[], Any]:
        load = eqx.filter_vmap(blast)(masses)
        return lambda: simulate(
            named("crazyflie"),
            state,
            duration_s=seconds,
            step_s=STEP_S,
            control=hold,
            loads=(load,),
            backend="jax",
            **more,
        )

    def tiles() -> Any:
        return work.several(range(work.numbering.tiles))

    every = {"store_every": -(-steps // BATCH_ROWS)}
    one, seldom = {"store_every": steps}, {"control_period_s": benchmarks.HELD_S}
    ways = {
        "the same flights by simulate": {**every, "ground_up_m": 0.0},
        "without ground": every,
        "without ground, one row": one,
        "without ground, hold every 4 ms": {**every, **seldom},
        "hold asked every 4 ms, one row": {**one, **seldom},
    }
    took = best(
        tiles, programs_of(tiles), *(simulated(**more) for more in ways.values())
    )
    rates = [count * seconds / one for one in took]
    lines = [
        f"flights: {count:,} of {seconds:g} s at {1e3 * STEP_S:g} ms, "
        f"{np.dtype(precision).name}",
        f"  vehicle-s/s                          {rates[0]:14.4g}"
        f"   ({1 - took[1] / took[0]:.1%} of the time the engine's)",
    ]
    for way, rate in zip(ways, rates[2:], strict=True):
        share = f"(the study's share of it: {rates[0] / rate:.1%})"
        lines.append(f"  {way:37}{rate:14.4g}   {share}")
    return lines


if __name__ == "__main__":
    main()
