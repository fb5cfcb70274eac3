"""A campus mission of 32 waypoints through three blasts, and what its flight costs.

    python -m calibration.missions --out calibration/results/missions.png
        > calibration/results/missions.txt
    python -m calibration.missions estimated
        > calibration/results/missions_estimated.txt

The thesis of Parab flew 32 waypoints over its campus (figures 4.5, 4.6, 4.8) and shows
deviations between 4-5-6, 18-19 and 31-32, without a scale, the plan or the vehicle's
speed. The plan here is one like it: a loop of 32 waypoints about the University of
North Carolina at Charlotte, 6 m/s, 20 m up. Three charges of TNT go off as a vehicle
passes these legs. All three vehicles fly it; and the Iris flies it once more through
the thesis's own profile, `--profile custom_blast_impulses.csv`, its charge at each of
the three legs where its first case has it, moments about the point 100 m away that the
file means. Then a mission of 10 minutes is flown in steps of 1 to 10 ms: processor time
after compilation, and how far from the flight in steps of 0.5 ms.

Estimated: flown by what the instruments say.

The campus mission of `calibration.missions` (32 waypoints, three charges of 150 kg
beside its legs) is flown by the truth and by the error-state Kalman filter, by all
three vehicles. Then a mission of 10 minutes is flown with and without the filter, as
`jblast fly` flies it but for blasts: processor time after compilation, with what is
told of the flight afterwards (guidance, and the estimate along it) for itself.
"""

import argparse
import math
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from matplotlib.figure import Figure

from calibration import run_part
from jblast.autopilot.estimator import EstimatedControl
from jblast.autopilot.lockstep import suite_of
from jblast.cli.jax_start import start_jax
from jblast.missions import (
    Item,
    Mission,
    MissionControl,
    Plan,
    grid_plan,
    mission_of,
    planned_seconds,
    replay,
    write_plan,
)
from jblast.missions.plan import MISSION, RELATIVE, Nav
from jblast.missions.route import geodetic
from jblast.observations.places import Frame
from jblast.report.colours import COLOURS, INK, MUTED, VERMILLION
from jblast.report.figures import new_figure, quiet, titled
from jblast.report.flights import mission_map
from jblast.report.map_figures import draw_features, view_of
from jblast.scene import Charge, Place, Scene, UncertainScene, VehicleSpec
from jblast.study.flight_results import MISSION_STEP_S, Flights
from jblast.study.flights import fly, followed_along
from jblast.study.missions import MissionOutcome
from jblast.vehicle import (
    PositionHold,
    State,
    Trajectory,
    named,
    named_gains,
    simulate,
)

CAMPUS = Place(35.3075, -80.7353, 200.0)
UP_M, SPEED_M_S = 20.0, 6.0
VEHICLES = ("crazyflie", "hummingbird", "iris")
LEGS = ((4, 5), (18, 19), (31, 32))
"""Where the blasts come; the first of them after waypoint 4."""
MASS_KG, ASIDE_M = 150.0, 22.0
"""Of each charge, and how far it stands from the leg, on the ground."""
CASE_M, ARM_M = (-5.0, -5.0, -5.0), (100.0, 0.0, 0.0)
"""Where the first case of the thesis's profile has its charge, and the point that its
moments are about, both from the vehicle."""
STEPS_S, FINEST_S = (1e-3, 2e-3, 4e-3, 8e-3), 5e-4


REPEATS, SECONDS = 3, 660.0


def campus_plan() -> Plan:
    """Return 32 waypoints, take-off the first and return the last, around a campus."""
    angle = np.linspace(0, 2 * np.pi, 30, endpoint=False) - np.pi / 2
    size = 110.0 * (1 + 0.22 * np.cos(3 * angle) + 0.12 * np.sin(5 * angle))
    places = np.stack([size * np.cos(angle), 0.75 * size * np.sin(angle), 0 * angle])
    home = (CAMPUS.lat_deg, CAMPUS.lon_deg, UP_M)
    items = [Item(1, Nav.TAKEOFF, RELATIVE, (0.0, 0.0, 0.0, None, *home))]
    for n, (lat, lon, _) in enumerate(geodetic(Frame(*CAMPUS), places.T), start=2):
        where = (round(float(lat), 8), round(float(lon), 8), UP_M)
        items.append(Item(n, Nav.WAYPOINT, RELATIVE, (0.0, 0.0, 0.0, None, *where)))
    items.append(Item(32, Nav.RETURN, MISSION, (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)))
    return Plan(tuple(items), CAMPUS, hover_speed_m_s=SPEED_M_S)


def passes(mission: Mission, model: str) -> list[tuple[float, np.ndarray, np.ndarray]]:
    """Return when a vehicle is half-way along each of `LEGS`, where, and which way."""
    flight = flown(mission, model, MISSION_STEP_S)
    hold, period = mission.guidance, jnp.asarray(MISSION_STEP_S)
    visit = np.asarray(replay(hold, flight, period)[1])
    found = []
    for _, to in LEGS:
        rows = np.flatnonzero(visit == to - 1)
        middle = rows[len(rows) // 4 if to == 32 else len(rows) // 2]
        place = np.asarray(flight.position_m)[middle]
        way = np.asarray(flight.velocity_m_s)[middle]
        found.append((float(flight.time_s[middle]), place, way))
    return found


def flown(mission: Mission, model: str, step: float) -> Trajectory:
    """Fly a mission in still air, from the ground at home."""
    hold = PositionHold(jnp.zeros(3), named_gains(model, integral=True))
    control = MissionControl(mission.guidance, hold)
    seconds = 20.0 * math.ceil(1.05 * planned_seconds(mission.guidance) / 20)
    return simulate(
        named(model),
        at_home(mission),
        duration_s=seconds,
        step_s=step,
        control=control,
        ground_up_m=0.0,
    )


def charges(passed: list) -> list[Charge]:
    """Return a charge beside each leg, on the ground, that goes off as it is passed."""
    found = []
    for (first, to), (when, place, way) in zip(LEGS, passed, strict=True):
        right = np.array([way[1], -way[0], 0.0]) / np.hypot(*way[:2])
        there = place + ASIDE_M * right
        east, north = (float(x) for x in there[:2])
        found.append(Charge(MASS_KG, (east, north, 0.0), when, name=f"{first}-{to}"))
    return found


def through(plan: Path, model: str, blasts: list[Charge], **options: Any) -> Flights:
    """Fly the plan through blasts, as `jblast fly` does with some options."""
    spec = VehicleSpec(model, np.zeros(3), mission=str(plan), placed=False)
    scene = Scene(tuple(blasts), vehicle=spec)
    return fly(UncertainScene(scene), **options)


def outcome_of(flight: Flights) -> MissionOutcome:
    """Return the outcome of a mission."""
    assert flight.outcome is not None
    return flight.outcome


def report(flight: Flights, what: str) -> str:
    """Return a row of the table for each blast."""
    lines = []
    reached = sum(one.reached for one in outcome_of(flight).waypoints)
    outcome = outcome_of(flight)
    for n, one in enumerate(outcome.disturbances):
        peak = float(flight.first.encounter.overpressure_pa[n]) / 1e3
        back = f"{one.recovery_time_s:.2f}" if one.recovery_time_s < 99 else "-"
        lines.append(
            f"{flight.vehicle.model:<12} {what:<8} {one.charge or '-':<6} {peak:6.1f} "
            f"{1e3 * one.error_before_m:7.1f} {1e3 * one.peak_deviation_m:8.1f} "
            f"{back:>6} {reached:3d} of {len(outcome.waypoints)} "
            f"{outcome.disarmed_s:8.1f} {outcome.crash or 'landed'}"
        )
    return "\n".join(lines)


def ten_minutes() -> tuple[Mission, float]:
    """Return a mission of some ten minutes, and how long it is planned to take [s]."""
    plan = grid_plan(
        CAMPUS, width_m=140.0, depth_m=120.0, spacing_m=10.0, up_m=UP_M, speed_m_s=4.0
    )
    mission = mission_of(plan)
    return mission, planned_seconds(mission.guidance)


def at_home(mission: Mission) -> State:
    """Return a vehicle that rests on the ground where a mission begins."""
    none, level = jnp.zeros(3), jnp.array([0.0, 0.0, 0.0, 1.0])
    return State(jnp.asarray(mission.home_m), none, level, none, jnp.zeros(4))


def costs() -> str:
    """Return what 10 minutes cost by step, and how far off they are."""
    mission, planned = ten_minutes()
    lines = [f"A mission of {planned:.0f} s, iris, cpu, float64, one thread's time"]
    lines.append("step [ms]  seconds  largest difference of places [mm]  rms [mm]")
    finest = None
    for step in (FINEST_S, *STEPS_S):
        taken, flight = [], None
        for _ in range(1 if step == FINEST_S else 3):
            begin = time.process_time()
            flight = jax.block_until_ready(flown(mission, "iris", step))
            taken.append(time.process_time() - begin)
        assert flight is not None
        every = round(0.04 / step)
        places = np.asarray(flight.position_m)[::every]
        if finest is None:
            finest = places
            continue
        rows = min(len(places), len(finest))
        off = np.linalg.norm(places[:rows] - finest[:rows], axis=1)
        lines.append(
            f"{1e3 * step:9.0f}  {min(taken):7.2f}  {1e3 * off.max():33.2f}  "
            f"{1e3 * math.sqrt(np.mean(off**2)):8.2f}"
        )
    return "\n".join(lines)


def main() -> None:
    """Fly, print the tables, draw the figure."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", required=True)
    parser.add_argument("--profile", help="the thesis's custom_blast_impulses.csv")
    parser.add_argument("--no-costs", action="store_true")
    asked = parser.parse_args()
    start_jax()
    import tempfile

    plan = campus_plan()
    passed = passes(mission_of(plan), "iris")
    blasts = charges(passed)
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "campus.plan"
        write_plan(plan, file)
        flights = {model: through(file, model, blasts) for model in VEHICLES}
        by_profile = []
        if asked.profile:
            options = {"profile": asked.profile, "profile_moments_about": ARM_M}
            for one, (when, place, _) in zip(blasts, passed, strict=True):
                # it is level, and heads east, as it passes
                east, north, up = (
                    float(a + b) for a, b in zip(place, CASE_M, strict=True)
                )
                charge = Charge(1.0, (east, north, up), when, name=one.name)
                by_profile.append(through(file, "iris", [charge], **options))
    print(
        f"Three charges of {MASS_KG:g} kg, {ASIDE_M:g} m beside the leg, flown "
        f"{UP_M:g} m up at {SPEED_M_S:g} m/s"
    )
    print(
        "vehicle      load     leg    [kPa]  before  peak [mm] back [s] waypoints "
        "disarmed [s]"
    )
    for flight in flights.values():
        print(report(flight, "laws"))
    for flight in by_profile:
        print(report(flight, "profile"))
    figure(flights, by_profile).savefig(asked.out, dpi=110)
    if not asked.no_costs:
        print()
        print(costs())


def figure(flights: dict[str, Flights], by_profile: list[Flights]) -> Figure:
    """Draw the thesis's figures 4.5, 4.6 and 4.8 again."""
    drawn = new_figure(13.0, 9.6)
    rows = drawn.subfigures(2, 1, squeeze=False, height_ratios=[1.5, 1.0])
    upper, lower = rows[:, 0]
    whole, zooms = upper.subfigures(1, 2, squeeze=False, width_ratios=[1.25, 1.0])[0]
    axes = whole.subplots()
    iris = flights["iris"]
    features = mission_map(iris).features
    places = np.concatenate([feature.places for feature in features])
    draw_features(axes, features, view_of(places))
    axes.legend(frameon=False, fontsize=8, loc="lower right")
    titled(axes, "4.5: 32 waypoints through three blasts", "Iris")
    parts = np.ravel(zooms.subplots(3, 1))
    for n, (first, to) in enumerate(LEGS):
        part = parts[n]
        quiet(part)
        came = float(iris.first.encounter.arrival_s[n])
        for model, colour in zip(VEHICLES, COLOURS, strict=False):
            off = across(flights[model], came)
            part.plot(*off, color=colour, linewidth=1.3, label=f"{model}, laws")
        if by_profile:
            came_there = float(by_profile[n].first.encounter.arrival_s[0])
            off = across(by_profile[n], came_there)
            part.plot(
                *off, color=INK, linewidth=1.3, linestyle="--", label="iris, profile"
            )
        part.axvline(0.0, color=MUTED, linewidth=0.8, linestyle=":")
        titled(part, f"4.6: between {first} and {to}")
        part.set_ylabel("off path [m]")
    parts[-1].set_xlabel("way along the leg since the blast [m]")
    parts[-1].legend(frameon=False, fontsize=8, ncols=2)
    axes = lower.subplots()
    quiet(axes)
    for model, colour in zip(VEHICLES, COLOURS, strict=False):
        flight = flights[model]
        rows = slice(None, None, 5)
        time_s = np.asarray(flight.trajectory.time_s)[rows]
        axes.plot(
            time_s,
            np.asarray(flight.trajectory.path_error_m)[rows],
            color=colour,
            linewidth=1.0,
            label=model,
        )
    for came in np.asarray(iris.first.encounter.arrival_s):
        axes.axvline(came, color=VERMILLION, linewidth=1.0, linestyle="--")
    axes.set_xlabel("time [s]; dashed: a blast arrives")
    axes.set_ylabel("path error [m]")
    axes.set_ylim(0.0)
    axes.legend(frameon=False, fontsize=9)
    titled(axes, "4.8: distance from the set point")
    return drawn


def across(flight: Flights, came: float) -> tuple[np.ndarray, np.ndarray]:
    """Return way along the path and distance across it, about a blast's arrival [m]."""
    time_s = np.asarray(flight.trajectory.time_s)
    rows = (time_s > came - 0.5) & (time_s < came + 2.5)
    place = np.asarray(flight.trajectory.position_m)[rows]
    aim = np.asarray(flight.trajectory.set_point_m)[rows]
    way = np.gradient(aim, axis=0)
    size = np.linalg.norm(way, axis=1, keepdims=True)
    way = way / np.where(size > 0, size, 1.0)
    off = place - aim
    off = off - np.sum(off * way, axis=1, keepdims=True) * way
    along = np.cumsum(size[:, 0])
    along -= np.interp(came, time_s[rows], along)
    return along, np.linalg.norm(off, axis=1)


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
                lines += rows(through(file, model, blasts, estimator=estimator))
    return "\n".join(lines)


def rows(flight: Flights) -> list[str]:
    """Return a line for each blast."""
    outcome = outcome_of(flight)
    reached = sum(one.reached for one in outcome.waypoints)
    end = f"{reached} of {len(outcome.waypoints)}, {outcome.crash or 'landed'}"
    found = []
    for n, one in enumerate(outcome.disturbances):
        cells = ["-"] * 3
        if flight.first.thrown is not None:
            values = [float(x[n]) for x in flight.first.thrown]
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


def estimated_costs() -> str:
    """Return what 10 minutes cost with the filter and without."""
    mission, planned = ten_minutes()
    start = at_home(mission)
    hold = PositionHold(jnp.zeros(3), named_gains("iris", integral=True))
    control = MissionControl(mission.guidance, hold)
    suite = suite_of(Scene(Charge(1.0)), CAMPUS, None, 1 / MISSION_STEP_S)
    filtered = EstimatedControl(control, suite, start, jnp.asarray(0, jnp.uint32))
    period = jnp.asarray(MISSION_STEP_S)

    def fly(by: Any) -> Any:
        return simulate(
            named("iris"),
            start,
            duration_s=SECONDS,
            step_s=MISSION_STEP_S,
            control=by,
            ground_up_m=0.0,
        )

    truly, told = timed(lambda: fly(control))
    guided, _ = timed(lambda: replay(control.guidance, told, period))
    estimated, flight = timed(lambda: fly(filtered))
    along, found = timed(lambda: followed_along(filtered, flight, period))
    off = np.linalg.norm(np.asarray(found.error)[:, 3:6], axis=1)
    return "\n".join(
        [
            f"A mission of {planned:.0f} s, {SECONDS:g} s flown, iris, steps of 4 ms, "
            f"{jax.devices()[0].device_kind}, float64, after compilation:",
            "seconds of processor for 10 minutes, least of three (of the wall)",
            f"flown by the truth                    {per_ten_minutes(truly)}",
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


def estimated() -> None:
    """Fly missions by what the instruments say; print the tables."""
    start_jax()
    sys.stdout.write(f"{flights()}\n\n{estimated_costs()}\n")


if __name__ == "__main__":
    run_part({"truth": main, "estimated": estimated})
