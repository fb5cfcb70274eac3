"""Samples a second of studies, and what the engine adds to what it runs.

Arrivals and pressures: mass and range of a charge are drawn, Kingery and Bulmash's laws
give arrival and peak pressure at 16 sensors, or at one; draws and statistics (mean,
standard deviation, quantiles) included, nothing else kept: `keep = "summary"`. An
evaluation is both at one sensor. Beside it what of that time the devices were at work:
the rest is the engine's, and what writing the tiles takes.

Flights: vehicle-seconds a second of the outcome `flies_on`, against the same flights by
`simulate` alone, as in `benchmark_flights`, at the same step, in float64, in this run.

Fits: logs a second of the outcome `fit_error`, against `fit_many` of readings that lie
on the host, its answer copied back, in this run.

Host to host: `fit_from_host`, which copies while it fits and brings back what was
asked, against `fit_many` and its whole answer; logs of `calibration.six_stations`.

Weak scaling: the same samples for each of two devices of a GPU machine as for one.
"""

import os
import tempfile
import time
from pathlib import Path

import jax
import numpy as np

from calibration import benchmark_flights
from calibration.six_stations import LAWS, columns_of, draw, scene_of
from jblast.inference import fit_many
from jblast.inference.many.from_host import fit_from_host
from jblast.sensors import planned_layout
from jblast.study import Study, read_study
from jblast.study.engine import launch
from jblast.study.engine.launch import mesh_of
from jblast.study.engine.summary.store import SummaryStore
from jblast.study.sampling.reduced import Reduced
from jblast.study.sampling.work import Work

SAMPLES = {"cpu": 1 << 22, "gpu": 1 << 30}
"""Of the study of arrivals and pressures: the tiles of one of SPANNED times as many."""
SPANNED = 64
FLOWN = {"cpu": 1 << 10, "gpu": 1 << 16}
FITTED = {"cpu": 1 << 14, "gpu": 1 << 20}
LOGS = {"cpu": 1 << 17, "gpu": 1 << 23}
STEP_S = 1e-3
REPEATS = 3

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


def best(call, repeats: int = REPEATS) -> float:
    """Return the least seconds of a call, called once before."""
    call()
    return min(timed(call) for _ in range(repeats))


def timed(call) -> float:
    """Return the seconds of a call."""
    begun = time.perf_counter()
    call()
    return time.perf_counter() - begun


def rate_of(count: int, samples: int, devices: int | None = None):
    """Return evaluations a second, and the share that is not the devices' work."""
    study = air_study(count, SPANNED * samples)
    reduced = Reduced(Work(study, mesh_of(devices)))
    at_work = [0.0]
    launched = launch.Launcher._launch

    def watched(self, shared, each):
        begun = time.perf_counter()
        answer = launched(self, shared, each)
        at_work[0] += time.perf_counter() - begun
        return answer

    tiles = max(1, samples // reduced.tile)
    with tempfile.TemporaryDirectory() as folder:
        store = SummaryStore(folder, reduced.work.variables, 1, reduced.tiles)
        store.create(reduced.anchors, reduced.tile)

        def whole() -> None:
            for tile in range(tiles):
                store.write(tile, reduced.states(tile))

        whole()
        launch.Launcher._launch = watched
        try:
            found = []
            for _ in range(REPEATS):
                at_work[0] = 0.0
                took = timed(whole)
                found.append((took, 1 - at_work[0] / took))
        finally:
            launch.Launcher._launch = launched
    took, rest = min(found)
    return count * tiles * reduced.tile / took, rest, took / tiles


def air_lines(platform: str) -> list[str]:
    """Measure arrivals and pressures."""
    lines = ["arrival + pressure, draws and statistics included"]
    for count in (16, 1):
        rate, rest, tile = rate_of(count, SAMPLES[platform])
        lines.append(
            f"  {count:2} sensors, evaluations/s           {rate:14.3g}   a tile "
            f"{tile:.2g} s, {rest:.1%} of it the engine's"
        )
    if platform == "gpu" and len(jax.devices()) > 1:
        one, _, _ = rate_of(16, SAMPLES["gpu"], 1)
        two, _, _ = rate_of(16, 2 * SAMPLES["gpu"], 2)
        lines.append(
            f"  16 sensors, 1 and 2 devices          {one:14.3g}{two:12.3g}   weak "
            f"scaling {two / one / 2:.1%}"
        )
    return lines


def flight_lines(platform: str) -> list[str]:
    """Measure flights, and the same by the flight benchmark."""
    count = FLOWN[platform]
    asked = f'samples = {count}\noutcomes = ["flies_on"]\n'
    options = f"[options]\nflight_step_s = {STEP_S}\n"
    work = Work(study_of(HOVER, asked + options))
    said = next(n for n in work.notes if "flights of" in n)
    seconds = float(said.split("flights of ")[1].split()[0])
    flown = min(count, work.numbering.tile)
    ours = flown * seconds / best(lambda: work.tile(0))
    before = benchmark_flights.VEHICLES
    benchmark_flights.VEHICLES = flown
    try:
        blast = benchmark_flights.models()["hold, blast"]
        alone = benchmark_flights.rate(STEP_S, np.float64, blast) / 4 * STEP_S
    finally:
        benchmark_flights.VEHICLES = before
    return [
        f"flights: {flown:,} of {seconds:g} s at {1e3 * STEP_S:g} ms, float64",
        f"  vehicle-s/s                          {ours:14.4g}",
        f"  by simulate alone, hold and blast    {alone:14.4g}"
        f"   (the study's share of it: {ours / alone:.1%})",
    ]


def fit_lines(platform: str) -> list[str]:
    """Measure fits, and `fit_many` of the same scene."""
    count = FITTED[platform]
    records = 'records = { air_arrival_s = 2e-4, peak_overpressure_pa = "20%" }'
    scene = AIR.replace("[{ normal = [0.0, 1.0] }, 0.0, 0.0]", "[0.0, 0.0, 0.0]")
    study = study_of(
        scene + sensors(6, records), f'samples = {count}\noutcomes = ["fit_error"]\n'
    )
    work = Work(study)
    tiles = range(work.numbering.tiles)
    ours = count / best(lambda: [work.tile(tile) for tile in tiles])
    believed = study.believed[0]
    layout, sigma, _ = planned_layout(believed.scene)
    part = work.parts[0][0]
    keys = jax.random.split(jax.random.key(0), count)
    mass = np.random.default_rng(0).lognormal(np.log(10.0), np.log(2.0), count)
    numbers = {"charge_mass_kg": jax.numpy.asarray(mass)}
    read = jax.jit(part.prepared.batched)(keys, numbers)
    readings, sigma = np.asarray(read["_readings"]), np.asarray(sigma)
    quantities: tuple[str, ...] = ("air_arrival_s", "peak_overpressure_pa")
    laws: dict[str, str] = dict.fromkeys(quantities, "kingery_bulmash")

    def fit() -> None:
        jax.device_get(
            jax.tree.leaves(fit_many(believed, layout, readings, sigma, laws))
        )

    alone = count / best(fit)
    return [
        f"fits of a mass to 12 readings: {count:,}, float64",
        f"  fits/s                               {ours:14,.0f}",
        f"  by fit_many, host to host            {alone:14,.0f}"
        f"   (the study's share of it: {ours / alone:.1%})",
    ]


def host_lines(platform: str) -> list[str]:
    """Measure fits from host to host."""
    problem = draw(LOGS[platform])
    uncertain = scene_of(problem)
    layout, sigma, _ = planned_layout(uncertain.scene)
    readings = np.ascontiguousarray(problem.readings[:, columns_of(layout)])
    given = (uncertain, layout, readings, np.asarray(sigma), LAWS)
    lines = [f"fits from host to host, 12 readings, 4 unknowns: {len(readings):,} logs"]

    def whole() -> None:
        jax.device_get(jax.tree.leaves(fit_many(*given, noise="gaussian")))

    rates = [("fit_many, the whole answer", len(readings) / best(whole))]
    for keep in (("z", "sd", "converged"), ("z",)):
        took = best(
            lambda keep=keep: fit_from_host(*given, noise="gaussian", keep=keep)
        )
        rates.append((f"fit_from_host, {', '.join(keep)}", len(readings) / took))
    return [*lines, *(f"  {name:37s}{rate:14,.0f}" for name, rate in rates)]


def study_text() -> str:
    """Measure and return the table."""
    before = jax.config.read("jax_enable_x64")
    jax.config.update("jax_enable_x64", True)
    try:
        device = jax.devices()[0]
        platform = "cpu" if device.platform == "cpu" else "gpu"
        name = device.device_kind if platform == "gpu" else f"{os.cpu_count()} cores"
        lines = [
            f"Studies: {platform}, {name}, {len(jax.devices())} devices of JAX "
            f"{jax.__version__}, float64, load average {os.getloadavg()[0]:.1f}"
        ]
        for part in (air_lines, flight_lines, fit_lines, host_lines):
            begun = time.perf_counter()
            lines += ["", *part(platform)]
            lines.append(f"  ({time.perf_counter() - begun:.0f} s to measure)")
        return "\n".join(lines)
    finally:
        jax.config.update("jax_enable_x64", before)
