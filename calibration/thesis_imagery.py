"""The thesis's pictures of its imagery, drawn again: its figures 3.3, 3.4, 4.1 and 4.2.

python -m calibration.thesis_imagery

- 3.3: an explosion made by Blender, and the frustum of the camera that views it: here
  one of the shipped set's 32, beside what it saw. Its background is transparent, for
  which the chequers stand.
- 3.4: the directions views are taken from, for various n: the Fibonacci lattice in the
  square of azimuth and height, and the spiral that it is on the hemisphere, seen from
  straight above so that equal areas are equal, with the least angle between two, which
  the thesis quotes as packing distance.
- 4.1, 4.2: three frames of the camera's two modes. The camera flies past and rolls by
  12 degrees, so that what stands still gives events, too. The thesis's events are the
  difference of frames over a threshold; ours are of the logarithm of light, pixel by
  pixel, of the thirtieth of a second before each frame.
"""

import argparse

import jax
import jax.numpy as jnp
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure, SubFigure
from matplotlib.offsetbox import AnnotationBbox, OffsetImage
from mpl_toolkits.mplot3d import Axes3D, proj3d
from mpl_toolkits.mplot3d.art3d import Line3DCollection

from calibration.bake import (
    GOLDEN_ANGLE,
    fibonacci_lattice,
    offset_lattice,
    packing_distance,
)
from jblast.cli.jax_start import start_jax
from jblast.files import write_text
from jblast.report.figure_files import write_figure
from jblast.report.figure_style import BLUE, GRID, MUTED, VERMILLION, new_figure, titled
from jblast.report.words import aligned
from jblast.scene import Camera, Charge, Scene, look_at
from jblast.scene.camera import quaternion_product
from jblast.sensors.camera import (
    CameraPath,
    ExplosionViews,
    explosion_views,
    ideal_events,
    linear_to_srgb,
    log_intensity,
    luminance,
    render,
    render_carried,
)
from jblast.sensors.camera.surroundings import landscape
from jblast.waves.fireball import fireball, fireball_duration

MASS_KG, ROLL = 100.0, np.radians(12.0)
WIDTH, HEIGHT, FOCAL = 240, 160, 260.0
INSTANTS_S, WINDOW_S, STEPS = (0.03, 0.25, 1.2), 1.0 / 30.0, 16
"""Frames, and events of the window before each, gathered over so many steps."""
TWO = ListedColormap([VERMILLION, "white", BLUE])


ORANGE = "#E69F00"
NUMBERS, LINED = (8, 32, 128, 512), 32
"""Of directions in figure 3.4, and to which the spiral is drawn as a line."""
SIZE = 160
"""Of figure 3.3's view [px]."""
EYE = (20.0, -60.0)
"""Elevation and azimuth from where figure 3.3 is drawn, as matplotlib's [deg]."""


def view_from(views: ExplosionViews, towards: np.ndarray, phase: float) -> np.ndarray:
    """Return sRGB and alpha of the explosion from a direction."""
    scene = Scene(charge=Charge(mass_kg=MASS_KG))
    instant = phase * float(fireball_duration(MASS_KG))
    radius = float(fireball(MASS_KG, instant).radius)
    place = 30.0 * radius * towards
    aim = np.array([0.0, 0.0, 0.8 * radius])
    camera = Camera(
        position=place,
        quaternion=look_at(place, aim),
        focal=np.array([9.0 * SIZE, 9.0 * SIZE]),
        center=np.array([(SIZE - 1) / 2, (SIZE - 1) / 2]),
        width=SIZE,
        height=SIZE,
    )
    (seen,) = render(
        scene, camera, np.array([instant]), views=views, ground=False, alpha=True
    )
    light, alpha = np.asarray(seen)[..., :3], np.asarray(seen)[..., 3:]
    straight = np.clip(light / np.maximum(alpha, 1e-3), 0.0, 1.0)
    return np.concatenate([np.asarray(linear_to_srgb(straight)), alpha], axis=-1)


def draw_3_3(part: SubFigure, views: ExplosionViews, phase: float = 0.12) -> None:
    """Draw the hemisphere of views, one camera's frustum, and what it sees."""
    space = part.add_subplot(1, 2, 1, projection="3d")
    assert isinstance(space, Axes3D)
    directions = np.asarray(views.direction)
    towards = directions[np.argmax(directions @ np.array([0.75, 0.35, 0.55]))]
    rim = np.linspace(0, 2 * np.pi, 100)
    space.plot(np.cos(rim), np.sin(rim), 0 * rim, color=MUTED, linewidth=0.8)
    for turn in np.arange(0, np.pi, np.pi / 6):
        up = np.linspace(0, np.pi, 60)
        arc = np.cos(up) * np.cos(turn), np.cos(up) * np.sin(turn), np.sin(up)
        space.plot(*arc, color=GRID, linewidth=0.8)
    space.scatter(*directions.T, color=BLUE, s=9, depthshade=True)
    eye = 1.0 * towards
    right = np.cross([0.0, 0.0, 1.0], towards)
    right /= np.linalg.norm(right)
    up = np.cross(towards, right)
    corners = [
        eye - 0.45 * towards + 0.17 * (a * right + b * up)
        for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))
    ]
    edges = [(eye, corner) for corner in corners]
    edges += [(corners[k], corners[(k + 1) % 4]) for k in range(4)]
    space.add_collection3d(Line3DCollection(edges, colors=ORANGE, linewidths=1.8))
    space.set(xlim=(-0.8, 0.8), ylim=(-0.8, 0.8), zlim=(0.0, 0.95))
    space.set_box_aspect((1.6, 1.6, 0.95), zoom=1)
    space.view_init(*EYE)
    space.set_axis_off()
    around, rise = np.radians(EYE[1]), np.radians(EYE[0])
    level = np.cos(rise)
    drawn_from = np.array(
        [np.cos(around) * level, np.sin(around) * level, np.sin(rise)]
    )
    x, y, _ = proj3d.proj_transform(0.0, 0.0, 0.2, space.get_proj())
    sprite = OffsetImage(view_from(views, drawn_from, phase), zoom=0.55)
    space.add_artist(AnnotationBbox(sprite, (x, y), frameon=False))
    space.set_title("Figure 3.3", loc="left", fontsize=11, fontweight="bold")
    seen = part.add_subplot(1, 2, 2)
    rows, columns = np.mgrid[:SIZE, :SIZE] // 10
    chequers = np.where((rows + columns) % 2, 0.86, 1.0)[..., None]
    shown = view_from(views, towards, phase)
    seen.imshow(shown[..., :3] * shown[..., 3:] + chequers * (1.0 - shown[..., 3:]))
    framed(seen)
    seen.spines[:].set(color=ORANGE, linewidth=1.8)
    titled(seen, "", f"what the orange camera sees, {MASS_KG:g} kg")


def draw_3_4(part: SubFigure) -> None:
    """Draw lattices of various n in the square, and on the hemisphere from above."""
    panels = part.subplots(2, len(NUMBERS))
    rim = np.linspace(0, 2 * np.pi, 200)
    for number, (square, disc) in zip(NUMBERS, panels.T, strict=True):
        lattice = fibonacci_lattice(number)
        east, north, up = lattice.T
        size = 60.0 / np.sqrt(number)
        turns = np.arctan2(east, north) / (2 * np.pi) % 1.0
        square.scatter(turns, 1.0 - up, s=size, color=BLUE)
        square.plot([0, 1, 1, 0, 0], [0, 0, 1, 1, 0], color=MUTED, linewidth=0.8)
        # Lambert's projection, in which the horizon is at radius 1
        out = np.sqrt(1.0 - up)
        across = out / np.maximum(np.hypot(east, north), 1e-9)
        disc.plot(np.cos(rim), np.sin(rim), color=MUTED, linewidth=0.8)
        disc.scatter(across * east, across * north, s=size, color=BLUE)
        if number <= LINED:
            index = np.linspace(0, number - 1, 80 * number)
            along = np.interp(index, np.arange(number), out**2) ** 0.5
            around = GOLDEN_ANGLE * index
            line = along * np.sin(around), along * np.cos(around)
            disc.plot(*line, color=GRID, linewidth=0.8, zorder=0)
        apart = np.degrees(packing_distance(lattice))
        square.set_title(f"n = {number}", fontsize=9, color=MUTED)
        disc.set_title(f"least angle {apart:.1f}°", fontsize=9, color=MUTED)
        for axes in (square, disc):
            axes.set_aspect("equal")
            axes.set_axis_off()
    for axes, x, name in (
        (panels[0][0], -0.12, "lattice"),
        (panels[1][0], -1.25, "spiral"),
    ):
        middle = 0.5 if name == "lattice" else 0.0
        axes.text(x, middle, name, rotation=90, va="center", fontsize=10, color=MUTED)
    panels[0][0].text(
        -0.15, 1.3, "Figure 3.4", fontsize=11, fontweight="bold", clip_on=False
    )


def imagery(views: ExplosionViews) -> tuple[Figure, str]:
    """Draw the four figures, in the thesis's order; return them and their numbers."""
    figure = new_figure(11.0, 13.6)
    parts = figure.subfigures(3, 1, height_ratios=(4.0, 4.6, 5.0), squeeze=False).flat
    draw_3_3(parts[0], views)
    draw_3_4(parts[1])
    counts = draw_4_1_and_4_2(parts[2], views)
    events: list[tuple[str, ...]] = [("time [s]", "brighter", "darker")]
    for time, both in zip(INSTANTS_S, counts, strict=True):
        events.append((f"{time:g}", *(f"{count:,}" for count in both)))
    apart: list[tuple[str, ...]] = [("n", "lattice [deg]", "offset [deg]")]
    for number in NUMBERS:
        pair = (fibonacci_lattice(number), offset_lattice(number))
        degrees = (f"{np.degrees(packing_distance(one)):.2f}" for one in pair)
        apart.append((f"{number}", *degrees))
    lines = [
        "Written by calibration/thesis_imagery.py",
        "",
        "Figure 3.4: least angle between two of n directions on the hemisphere",
        "",
        *aligned(apart, right=range(3)),
        "",
        f"Figure 4.2: {MASS_KG:g} kg at 55 m, events of {1e3 * WINDOW_S:.0f} ms before",
        "",
        *aligned(events, right=range(3)),
    ]
    return figure, "\n".join(lines) + "\n"


def main() -> None:
    """Draw."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--out", default="calibration/results/thesis_imagery.png")
    options.add_argument("--table", default="calibration/results/thesis_imagery.txt")
    asked = options.parse_args()
    start_jax(quick=True)
    with jax.enable_x64(True):
        figure, table = imagery(explosion_views())
    write_figure(figure, asked.out)
    write_text(asked.table, table)
    print(table, end="")


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


if __name__ == "__main__":
    main()
