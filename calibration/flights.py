"""Quadrotors that hold their place in blasts: what moves them, how far, what recovers.

    python -m calibration.flights > calibration/results/flights.txt
    python -m calibration.flights controllers > calibration/results/controllers.txt
    python -m calibration.flights estimator > calibration/results/estimator.txt

Blast: what one blast does to quadrotors that hold their place: what moves them, how
far. A kilogram of TNT on the ground, vehicles 2 m above it at some distances, for 12 s;
and one of them in a steady wind. By the kernel of Warp in float64.

Controllers: which controller flies on through which blast, and how far each lets it be
thrown. Each vehicle, 3 m up, is flown by every controller through the same blasts of 1
to 10 kg of TNT on the ground, 3 to 30 m off, in a wind of up to 3 m/s either way. The
figure is of the Iris.

Estimator: how good a vehicle's estimate of its state is, and what blasts do to it. An
Iris holds its place by the error-state Kalman filter, 8 m from a charge and 10 m up,
with masses that make fronts of 10 to 100 kPa; beside it flies the same hold by the
truth. Each row is a mass: medians, and greatest of the vehicles.
"""

import tempfile
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine

from calibration import run_part
from jblast.cli.jax_start import start_jax
from jblast.report.colours import COLOURS, MUTED
from jblast.report.figures import log_ticks, new_figure, quiet, titled
from jblast.report.flight_figures import distribution_figure
from jblast.report.view import aligned
from jblast.scene import Air, Charge, Scene, UncertainScene, VehicleSpec, read_scene
from jblast.scene.uncertain import Normal
from jblast.study.flight_results import (
    Flights,
    flies_on,
    hold_words,
    metric,
    quantiles,
)
from jblast.study.flights import fly
from jblast.vehicle import (
    CONTROLLERS,
    Gust,
    PositionHold,
    State,
    Trajectory,
    blast_load,
    flight_metrics,
    named,
    named_gains,
    path_error,
    simulate,
)

RESULTS = Path(__file__).parent / "results"
MASS_KG, HEIGHT_M, SECONDS, BLAST_S, STEP_S = 1.0, 2.0, 12.0, 5.0, 2e-4
DISTANCES_M = np.array([3.0, 4.0, 5.0, 7.0, 10.0, 14.0, 20.0, 30.0])
VEHICLES = ("crazyflie", "hummingbird", "iris")
PARTS = {
    "front alone": {"drag": False, "rotors": False},
    "and drag of the body": {"rotors": False},
    "and the rotors": {},
}
TOLERANCE_M = 0.01
WIND_M_S = 3.0


class Row(NamedTuple):
    """What became of the vehicles at each distance, by one part of the load."""

    peak_m: Float[np.ndarray, " distance"]
    recovery_s: Float[np.ndarray, " distance"]
    crashed: np.ndarray


COUNT, CONTROLLER_STEP_S = 500, 2e-3
SCENE = """[charge]
mass_kg = {{ loguniform = [1.0, 10.0] }}
position_m = [{{ loguniform = [3.0, 30.0] }}, 0.0, 0.0]
time_s = 2.0

[air]
wind_m_s = [{{ uniform = [-3.0, 3.0] }}, {{ uniform = [-3.0, 3.0] }}]

[vehicle]
model = "{vehicle}"
position_m = [0.0, 0.0, 3.0]
"""


MASSES_KG = (1.0, 5.0, 20.0, 50.0)
EACH = 16
"""Vehicles for each mass."""
ESTIMATED_BLAST_S, ESTIMATED_SECONDS = 6.0, 14.0


def held(
    name: str, distances_m: np.ndarray, *, integral: bool, wind_m_s: float, **parts: Any
) -> tuple[Trajectory, Row]:
    """Fly vehicles of a name, one at each distance, through the blast."""
    vehicle, count = named(name), len(distances_m)
    place = np.stack([distances_m, np.zeros(count), np.full(count, HEIGHT_M)], axis=-1)
    hover = float(np.sqrt(vehicle.mass_kg * 9.81 / 4 / vehicle.thrust_coefficient))
    still, level = np.zeros((count, 3)), np.tile([0.0, 0.0, 0.0, 1.0], (count, 1))
    state = State(place, still, level, still, np.full((count, 4), hover))
    gains = jax.tree.map(
        lambda x: jnp.broadcast_to(x, (count, *x.shape)),
        named_gains(name, integral=integral),
    )
    charge = Charge(mass_kg=MASS_KG, time_s=BLAST_S)
    load = blast_load(Scene(charge, air=Air(wind_north=wind_m_s)), **parts)
    flown = simulate(
        vehicle,
        state,
        duration_s=SECONDS,
        step_s=STEP_S,
        control=PositionHold(place, gains, np.zeros(count)),
        wind=Gust([0.0, wind_m_s, 0.0], -1.0),
        loads=(load,),
        ground_up_m=0.0,
        store_every=25,
        backend="warp:cpu",
    )
    told = flight_metrics(
        flown,
        place[:, None],
        load.arrival_time_s(jnp.asarray(place))[:, 0],
        tolerance_m=TOLERANCE_M,
        ground_up_m=0.0,
    )
    found = (told.peak_deviation_m, told.recovery_time_s, told.crashed)
    return flown, Row(*(np.asarray(x) for x in found))


def flights_text() -> str:
    """Fly and return the table."""
    head = "".join(f"{d:9.3g} m" for d in DISTANCES_M)
    lines = [
        f"{MASS_KG:g} kg of TNT, vehicles that hold their place without integral "
        "action, by distance",
        f"peak deviation [mm]{'':20}{head}",
    ]
    for name in VEHICLES:
        for label, parts in PARTS.items():
            _, row = held(name, DISTANCES_M, integral=False, wind_m_s=0.0, **parts)
            lines.append(f"{name:12}{label:27}{_cells(1e3 * row.peak_m, row.crashed)}")
    lines += ["", f"back within {1e3 * TOLERANCE_M:g} mm after [s]{'':17}{head}"]
    for name in VEHICLES:
        for integral in (False, True):
            _, row = held(name, DISTANCES_M, integral=integral, wind_m_s=0.0)
            label = "with integral action" if integral else "without"
            lines.append(f"{name:12}{label:27}{_cells(row.recovery_s, row.crashed)}")
    return "\n".join(lines)


def _cells(values: np.ndarray, crashed: np.ndarray) -> str:
    return "".join(
        f"{'crash':>11}" if down else f"{value:11.3g}"
        for value, down in zip(values, crashed, strict=True)
    )


def flights_figure() -> Figure:
    """Return peak deviations by distance, and a path error in wind over time."""
    figure = new_figure(10.5, 4.2)
    figure.set_layout_engine(ConstrainedLayoutEngine(w_pad=0.12))
    peaks, errors = figure.subplots(1, 2)
    for colour, name in zip(COLOURS, VEHICLES, strict=False):
        for parts, style in ((PARTS["front alone"], "--"), ({}, "-")):
            _, row = held(name, DISTANCES_M, integral=False, wind_m_s=0.0, **parts)
            stands = ~row.crashed
            label = name.capitalize() if style == "-" else None
            x, y = DISTANCES_M[stands], 1e3 * row.peak_m[stands]
            peaks.loglog(x, y, style, color=colour, label=label)
    log_ticks(peaks.xaxis, peaks.get_xlim())
    log_ticks(peaks.yaxis, peaks.get_ylim())
    peaks.legend(frameon=False)
    peaks.set_xlabel("distance [m]")
    peaks.set_ylabel("peak deviation [mm]")
    titled(peaks, "The wind moves it, not the front")
    peaks.text(
        0.02, 0.03, "dashed: the front alone", transform=peaks.transAxes, color=MUTED
    )
    near = np.array([5.0])
    for colour, integral in zip(COLOURS, (False, True), strict=False):
        flown, _ = held("crazyflie", near, integral=integral, wind_m_s=WIND_M_S)
        error = path_error(flown, np.array([5.0, 0.0, HEIGHT_M]))[0]
        label = "with integral action" if integral else "without"
        errors.plot(flown.time_s, 1e3 * error, color=colour, label=label)
    errors.set_xlabel(f"time [s]; {MASS_KG:g} kg at 5 m goes off at {BLAST_S:g} s")
    errors.set_ylabel("path error [mm]")
    errors.set_ylim(0, None)
    errors.legend(frameon=False)
    titled(errors, f"A Crazyflie in a wind of {WIND_M_S:g} m/s")
    for axes in (peaks, errors):
        quiet(axes)
    return figure


def main() -> None:
    """Print the table and draw the figure."""
    with jax.enable_x64(True):
        print(flights_text())
        flights_figure().savefig(RESULTS / "flights.png")


def flown(vehicle: str) -> Flights:
    """Fly a vehicle by every controller."""
    import_module("tests.extensions.observer")  # registers its controller
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "scene.toml"
        file.write_text(SCENE.format(vehicle=vehicle), encoding="utf-8")
        scene = read_scene(str(file))
    options = {"seconds": 8.0, "step_s": CONTROLLER_STEP_S, "backend": "jax"}
    return fly(scene, vehicles=COUNT, controllers=tuple(CONTROLLERS), **options)


def rows(flights: Flights) -> list[tuple[str, ...]]:
    """Return a row a controller; the peak deviation is of those that fly on."""
    found: list[tuple[str, ...]] = []
    for name, held in flights.holds.items():
        on = flies_on(held)
        peak = metric(held, "peak_deviation_m")[on]
        back = metric(held, "recovery_time_s")[on]
        low, middle, high = quantiles(peak)
        found.append(
            (
                flights.vehicle.model,
                hold_words(name),
                f"{100 * on.mean():.1f} %",
                f"{middle:.3f} ({low:.3f} to {high:.3f})",
                f"{np.median(back):.2f}",
                f"{100 * np.isfinite(back).mean():.1f} %",
            )
        )
    return found


def controllers() -> None:
    """Fly, print, draw."""
    start_jax(all_cores=True)
    head = (
        "vehicle",
        "held",
        "flies on",
        "peak deviation [m] (5 to 95 %)",
        "recovery [s], median",
        "recovered",
    )
    every = [flown(vehicle) for vehicle in VEHICLES]
    print(f"{COUNT} blasts a vehicle, 8 s, steps of {CONTROLLER_STEP_S:g} s")
    print("\n".join(aligned([head, *(row for one in every for row in rows(one))])))
    distribution_figure(every[-1]).savefig(RESULTS / "controllers.png")


def estimator() -> None:
    """Fly by the estimate and by the truth, and print the table."""
    start_jax(all_cores=True)
    lines = [
        f"{EACH} Iris a row, hold with integral action, blast at "
        f"{ESTIMATED_BLAST_S:g} s; errors of the estimate",
        "in the second before it and greatest in 8 s after: median (greatest)",
        "mass [kg]  front [kPa]  place before [m]  after [m]     velocity before "
        "[m/s]  after [m/s]    attitude before [mrad]  after [mrad]  "
        "hold off by [m]  by the truth [m]",
    ]
    for mass in MASSES_KG:
        spec = VehicleSpec("iris", position=np.array([8.0, 0.0, 10.0]), integral=True)
        scene = Scene(Charge(mass, time_s=ESTIMATED_BLAST_S), vehicle=spec)
        uncertain = UncertainScene(scene, {"charge_mass_kg": Normal(mass, mass / 1e3)})
        found = [
            fly(
                uncertain,
                vehicles=EACH,
                seconds=ESTIMATED_SECONDS,
                step_s=0.004,
                estimator=flown_by,
            ).holds["with_integral"]
            for flown_by in ("ekf", "")
        ]
        thrown = found[0].thrown
        assert thrown is not None
        cells = [
            _both(values[:, 0] * (1e3 if name.endswith("rad") else 1.0))
            for name, values in thrown._asdict().items()
        ]
        off = [_both(each.metrics.peak_deviation_m) for each in found]
        front = float(np.median(found[0].encounter.overpressure_pa)) / 1e3
        lines.append("  ".join([f"{mass:<9g}", f"{front:<11.3g}", *cells, *off]))
    print("\n".join(lines))


def _both(values: object) -> str:
    known = np.asarray(values)
    return f"{np.median(known):.3g} ({known.max():.3g})"


if __name__ == "__main__":
    run_part(
        {
            "blast": main,
            "controllers": controllers,
            "estimator": estimator,
        }
    )
