"""From which kicks a position hold comes back: as it is, and as the bare law would.

python -m calibration.hold_recovery --out FIGURE.png

Vehicles hover 10 m up and are thrown upwards and sideways, or upwards while they turn
about a body axis. Each has 12 s to come back. It has recovered if it never touched the
ground or turned over, body z below the horizon, and ends within 0.25 m of its place.
Beside the hold stands the law of Lee and others by itself: without limits, rotors
clipped by the motors. With integral action, steps of 4 ms by RK4, in float64.
"""

import argparse
import dataclasses
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure

from jblast.cli.jax_start import start_jax
from jblast.report.figure_style import new_figure, quiet
from jblast.vehicle import (
    Each,
    Gains,
    PositionHold,
    State,
    Vehicle,
    named,
    named_gains,
    rotor_speeds,
    simulate,
)

NAMES = ("crazyflie", "hummingbird", "iris")
HOME = np.array([0.0, 0.0, 10.0])
SECONDS, STEP_S, NEAR_M = 12.0, 4e-3, 0.25
LEVELS = np.linspace(0.0, 10.0, 11)
"""Of a speed [m/s] or a body rate [rad/s]."""
WAYS = {
    "sideways [m/s]": (np.array([1.0, 0.0, 0.0]), np.zeros(3)),
    "roll rate [rad/s]": (np.zeros(3), np.array([1.0, 0.0, 0.0])),
    "pitch and yaw rate, each [rad/s]": (np.zeros(3), np.array([0.0, 1.0, 1.0])),
}
"""Velocity and body rate of one unit across; the other axis is the speed upwards."""
CRASHED, OVER, AWAY, BACK = range(4)
WORDS = ("hit the ground", "turned over, came back", "not back yet", "recovered")
COLOURS = ("#b2182b", "#ef8a62", "#fddbc7", "#2166ac")


class BareHold(eqx.Module):
    """Lee, Leok and McClamroch (2010) as printed, of whatever the motors cannot do."""

    target_m: Any
    gains: Gains

    def start(self) -> Any:
        """Return the integral at the start."""
        return jnp.zeros(3)

    def __call__(
        self, time_s: Any, state: State, vehicle: Vehicle, memory: Any, period_s: Any
    ) -> Any:
        """Return rotor speeds, and the integral afterwards."""
        k, away = self.gains, state.position_m - self.target_m
        limit = k.integral_limit
        total = jnp.clip(memory - k.integral * period_s * away, -limit, limit)
        asked = total - k.position * away - k.velocity * state.velocity_m_s
        pull = asked + jnp.array([0.0, 0.0, 9.81])
        q = state.quaternion / jnp.linalg.norm(state.quaternion)
        v, s = q[:3], q[3]
        cross = jnp.cross(jnp.eye(3), v)
        attitude = (2 * s * s - 1) * jnp.eye(3) + 2 * s * cross + 2 * jnp.outer(v, v)
        b_3 = pull / jnp.linalg.norm(pull)
        b_2 = jnp.cross(b_3, jnp.array([1.0, 0.0, 0.0]))
        b_2 = b_2 / jnp.linalg.norm(b_2)
        wanted = jnp.stack([jnp.cross(b_2, b_3), b_2, b_3], axis=1)
        skew = (wanted.T @ attitude - attitude.T @ wanted) / 2
        error = jnp.stack([skew[2, 1], skew[0, 2], skew[1, 0]])
        w, inertia = state.body_rate_rad_s, vehicle.inertia_kg_m2
        turn = inertia @ (-k.attitude * error - k.body_rate * w)
        moment = turn + jnp.cross(w, inertia @ w)
        thrust = vehicle.mass_kg * jnp.dot(pull, attitude[:, 2])
        return rotor_speeds(vehicle, (thrust, *moment)), total


def outcomes(name: str, *, bare: bool) -> np.ndarray:
    """Return what becomes of a vehicle: by way, speed upwards, the other axis."""
    vehicle = dataclasses.replace(named(name), name="", body=None)
    gains = named_gains(name, integral=True)
    up, other = (x.ravel() for x in np.meshgrid(LEVELS, LEVELS, indexing="ij"))
    velocity = [np.outer(other, v) + np.outer(up, [0, 0, 1]) for v, _ in WAYS.values()]
    rate = [np.outer(other, w) for _, w in WAYS.values()]
    count = len(WAYS) * up.size
    hover = float(np.sqrt(vehicle.mass_kg * 9.81 / 4 / vehicle.thrust_coefficient))
    start = State(
        np.tile(HOME, (count, 1)),
        np.concatenate(velocity),
        np.tile([0.0, 0.0, 0.0, 1.0], (count, 1)),
        np.concatenate(rate),
        np.full((count, 4), hover),
    )
    hold = (BareHold if bare else PositionHold)(jnp.asarray(HOME), gains)
    many = jax.tree.map(lambda x: jnp.broadcast_to(x, (count, *x.shape)), hold)
    flown = simulate(
        vehicle,
        start,
        duration_s=SECONDS,
        step_s=STEP_S,
        control=Each(many),
        ground_up_m=0.0,
        store_every=5,
        backend="jax",
    )
    i, j, _, _ = np.moveaxis(np.asarray(flown.quaternion), -1, 0)
    over = ~(2 * (i**2 + j**2) <= 1).all(axis=1)
    down = ~(np.asarray(flown.position_m)[..., 2] > 0).all(axis=1)
    end = np.asarray(flown.position_m)[:, -1] - HOME
    back = np.linalg.norm(end, axis=-1) < NEAR_M
    found = np.select([down, over & back, ~back], [CRASHED, OVER, AWAY], BACK)
    return found.reshape(len(WAYS), LEVELS.size, LEVELS.size)


def table(maps: dict[tuple[str, bool], np.ndarray]) -> str:
    """Return the shares of each outcome."""
    lines = [
        f"kicks and turns of 0 to {LEVELS[-1]:g}, {LEVELS.size} x {LEVELS.size} of "
        f"each; shares of them [%], {SECONDS:g} s later",
        f"{'vehicle':13}{'upwards and':34}{'hold':10}"
        + "".join(f"{word:>24}" for word in WORDS),
    ]
    for (name, bare), found in maps.items():
        for way, each in zip((*WAYS, "all of these"), (*found, found), strict=True):
            shares = [100 * np.mean(each == n) for n in range(len(WORDS))]
            cells = "".join(f"{share:24.1f}" for share in shares)
            law = "bare law" if bare else "ours"
            lines.append(f"{name:13}{way:34}{law:10}{cells}")
    return "\n".join(lines)


def figure_of(maps: dict[tuple[str, bool], np.ndarray]) -> Figure:
    """Return the maps: a row a vehicle, the bare law beside ours."""
    figure = new_figure(13.0, 7.4)
    columns = 2 * len(WAYS)
    panels = figure.subplots(len(NAMES), columns, sharex="col", sharey=True)
    colours = ListedColormap(COLOURS)
    for row, name in enumerate(NAMES):
        for column, way in enumerate(way for way in WAYS for _ in range(2)):
            axes, bare = panels[row, column], column % 2 == 0
            each = maps[name, bare][column // 2]
            axes.pcolormesh(
                LEVELS, LEVELS, each, cmap=colours, vmin=-0.5, vmax=3.5, linewidth=0
            )
            quiet(axes)
            axes.grid(False)
            axes.set_aspect("equal")
            axes.set_xticks([0, 5, 10])
            axes.set_yticks([0, 5, 10])
            if row == 0:
                axes.set_title("bare law" if bare else "ours", loc="left", fontsize=10)
            if row == len(NAMES) - 1:
                axes.set_xlabel(way.replace(", each", ""), fontsize=9)
        panels[row, 0].set_ylabel(f"{name.capitalize()}\nupwards [m/s]")
    marks = [
        figure.axes[0].plot([], [], "s", color=colour, markersize=9, label=word)[0]
        for colour, word in zip(COLOURS, WORDS, strict=True)
    ]
    figure.legend(handles=marks, loc="outside lower center", ncols=4, frameon=False)
    return figure


def main() -> None:
    """Print the table; draw the figure where a file is named."""
    parser = argparse.ArgumentParser(description="From which kicks a hold comes back.")
    parser.add_argument("--out", metavar="FIGURE.png")
    out = parser.parse_args().out
    start_jax(all_cores=False)
    maps = {
        (name, bare): outcomes(name, bare=bare)
        for name in NAMES
        for bare in (True, False)
    }
    print(table(maps))
    if out:
        figure_of(maps).savefig(out)


if __name__ == "__main__":
    main()
