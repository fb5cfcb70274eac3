"""A mission flown by what the instruments say: what it costs, what blasts do to it.

python -m calibration.missions_estimated > calibration/results/missions_estimated.txt

The campus mission of `calibration.missions` (32 waypoints, three charges of 150 kg
beside its legs) is flown by the truth and by the error-state Kalman filter, by all
three vehicles. Then a mission of 10 minutes is flown with and without the filter, as
`jblast fly` flies it but for blasts: processor time after compilation, with what is
told of the flight afterwards (guidance, and the estimate along it) for itself.
"""

import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from calibration.missions import (
    CAMPUS,
    MASS_KG,
    VEHICLES,
    at_home,
    campus_plan,
    charges,
    passes,
    ten_minutes,
)
from jblast.autopilot.estimator import EstimatedControl
from jblast.autopilot.lockstep import suite_of
from jblast.cli.jax_start import start_jax
from jblast.missions import MissionControl, mission_of, replay, write_plan
from jblast.scene import Charge, Scene, UncertainScene, VehicleSpec
from jblast.study.flight_results import Options
from jblast.study.flights import followed_along
from jblast.study.missions import (
    MISSION_STEP_S,
    TOLERANCE_M,
    MissionFlight,
    fly_mission,
)
from jblast.vehicle import PositionHold, named, named_gains, simulate

REPEATS, SECONDS = 3, 660.0


def through(
    plan: Path, model: str, blasts: list[Charge], estimator: str
) -> MissionFlight:
    """Fly the plan through blasts, as `jblast fly --estimator` does."""
    spec = VehicleSpec(model, np.zeros(3), mission=str(plan), placed=False)
    scene = Scene(blasts[0], others=tuple(blasts[1:]), vehicle=spec)
    options = Options(
        step_s=MISSION_STEP_S, tolerance_m=TOLERANCE_M, estimator=estimator
    )
    return fly_mission(UncertainScene(scene), options)


def flights() -> str:
    """Return what became of the campus mission, by the truth and by the estimate."""
    plan = campus_plan()
    blasts = charges(passes(mission_of(plan), "iris"))
    lines = [
        f"32 waypoints through three charges of {MASS_KG:g} kg; errors of the "
        "estimate: root mean square in the second before, greatest in 10 s after",
        "vehicle      flown by  leg    place [m]        velocity [m/s]   attitude "
        "[mrad]  path error before, peak [m]  waypoints",
    ]
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "campus.plan"
        write_plan(plan, file)
        for model in VEHICLES:
            for estimator in ("", "ekf"):
                lines += rows(through(file, model, blasts, estimator))
    return "\n".join(lines)


def rows(flight: MissionFlight) -> list[str]:
    """Return a line for each blast."""
    reached = sum(one.reached for one in flight.waypoints)
    end = f"{reached} of {len(flight.waypoints)}, {flight.crash or 'landed'}"
    found = []
    for n, one in enumerate(flight.disturbances):
        cells = ["-"] * 3
        if flight.thrown is not None:
            values = [float(x[n]) for x in flight.thrown]
            sizes = (1.0, 1.0, 1e3)
            cells = [
                f"{size * values[2 * k]:.3g} -> {size * values[2 * k + 1]:.3g}"
                for k, size in enumerate(sizes)
            ]
        by = flight.options.estimator or "truth"
        found.append(
            f"{flight.vehicle.model:<12} {by:<9} {one.charge:<6} "
            + " ".join(f"{cell:<16}" for cell in cells)
            + f"{one.error_before_m:.3f}, {one.peak_deviation_m:.3f}"
            + f"{'':<17}{end}"
        )
    return found


def costs() -> str:
    """Return what 10 minutes cost with the filter and without."""
    mission, planned = ten_minutes()
    start = at_home(mission)
    hold = PositionHold(jnp.zeros(3), named_gains("iris", integral=True))
    control = MissionControl(mission.guidance, hold)
    suite = suite_of(Scene(Charge(1.0)), CAMPUS, None, 1 / MISSION_STEP_S)
    filtered = EstimatedControl(control, suite, start, jnp.asarray(0, jnp.uint32))
    period = jnp.asarray(MISSION_STEP_S)

    def fly(by: Any, **options: Any) -> Any:
        return simulate(
            named("iris"),
            start,
            duration_s=SECONDS,
            step_s=MISSION_STEP_S,
            control=by,
            ground_up_m=0.0,
            **options,
        )

    truly, told = timed(lambda: fly(control))
    euler, _ = timed(lambda: fly(control, integrator="euler"))
    guided, _ = timed(lambda: replay(control.guidance, told.states, period))
    estimated, flight = timed(lambda: fly(filtered))
    along, found = timed(lambda: followed_along(filtered, flight, period))
    off = np.linalg.norm(np.asarray(found.error)[:, 3:6], axis=1)
    return "\n".join(
        [
            f"A mission of {planned:.0f} s, {SECONDS:g} s flown, iris, steps of 4 ms, "
            f"{jax.devices()[0].device_kind}, float64, after compilation:",
            "seconds of processor for 10 minutes, least of three (of the wall)",
            f"flown by the truth                    {per_ten_minutes(truly)}",
            f"flown by the truth, --integrator euler {per_ten_minutes(euler)}",
            f"what the guidance said along it       {per_ten_minutes(guided)}",
            f"flown by the filter                   {per_ten_minutes(estimated)}",
            f"what it estimated along the flight    {per_ten_minutes(along)}",
            f"estimate's place is off by {np.sqrt(np.mean(off**2)):.3f} m rms, "
            f"{off.max():.3f} m at most",
        ]
    )


def timed(run: Callable[[], Any]) -> tuple[tuple[float, float], Any]:
    """Return the least processor and wall time of some runs, and what came of one."""
    found = jax.block_until_ready(run())
    cores = wall = float("inf")
    for _ in range(REPEATS):
        start, spent = time.perf_counter(), time.process_time()
        found = jax.block_until_ready(run())
        wall = min(wall, time.perf_counter() - start)
        cores = min(cores, time.process_time() - spent)
    return (cores, wall), found


def per_ten_minutes(taken: tuple[float, float]) -> str:
    """Word the time of a flight as that of ten minutes of it."""
    cores, wall = (600.0 / SECONDS * x for x in taken)
    return f"{cores:6.2f} ({wall:.2f})"


if __name__ == "__main__":
    start_jax()
    sys.stdout.write(f"{flights()}\n\n{costs()}\n")
