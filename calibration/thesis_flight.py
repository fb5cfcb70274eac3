"""Figures 4.1 and 4.2 of the thesis, drawn again: a camera in flight, in both modes.

It flies past and rolls by 12 degrees, so that what stands still gives events, too.
"""

import jax.numpy as jnp
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import SubFigure

from jblast.report.figure_style import BLUE, GRID, MUTED, VERMILLION, titled
from jblast.scene import Camera, Charge, Scene, look_at
from jblast.scene.camera import quaternion_product
from jblast.sensors.camera import (
    CameraPath,
    ExplosionViews,
    ideal_events,
    linear_to_srgb,
    log_intensity,
    luminance,
    render_carried,
)
from jblast.sensors.camera.surroundings import landscape

MASS_KG, ROLL = 100.0, np.radians(12.0)
WIDTH, HEIGHT, FOCAL = 240, 160, 260.0
INSTANTS_S, WINDOW_S, STEPS = (0.03, 0.25, 1.2), 1.0 / 30.0, 16
"""Frames, and events of the window before each, gathered over so many steps."""
TWO = ListedColormap([VERMILLION, "white", BLUE])


def flight() -> CameraPath:
    """Return a flight past the blast, looking at it and rolling from side to side."""
    time = np.linspace(-0.1, 1.3, 29)
    places = np.stack([-6.0 + 8.0 * time, -55.0 + 0 * time, 6.0 + time], axis=-1)
    turns = []
    for instant, place in zip(time, places, strict=True):
        looks = look_at(place, np.array([0.0, 0.0, 7.0]))
        half = 0.5 * ROLL * np.cos(np.pi * instant / 1.2)
        roll = np.array([0.0, 0.0, np.sin(half), np.cos(half)])  # about the lens's axis
        turns.append(quaternion_product(jnp.asarray(looks), jnp.asarray(roll)))
    return CameraPath(jnp.asarray(time), jnp.asarray(places), jnp.stack(turns))


def draw_4_1_and_4_2(part: SubFigure, views: ExplosionViews) -> list[tuple[int, ...]]:
    """Draw three frames and their events; return how many brighter and darker."""
    camera = Camera(
        position=np.zeros(3),
        quaternion=np.array([0.0, 0.0, 0.0, 1.0]),
        focal=np.array([FOCAL, FOCAL]),
        center=np.array([(WIDTH - 1) / 2, (HEIGHT - 1) / 2]),
        width=WIDTH,
        height=HEIGHT,
        mount="vehicle",
    )
    # ground with something on it, as a screenshot of a simulator has
    field = np.random.default_rng(0).uniform(0.06, 0.2, (64, 64, 1))
    behind = landscape(field * np.array([1.0, 0.9, 0.72]), metres_per_pixel=1.5)
    scene, path = Scene(charge=Charge(mass_kg=MASS_KG)), flight()
    above, below = part.subplots(2, len(INSTANTS_S))
    counts = []
    for instant, frame_axes, event_axes in zip(INSTANTS_S, above, below, strict=True):
        times = jnp.linspace(instant - WINDOW_S, instant, STEPS)
        film = render_carried(
            scene, camera, path, times, background=behind, views=views
        )
        light = np.clip(np.asarray(film[-1]), 0.0, 1.0)
        frame_axes.imshow(np.asarray(linear_to_srgb(light)))
        found = ideal_events(
            log_intensity(luminance(film)), times, (0.2, 0.2), capacity=1 << 20
        )
        whole = int(found.count)
        x, y, sign = (np.asarray(v)[:whole] for v in (found.x, found.y, found.polarity))
        net = np.zeros((HEIGHT, WIDTH), int)
        np.add.at(net, (y, x), sign)
        event_axes.imshow(np.sign(net), cmap=TWO, vmin=-1, vmax=1)
        counts.append((int((sign > 0).sum()), int((sign < 0).sum())))
        frame_axes.set_xlabel(f"{instant:g} s", fontsize=9, color=MUTED)
        event_axes.set_xlabel(f"{whole:,} events", fontsize=9, color=MUTED)
        framed(frame_axes)
        framed(event_axes)
    titled(above[0], "Figure 4.1")
    titled(below[0], "Figure 4.2")
    titled(above[-1], "", "RGB mode")
    titled(below[-1], "", "event mode: blue brighter on balance, red darker")
    return counts


def framed(axes: Axes) -> None:
    """Leave a picture its frame alone."""
    axes.set(xticks=[], yticks=[])
    axes.spines[:].set_color(GRID)
