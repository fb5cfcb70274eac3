"""The same blast seen from three distances: frames, events, and how many there are.

python -m calibration.eyes --out FIGURE.png
"""

import argparse
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine

from jblast.report.figure_style import (
    BLUE,
    COLOURS,
    GRID,
    INK,
    MUTED,
    VERMILLION,
    new_figure,
    quiet,
    titled,
)
from jblast.scene import Camera, Charge, Scene
from jblast.scene.camera import look_at
from jblast.sensors.camera import Events, render, render_events
from jblast.sensors.camera.files.images import srgb_bytes

MASS, DISTANCES = 100.0, (60.0, 120.0, 240.0)
"""Kilograms of TNT on the ground, and metres from there to the camera."""

INSTANTS = np.array([0.002, 0.02, 0.1, 0.4, 1.0, 2.5])
WIDTH, HEIGHT, FOCAL = 320, 190, 420.0
GROUND, SKY = 0.12, 0.45
"""Light of the ground and of the sky at the horizon, full scale 1."""

WINDOW = 0.3
"""A picture of events shows those of the last part of its time before it."""

TIMES = np.geomspace(1e-4, 3.0, 160)


class Seen(NamedTuple):
    """What one camera saw: frames in linear light, events, and over what."""

    distance: float
    frames: np.ndarray
    events: Events


def camera_at(distance: float) -> Camera:
    """Return a camera at the height of a man, looking level at where the blast is."""
    place = np.array([0.0, -distance, 1.7])
    return Camera(
        position=place,
        quaternion=look_at(place, np.array([0.0, 0.0, 0.06 * distance + 1.7])),
        focal=np.array([FOCAL, FOCAL]),
        center=np.array([(WIDTH - 1) / 2, (HEIGHT - 1) / 2]),
        width=WIDTH,
        height=HEIGHT,
    )


def landscape(camera: Camera) -> np.ndarray:
    """Return even ground and a sky that darkens upwards, (height, width, 3)."""
    rise = (camera.center[1] - np.arange(HEIGHT)) / FOCAL + 0.06
    sky = np.array([0.55, 0.75, 1.0]) * (SKY * np.exp(-np.abs(rise) / 0.6))[:, None]
    ground = np.array([1.0, 0.88, 0.7]) * np.full((HEIGHT, 1), GROUND)
    rows = np.where((rise > 0)[:, None], sky, ground)
    return np.repeat(rows[:, None], WIDTH, axis=1)


def seen_from(distance: float) -> Seen:
    """Return what a camera at a distance sees of the blast."""
    scene = Scene(charge=Charge(mass_kg=MASS))
    camera = camera_at(distance)
    behind = jnp.asarray(landscape(camera))
    frames = render(scene, camera, INSTANTS, background=behind, supersample=2)
    events = render_events(scene, camera, TIMES, background=behind)
    return Seen(distance, np.asarray(frames), events)


def eyes_figure(cameras: list[Seen]) -> Figure:
    """Draw a row of frames and a row of events for each, and the rates of all."""
    figure = new_figure(12.0, 2.35 * len(cameras) + 2.8)
    engine = figure.get_layout_engine()
    assert isinstance(engine, ConstrainedLayoutEngine)
    engine.set(w_pad=0.05, h_pad=0.02, wspace=0.0, hspace=0.0)
    heights = [2.35 * len(cameras), 2.8]
    films, rates = figure.subfigures(2, 1, height_ratios=heights, squeeze=False).flat
    panels = films.subplots(2 * len(cameras), len(INSTANTS), squeeze=False)
    for axes in panels.flat:
        axes.set(xticks=[], yticks=[])
        axes.spines[:].set_color(GRID)
    for axes, time in zip(panels[0], INSTANTS, strict=True):
        axes.set_title(f"{time:g} s", fontsize=10, color=INK)
    for row, seen in enumerate(cameras):
        above, below = panels[2 * row], panels[2 * row + 1]
        above[0].set_ylabel(f"{seen.distance:g} m", fontsize=11, color=INK)
        below[0].set_ylabel("events", fontsize=9, color=MUTED)
        for column, time in enumerate(INSTANTS):
            above[column].imshow(srgb_bytes(np.asarray(seen.frames[column])))
            below[column].imshow(picture(seen.events, (1 - WINDOW) * time, time))
    axes = rates.subplots()
    edges = np.geomspace(TIMES[0], TIMES[-1], 60)
    for seen, colour in zip(cameras, COLOURS[2:], strict=False):
        counts, _ = np.histogram(seen.events.time, edges)
        axes.stairs(
            counts / np.diff(edges),
            edges,
            color=colour,
            lw=1.6,
            label=f"{seen.distance:g} m: {int(seen.events.count):,} events",
        )
    axes.set(
        xscale="log",
        yscale="log",
        xlabel="time after detonation (s)",
        ylabel="events/s",
    )
    axes.set_xlim(edges[0], edges[-1])
    axes.legend(frameon=False, fontsize=9, ncols=3)
    quiet(axes)
    titled(
        axes,
        "Events a second",
        f"{MASS:g} kg of TNT; in the pictures those of the last {100 * WINDOW:g} % of "
        "the time, blue brighter, red darker",
    )
    return figure


def picture(
    events: Events, start: float, stop: float, size: tuple[int, int] = (HEIGHT, WIDTH)
) -> np.ndarray:
    """Return an image of some events: blue brighter, red darker, white none."""
    within = (events.time > start) & (events.time <= stop)
    image = np.ones((*size, 3))
    for sign, colour in ((1, BLUE), (-1, VERMILLION)):
        chosen = within & (events.polarity == sign)
        rgb = [int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5)]
        image[events.y[chosen], events.x[chosen]] = rgb
    return image


def main() -> None:
    """Draw the figure."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", required=True, metavar="FIGURE.png")
    out = parser.parse_args().out
    with jax.enable_x64(True):
        figure = eyes_figure([seen_from(distance) for distance in DISTANCES])
    figure.savefig(out)


if __name__ == "__main__":
    main()
