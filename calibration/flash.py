"""A blast's first events, with and without the light that it throws on the ground.

    python -m calibration.flash --out FIGURE.png > calibration/results/flash.txt
    python -m calibration.flash distances --out FIGURE.png

Distances: the same blast seen from three distances: frames, events, and how many there
are.
"""

import argparse
import sys
import time
from dataclasses import replace
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine

from calibration import run_part
from jblast.report.colours import BLUE, COLOURS, GRID, INK, MUTED, VERMILLION
from jblast.report.figures import new_figure, quiet, titled
from jblast.scene import Camera, Charge, Scene
from jblast.scene.camera import look_at
from jblast.sensors.camera import (
    Appearance,
    Events,
    film_events,
    joined,
    landscape,
    render,
)
from jblast.sensors.camera.files.images import srgb_bytes
from jblast.sensors.camera.film import Film
from jblast.sensors.camera.fireball import cloud, glow
from jblast.sensors.camera.geometry import Surfaces, pixel_rays
from jblast.sensors.camera.image import luminance
from jblast.sensors.camera.surroundings import disc_light, sphere_factor

SEEN_MASS, SEEN_FROM = 100.0, (60.0, 120.0, 240.0)
"""Kilograms of TNT on the ground, and metres from there to the camera."""

INSTANTS = np.array([0.002, 0.02, 0.1, 0.4, 1.0, 2.5])
FRAME_WIDTH, FRAME_HEIGHT, FRAME_FOCAL = 320, 190, 420.0
GROUND, SKY = 0.12, 0.45
"""Light of the ground and of the sky at the horizon, full scale 1."""

WINDOW = 0.3
"""A picture of events shows those of the last part of its time before it."""

SEEN_TIMES = np.geomspace(1e-4, 3.0, 160)


class Seen(NamedTuple):
    """What one camera saw: frames in linear light, events, and over what."""

    distance: float
    frames: np.ndarray
    events: Events


MASS, DISTANCES, UNTIL = 15.0, (20.0, 40.0, 80.0), 2e-3
"""Kilograms of TNT on the ground, metres to cameras, and seconds of events."""

WIDTH, HEIGHT, FOCAL = 160, 120, 140.0
PLACES = (5.0, 10.0, 20.0, 40.0, 80.0)
"""Of ground that is lit, from the charge [m]."""

TIMES = np.geomspace(1e-4, 1.0, 120)
SCENE = Scene(Charge(mass_kg=MASS))


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
    film = Film(
        SCENE, camera, np.array([0.0, UNTIL]), np.moveaxis(np.asarray(behind), 0, -1)
    )
    without, lit = (
        joined(film_events(replace(film, appearance=Appearance(flash=flash))))
        for flash in (False, True)
    )
    return FirstEvents(distance, without, lit)


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
        look, charge = Appearance(), SCENE.charges[0]
        ball = cloud(charge, instant, SCENE.air)
        light = disc_light(ball, glow(ball.temperature, ball.air, look), look)
        share = sphere_factor(ball.centre, ball.radius, ground)
        return luminance(light / look.daylight) * share

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


def level_camera(distance: float) -> Camera:
    """Return a camera at the height of a man, looking level at where the blast is."""
    place = np.array([0.0, -distance, 1.7])
    return Camera(
        position=place,
        quaternion=look_at(place, np.array([0.0, 0.0, 0.06 * distance + 1.7])),
        focal=np.array([FRAME_FOCAL, FRAME_FOCAL]),
        center=np.array([(FRAME_WIDTH - 1) / 2, (FRAME_HEIGHT - 1) / 2]),
        width=FRAME_WIDTH,
        height=FRAME_HEIGHT,
    )


def ground_and_sky(camera: Camera) -> np.ndarray:
    """Return even ground and a sky that darkens upwards, (height, width, 3)."""
    rise = (camera.center[1] - np.arange(FRAME_HEIGHT)) / FRAME_FOCAL + 0.06
    sky = np.array([0.55, 0.75, 1.0]) * (SKY * np.exp(-np.abs(rise) / 0.6))[:, None]
    ground = np.array([1.0, 0.88, 0.7]) * np.full((FRAME_HEIGHT, 1), GROUND)
    rows = np.where((rise > 0)[:, None], sky, ground)
    return np.repeat(rows[:, None], FRAME_WIDTH, axis=1)


def seen_from(distance: float) -> Seen:
    """Return what a camera at a distance sees of the blast."""
    scene = Scene(Charge(mass_kg=SEEN_MASS))
    camera = level_camera(distance)
    behind = jnp.asarray(ground_and_sky(camera))
    frames = render(scene, camera, INSTANTS, background=behind)
    film = Film(scene, camera, SEEN_TIMES, np.asarray(behind))
    events = joined(film_events(film))
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
    for axes, instant in zip(panels[0], INSTANTS, strict=True):
        axes.set_title(f"{instant:g} s", fontsize=10, color=INK)
    for row, seen in enumerate(cameras):
        above, below = panels[2 * row], panels[2 * row + 1]
        above[0].set_ylabel(f"{seen.distance:g} m", fontsize=11, color=INK)
        below[0].set_ylabel("events", fontsize=9, color=MUTED)
        for column, instant in enumerate(INSTANTS):
            above[column].imshow(srgb_bytes(np.asarray(seen.frames[column])))
            below[column].imshow(picture(seen.events, (1 - WINDOW) * instant, instant))
    axes = rates.subplots()
    edges = np.geomspace(SEEN_TIMES[0], SEEN_TIMES[-1], 60)
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
        f"{SEEN_MASS:g} kg of TNT; in the pictures those of the last "
        f"{100 * WINDOW:g} % of the time, blue brighter, red darker",
    )
    return figure


def picture(
    events: Events,
    start: float,
    stop: float,
    size: tuple[int, int] = (FRAME_HEIGHT, FRAME_WIDTH),
) -> np.ndarray:
    """Return an image of some events: blue brighter, red darker, white none."""
    within = (events.time > start) & (events.time <= stop)
    image = np.ones((*size, 3))
    for sign, colour in ((1, BLUE), (-1, VERMILLION)):
        chosen = within & (events.polarity == sign)
        rgb = [int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5)]
        image[events.y[chosen], events.x[chosen]] = rgb
    return image


def distances() -> None:
    """Draw the figure."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", required=True, metavar="FIGURE.png")
    out = parser.parse_args().out
    with jax.enable_x64(True):
        figure = eyes_figure([seen_from(distance) for distance in SEEN_FROM])
    figure.savefig(out)


if __name__ == "__main__":
    run_part({"ground": main, "distances": distances})
