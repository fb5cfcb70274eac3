"""Samples per second of studies, compared with the calculations that they contain.

    python -m calibration.benchmark_study [air|flights|fits ...]

On a GPU by the wall clock; on a CPU by processor time over the number of cores, which
is the wall clock of an idle machine and is the same on a busy one. The best of three.

Air: mass and range of a charge are sampled, Kingery and Bulmash's laws give arrival and
peak pressure at 16 sensors, or at one; samples, statistics and the store included. An
evaluation is both at one sensor. On a GPU machine also by one device of several.

Flights: seconds of vehicles per second of the outcome `flies_on`, compared with the
same flights by `simulate`, whose blasts are given.

Fits: logs per second of the outcome `fit_error`, compared with `fit_many` of readings
that are given.

The table of a CPU is stored in calibration/results/benchmark_study.txt, that of a GPU
in benchmark_study_gpu.txt.
"""

import argparse
import contextlib
import os
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jblast.files import write_text
from jblast.inference import fit_many
from jblast.scene import Charge, Scene
from jblast.sensors import planned_layout
from jblast.study import Study, read_study
from jblast.study.draws import normal_scores
from jblast.study.flights import BATCH_ROWS
from jblast.study.outcome.fit import AGAIN_Z
from jblast.study.runs import attributes_of, create_store, here
from jblast.study.slabs import Slabs, answers_of
from jblast.vehicle import PositionHold, blast_load, named, named_gains, simulate

REPEATS = 3
STEP_S = 1e-3
RESULTS = Path(__file__).parent / "results"
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
BOTH = '["air_arrival_s", "peak_overpressure_pa"]'


def on_gpu() -> bool:
    """Return whether JAX uses a GPU."""
    return jax.default_backend() == "gpu"


def study_of(scene: str, study: str) -> Study:
    """Return a study from texts."""
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "scene.toml").write_text(scene)
        path = Path(folder) / "study.toml"
        path.write_text(f'scene = "scene.toml"\n{study}')
        return read_study(path)


def sensors(count: int, records: str = "") -> str:
    """Return the tables of a number of sensors."""
    return "".join(
        f'[[sensor]]\nname = "s{n}"\n'
        f"position_m = {[20.0 + 5.0 * n, 3.0 * n, 0.0]}\n{records}\n"
        for n in range(count)
    )


def clock() -> float:
    """Return seconds, of the wall clock or of a core."""
    if on_gpu():
        return time.perf_counter()
    return time.process_time() / (os.cpu_count() or 1)


def best(*calls: Callable[[], Any]) -> list[float]:
    """Return the least seconds of calls, which take turns; each is called before."""
    for call in calls:
        jax.block_until_ready(call())
    least = [np.inf] * len(calls)
    for _ in range(REPEATS):
        for n, call in enumerate(calls):
            begun = clock()
            jax.block_until_ready(call())
            least[n] = min(least[n], clock() - begun)
    return least


def running(
    slabs: Slabs, folder: str, devices: list[Any] | None = None
) -> Callable[[], Any]:
    """Return the calculation of all slabs into a new store."""
    store = create_store(folder, folder, slabs, attributes_of(slabs))
    return lambda: list(here(slabs, store, devices)(range(slabs.slabs)))


def air() -> list[str]:
    """Measure arrivals and pressures."""
    lines = ["arrival + pressure, samples, statistics and store included"]
    for count, samples in ((16, 1 << 24), (1, 1 << 26)):
        samples <<= 8 if on_gpu() else 0
        head = f"samples = {samples}\nkeep = 1\noutcomes = {BOTH}\n"
        slabs = Slabs(study_of(AIR + sensors(count), head))
        there = jax.devices()
        several = [there] if len(there) == 1 or not on_gpu() else [there, there[:1]]
        for devices in several:
            with tempfile.TemporaryDirectory() as folder:
                (seconds,) = best(running(slabs, folder, devices))
            words = "" if len(several) == 1 else f", {len(devices)} devices"
            rate = f"{count * samples / seconds:.3g}"
            lines.append(f"  {f'{count:2} sensors{words}, evaluations/s':36}{rate:>12}")
    return lines


def fits() -> list[str]:
    """Measure fits, and `fit_many` of the same number of logs."""
    count = 1 << (22 if on_gpu() else 16)
    records = 'records = { air_arrival_s = 2e-4, peak_overpressure_pa = "20%" }'
    scene = AIR.replace("[{ normal = [0.0, 1.0] }, 0.0, 0.0]", "[0.0, 0.0, 0.0]")
    head = f'samples = {count}\noutcomes = ["fit_error"]\n'
    study = study_of(scene + sensors(6, records), head)
    believed = study.believed[0]
    layout, sigma, _ = planned_layout(believed.scene)
    quantities: tuple[str, ...] = ("air_arrival_s", "peak_overpressure_pa")
    laws: dict[str, str] = dict.fromkeys(quantities, "kingery_bulmash")
    slabs = Slabs(study)
    keys = jax.random.split(jax.random.key(0), count)
    scores = normal_scores(keys, len(study.drawn))
    none = jnp.zeros((1, 0)), jnp.zeros(count, int)
    readings = np.asarray(answers_of(study, 0, keys, scores, *none)["_readings"])
    readings = readings.reshape(count, -1)

    def fit() -> None:
        found = fit_many(
            believed, layout, readings, np.asarray(sigma), laws, again_z=AGAIN_Z
        )
        jax.device_get(jax.tree.leaves(found))

    with tempfile.TemporaryDirectory() as folder:
        ours, alone = best(running(slabs, folder), fit)
    return [
        f"fits of a mass to 12 readings: {count:,}, float64",
        f"  fits/s, samples and outcomes included{count / ours:13,.0f}",
        f"  by fit_many, host to host            {count / alone:13,.0f}"
        f"   (the study's share of it: {alone / ours:.1%})",
    ]


def flights() -> list[str]:
    """Measure flights, and the same by `simulate`."""
    from calibration import benchmarks  # which starts JAX

    count = 1 << (16 if on_gpu() else 7)
    head = f'samples = {count}\noutcomes = ["flies_on"]\n'
    slabs = Slabs(study_of(HOVER, f"{head}[options]\nflight_step_s = {STEP_S}\n"))
    note = next(note for note in slabs.notes if "flights of" in note)
    seconds = float(note.split("flights of ")[1].split()[0])
    masses = np.random.default_rng(0).lognormal(0.0, np.log(1.2), count)
    precision = np.float32 if on_gpu() else np.float64

    def blast(mass: Any) -> Any:
        return blast_load(Scene(Charge(mass_kg=mass, time_s=0.5)))

    load = eqx.filter_vmap(blast)(jnp.asarray(masses))
    state = benchmarks.starts(count, precision)
    hold = PositionHold(benchmarks.TARGET, named_gains("crazyflie", integral=True))

    def simulated() -> Any:
        return simulate(
            named("crazyflie"),
            state,
            duration_s=seconds,
            step_s=STEP_S,
            store_every=-(-round(seconds / STEP_S) // BATCH_ROWS),
            control=hold,
            loads=(load,),
            ground_up_m=0.0,
            backend="jax",
        )

    with tempfile.TemporaryDirectory() as folder:
        ours, alone = best(running(slabs, folder), simulated)
    whole = count * seconds
    return [
        f"flights: {count:,} of {seconds:g} s at {1e3 * STEP_S:g} ms, "
        f"{np.dtype(precision).name}",
        f"  vehicle-s/s                          {whole / ours:13.4g}",
        f"  the same flights by simulate         {whole / alone:13.4g}"
        f"   (the study's share of it: {alone / ours:.1%})",
    ]


PARTS = {"air": air, "flights": flights, "fits": fits}


def main() -> None:
    """Measure parts and print them; store the table of all parts."""
    parser = argparse.ArgumentParser(description="Measure the rates of studies.")
    parser.add_argument("part", nargs="*", metavar="PART", help=", ".join(PARTS))
    parts = parser.parse_args().part
    if unknown := [part for part in parts if part not in PARTS]:
        parser.error(f"expected {', '.join(PARTS)}, got {unknown[0]!r}")
    with contextlib.suppress(RuntimeError):  # the devices are in use already
        jax.config.update("jax_num_cpu_devices", os.cpu_count() or 1)
    jax.config.update("jax_enable_x64", True)
    there = jax.devices()
    device = there[0].device_kind if on_gpu() else f"{os.cpu_count()} cores"
    lines = [
        f"Studies: {there[0].platform}, {device}, {len(there)} devices of JAX "
        f"{jax.__version__}, float64, load average {os.getloadavg()[0]:.1f}"
    ]
    for part in parts or PARTS:
        lines += ["", *PARTS[part]()]
    text = "\n".join(lines)
    print(text)
    if not parts:
        name = "benchmark_study_gpu.txt" if on_gpu() else "benchmark_study.txt"
        write_text(RESULTS / name, text + "\n")


if __name__ == "__main__":
    main()
