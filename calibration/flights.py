"""What one blast does to quadrotors that hold their place: what moves them, how far.

python -m calibration.flights --out FIGURE.png

A kilogram of TNT on the ground, vehicles 2 m above it at some distances, for
12 s; and one of them in a steady wind. By the kernel of Warp in float64.
"""

import argparse
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine

from jblast.report.figure_style import (
    COLOURS,
    MUTED,
    log_ticks,
    new_figure,
    quiet,
    titled,
)
from jblast.scene import Air, Charge, Scene
from jblast.vehicle import (
    Each,
    PositionHold,
    State,
    StepGust,
    Trajectory,
    blast_load,
    flight_metrics,
    named,
    named_gains,
    path_error,
    simulate,
)

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
    load = blast_load(Scene(charge=charge, air=Air(wind_north=wind_m_s)), **parts)
    flown = simulate(
        vehicle,
        state,
        duration_s=SECONDS,
        step_s=STEP_S,
        control=Each(PositionHold(place, gains, np.zeros(count))),
        wind=StepGust([0.0, wind_m_s, 0.0], -1.0),
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
    """Print the table; draw the figure where a file is named."""
    parser = argparse.ArgumentParser(description="What a blast does to quadrotors.")
    parser.add_argument("--out", metavar="FIGURE.png")
    out = parser.parse_args().out
    with jax.enable_x64(True):
        print(flights_text())
        if out:
            flights_figure().savefig(out)


if __name__ == "__main__":
    main()
