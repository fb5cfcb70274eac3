"""Vehicle-seconds a second of a study, and of the same flights without it."""

from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from calibration import benchmark_flights
from calibration.study_cases import HOVER, study_of
from calibration.study_clock import best, platform, programs_of
from jblast.scene import Charge, Scene
from jblast.study.flights import BATCH_ROWS
from jblast.study.sampling.work import Work
from jblast.vehicle import Each, PositionHold, blast_load, named, named_gains, simulate

FLOWN = {"cpu": 1 << 7, "gpu": 1 << 16}
STEP_S = 1e-3


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
        return blast_load(Scene(charge=Charge(mass_kg=mass, time_s=0.5)))

    state = benchmark_flights.starts(count, precision)
    hold = PositionHold(
        benchmark_flights.TARGET, named_gains("crazyflie", integral=True)
    )
    steps = round(seconds / STEP_S)

    def simulated(**more: Any) -> Callable[[], Any]:
        load = Each(eqx.filter_vmap(blast)(masses))
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
    one, seldom = {"store_every": steps}, {"command_step_s": benchmark_flights.HELD_S}
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
