"""A blast's first events, with and without the light that it throws on the ground.

python -m calibration.flash --out FIGURE.png > TABLE.txt
"""

import argparse
import sys
import time
from functools import partial
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from calibration.eyes import picture
from jblast.report.figure_style import (
    COLOURS,
    GRID,
    INK,
    MUTED,
    new_figure,
    quiet,
    titled,
)
from jblast.scene import Camera, Charge, Scene
from jblast.scene.camera import look_at
from jblast.sensors.camera import Appearance, Events, landscape, render_events
from jblast.sensors.camera.geometry import Surfaces, pixel_rays
from jblast.sensors.camera.image import luminance
from jblast.sensors.camera.surroundings import flash

MASS, DISTANCES, UNTIL = 15.0, (20.0, 40.0, 80.0), 2e-3
"""Kilograms of TNT on the ground, metres to cameras, and seconds of events."""

WIDTH, HEIGHT, FOCAL = 160, 120, 140.0
PLACES = (5.0, 10.0, 20.0, 40.0, 80.0)
"""Of ground that is lit, from the charge [m]."""

TIMES = np.geomspace(1e-4, 1.0, 120)
SCENE = Scene(charge=Charge(mass_kg=MASS))


class FirstEvents(NamedTuple):
    """What one camera sends, and how far away it is [m]."""

    distance: float
    without: Events
    lit: Events


def first_events(distance: float) -> FirstEvents:
    """Return the events of the first instants at a distance."""
    place = np.array([0.0, -distance, 6.0])
    camera = Camera(
        position=place,
        quaternion=look_at(place, np.array([0.0, 0.0, 2.0])),
        focal=np.full(2, FOCAL),
        center=np.array([(WIDTH - 1) / 2, (HEIGHT - 1) / 2]),
        width=WIDTH,
        height=HEIGHT,
    )
    behind = landscape().light(pixel_rays(camera), jnp.asarray(1.0 / FOCAL))
    solved = partial(
        render_events,
        SCENE,
        camera,
        np.array([0.0, UNTIL]),
        background=jnp.moveaxis(behind, 0, -1),
        tolerance=1e-6,
    )
    without = solved(appearance=Appearance(flash=False))
    return FirstEvents(distance, without, solved(appearance=Appearance()))


def brightening() -> np.ndarray:
    """Return the fire's light over that of full sun on level ground, (time, place)."""
    place = np.zeros((3, 1, len(PLACES)))
    place[1, 0] = PLACES
    up = np.broadcast_to(np.array([0.0, 0.0, 1.0])[:, None, None], place.shape)
    ground = Surfaces(
        jnp.asarray(place), jnp.asarray(up), jnp.ones((1, len(PLACES)), bool)
    )

    @eqx.filter_jit
    def at(instant):
        return luminance(
            jnp.moveaxis(flash(SCENE, ground, instant, Appearance()), 0, -1)
        )

    return np.asarray(jax.lax.map(at, jnp.asarray(TIMES)))[:, 0]


def flash_figure(seen: list[FirstEvents], light: np.ndarray) -> Figure:
    """Draw pictures of events to the left, light on the ground to the right."""
    figure = new_figure(12.0, 4.0)
    halves = figure.subfigures(1, 2, width_ratios=[7.6, 4.4], squeeze=False)
    left, right = halves.flat
    panels = left.subplots(2, len(seen), squeeze=False)
    for camera, (above, below) in zip(seen, panels.T, strict=True):
        draw_events(above, camera.without)
        draw_events(below, camera.lit)
        above.set_title(f"{camera.distance:g} m", fontsize=10, color=INK)
    for axes, words in zip(
        panels[:, 0], ("the ball alone", "and its light"), strict=True
    ):
        axes.set_ylabel(words, fontsize=10, color=INK)
    axes = right.subplots()
    for place, colour, row in zip(PLACES, COLOURS, light.T, strict=False):
        axes.plot(TIMES, row, color=colour, lw=1.6, label=f"{place:g} m")
    axes.set(
        xscale="log",
        yscale="log",
        xlabel="time after detonation (s)",
        ylabel="light of the fire / full sun",
        xlim=(TIMES[0], TIMES[-1]),
        ylim=(1e-5, 1e2),
    )
    axes.legend(frameon=False, fontsize=9, ncols=2, loc="upper left")
    quiet(axes)
    titled(axes, "On the ground", f"{MASS:g} kg of TNT")
    return figure


def draw_events(axes: Axes, events: Events) -> None:
    """Draw a picture of events, and say how many they are."""
    axes.imshow(picture(events, 0.0, UNTIL, (HEIGHT, WIDTH)))
    axes.set(xticks=[], yticks=[])
    axes.spines[:].set_color(GRID)
    axes.set_xlabel(f"{int(events.count):,} events", fontsize=9, color=MUTED)


def table(seen: list[FirstEvents], light: np.ndarray) -> str:
    """Return the counts of events, and the greatest light at each place."""
    lines = [
        f"Events of the first {1e3 * UNTIL:g} ms",
        "from (m)  ball alone  and its light",
    ]
    lines += [
        f"{camera.distance:g} m: {int(camera.without.count)} {int(camera.lit.count)}"
        for camera in seen
    ]
    lines += [
        "",
        "Greatest light on the ground over full sun",
        "at (m)  times  after (s)",
    ]
    most = np.argmax(light, axis=0)
    lines += [
        f"{place:g} m: {light[at, column]:.3g} {TIMES[at]:.3g}"
        for column, (place, at) in enumerate(zip(PLACES, most, strict=True))
    ]
    return "\n".join(lines) + "\n"


def main() -> None:
    """Draw the figure and print its numbers."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", required=True, metavar="FIGURE.png")
    out = parser.parse_args().out
    begun = time.process_time()
    with jax.enable_x64(True):
        light = brightening()
        seen = [first_events(distance) for distance in DISTANCES]
    flash_figure(seen, light).savefig(out)
    sys.stdout.write(table(seen, light))
    print(f"{time.process_time() - begun:.0f} s of CPU", file=sys.stderr)


if __name__ == "__main__":
    main()
