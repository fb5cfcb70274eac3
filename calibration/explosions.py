"""The explosion set as cameras see it: contact sheets, visible radii, charges found.

    python -m calibration.explosions
    python -m calibration.explosions views > calibration/results/explosion_views.txt

Writes explosions.png (four charges from three distances, by day and at dusk), of which
explosion.png has two rows, and explosions.txt: how far the visible radius of rendered
pictures (two standard deviations of the columns of what is more than half opaque) is
off the law's, over charges, views and times; and the charge that the radii of three
charges at three distances give back.

Views: what does the shipped set of views of an explosion look like? No random numbers:
the set that `bake` made and that comes with jblast, in the light of the law's
temperature at each phase, before a clear sky. Prints of each frame its phase, the
visible radius over the side of a picture (least and greatest of all views), and the
share of the opaque pixels that glow (heat above 0.6). Writes
calibration/results/explosion_views.png: some views, from low to high, and some frames.
"""

import argparse
import tomllib
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
from PIL import Image, ImageDraw, ImageFont
from scipy.optimize import least_squares

from calibration import run_part
from calibration.bake import Layers, frames_of
from jblast.cli.jax_start import start_jax
from jblast.constants import STANDARD_TEMPERATURE
from jblast.report.view import aligned
from jblast.scene import Camera, Charge, Scene, look_at
from jblast.sensors.camera import (
    ExplosionViews,
    blackbody_light,
    explosion_views,
    render,
)
from jblast.sensors.camera.files.images import srgb_bytes
from jblast.sensors.camera.fireball import WHITE, Appearance
from jblast.sensors.camera.image import picture_gain
from jblast.waves.fireball import (
    DRAPER_POINT,
    HOTTEST,
    fireball,
    fireball_duration,
    fireball_growth_time,
)
from jblast.waves.laws.fireball_radius import fireball_law_radius_in_image

CHARGES, DISTANCES = (1.0, 10.0, 100.0, 1000.0), (40.0, 80.0, 160.0)
PHASES = (0.004, 0.02, 0.1, 0.3, 0.7, 2.0)
SHEET_PHASES = (0.02, 0.1, 0.5, 2.0)
"""Of the sheet of all charges."""
WIDTH, HEIGHT, FOCAL = 200, 150, 260.0
CUT = 34
"""What is left out on both sides of a picture on that sheet [px]."""
DAY, DUSK = 3e4, 30.0
"""Light of a white wall for which a picture is exposed [cd/m2]."""
VIEWS, TIMES = 12, 24
"""Azimuths and elevations from which radii are measured."""


SET = Path(__file__).parents[1] / "jblast/sensors/camera/explosion"
FIGURE = Path(__file__).parent / "results" / "explosion_views.png"
SKY = np.array([0.35, 0.5, 0.75])
"""Behind the explosion, linear."""
FRAMES = (0, 1, 3, 5, 8, 11, 14, 17, 20, 24, 30, 39)
SHOWN_VIEWS = 4


def camera_at(place: np.ndarray, aim: np.ndarray, focal: float = FOCAL) -> Camera:
    """Return a camera that looks at a place."""
    return Camera(
        position=place,
        quaternion=look_at(place, aim),
        focal=np.array([focal, focal]),
        center=np.array([(WIDTH - 1) / 2, (HEIGHT - 1) / 2]),
        width=WIDTH,
        height=HEIGHT,
    )


def landscape(dusk: bool) -> np.ndarray:
    """Return even ground below a sky that darkens upwards."""
    rise = (0.62 * HEIGHT - np.arange(HEIGHT)) / HEIGHT
    colours = (
        ([0.9, 0.55, 0.35], [0.35, 0.4, 0.6]) if dusk else ([0.75, 0.85, 1.0],) * 2
    )
    part = np.clip(2.0 * rise, 0.0, 1.0)[:, None]
    sky = 0.45 * ((1 - part) * np.array(colours[0]) + part * np.array(colours[1]))
    ground = np.array([1.0, 0.88, 0.7]) * (0.05 if dusk else 0.14)
    return np.repeat(np.where(rise[:, None] > 0, sky, ground)[:, None], WIDTH, axis=1)


def film(
    views: ExplosionViews, mass: float, far: float, dusk: bool, phases=PHASES
) -> list[np.ndarray]:
    """Return pictures of a charge at some times."""
    place = np.array([0.0, -far, 2.0])
    camera = camera_at(place, np.array([0.0, 0.0, 2.0 + 0.12 * HEIGHT / FOCAL * far]))
    times = np.array(phases) * float(fireball_duration(mass))
    look = Appearance(white=DUSK if dusk else DAY)
    scene, behind = Scene(Charge(mass_kg=mass)), jnp.asarray(landscape(dusk))
    frames = render(
        scene,
        camera,
        times,
        views=views,
        background=behind,
        appearance=look,
    )
    gain = picture_gain(np.pi * DUSK) if dusk else 1.0
    return list(srgb_bytes(gain * np.asarray(frames)))


def contact_sheet(views: ExplosionViews) -> Image.Image:
    """Return four charges from three distances, by day and at dusk."""
    left, top, gap, wide = 100, 30, 2, WIDTH - 2 * CUT
    block = len(SHEET_PHASES) * (wide + gap) + 4 * gap
    high = HEIGHT + gap
    size = (left + len(DISTANCES) * block, top + 2 * len(CHARGES) * high)
    sheet = Image.new("RGB", size, "white")
    draw, font = ImageDraw.Draw(sheet), ImageFont.load_default(17)
    for column, far in enumerate(DISTANCES):
        draw.text((left + column * block, 5), f"{far:g} m", fill="black", font=font)
    rows = [(dusk, mass) for dusk in (False, True) for mass in CHARGES]
    for row, (dusk, mass) in enumerate(rows):
        y = top + row * high
        words = f"{mass:g} kg\n{'dusk' if dusk else 'day'}"
        draw.text((8, y + 50), words, fill="black", font=font)
        for column, far in enumerate(DISTANCES):
            pictures = film(views, mass, far, dusk, SHEET_PHASES)
            for k, picture in enumerate(pictures):
                x = left + column * block + k * (wide + gap)
                sheet.paste(Image.fromarray(picture[:, CUT : WIDTH - CUT]), (x, y))
    return sheet


def few_colours(picture: Image.Image) -> Image.Image:
    """Return a picture of 256 colours, mixed from dots where they do not do."""
    colours = picture.quantize(256)
    return picture.quantize(palette=colours, dither=Image.Dither.FLOYDSTEINBERG)


def visible_radius(alpha: np.ndarray) -> float:
    """Return two standard deviations of the columns of what is opaque [px]."""
    columns = (alpha > 0.5).sum(axis=0).astype(float)
    if columns.sum() < 1:
        return np.nan
    x = np.arange(len(columns))
    middle = columns @ x / columns.sum()
    return 2.0 * float(np.sqrt(columns @ (x - middle) ** 2 / columns.sum()))


def radii_seen(
    views: ExplosionViews,
    mass: float,
    times: np.ndarray,
    place: np.ndarray,
    focal: float,
) -> np.ndarray:
    """Return the visible radius at some times [px]."""
    up = 0.25 * HEIGHT / focal * float(np.linalg.norm(place))
    camera = camera_at(place, np.array([0.0, 0.0, up]), focal)
    scene = Scene(Charge(mass_kg=mass))
    frames = render(scene, camera, times, views=views, alpha=True)
    return np.array([visible_radius(np.asarray(f)[..., 3]) for f in frames])


def radius_rows(views: ExplosionViews) -> list[list[str]]:
    """Return how far visible radii are off the law, charge by charge."""
    rng, rows = np.random.default_rng(0), []
    for mass in (0.1, 1.0, 15.0, 100.0, 1000.0):
        life = float(fireball_duration(mass))
        tau = float(fireball_growth_time(mass))
        times = np.geomspace(-np.log(0.95) * tau, life, TIMES)
        radius = np.asarray(fireball(mass, times).radius)
        off = []
        for _ in range(VIEWS):
            around, rise = rng.uniform(0, 2 * np.pi), np.arcsin(rng.uniform(0.05, 0.9))
            level = np.cos(rise)
            way = np.array(
                [np.sin(around) * level, np.cos(around) * level, np.sin(rise)]
            )
            for time, size in zip(times, radius, strict=True):
                # from 30 radii away, so that all are as large in the image
                place = 30.0 * size * way
                (seen,) = radii_seen(views, mass, np.array([time]), place, 900.0)
                off.append(100.0 * (seen * np.sqrt(30.0**2 - 1) / 900.0 - 1.0))
        most = np.abs(off)
        numbers = np.std(off), np.percentile(most, 95), most.max()
        row = [f"{mass:g}", f"{np.mean(off):+.1f}", *(f"{n:.1f}" for n in numbers)]
        rows.append(row)
    return rows


def charge_rows(views: ExplosionViews) -> list[list[str]]:
    """Return the charge that visible radii give back by least squares of logarithms."""
    rows = []
    for mass in CHARGES[:3]:
        for far in DISTANCES:
            life = float(fireball_duration(mass))
            times = np.geomspace(2e-3, 0.5, 12) * life
            focal = 0.12 * WIDTH / (1.81 * mass ** (1 / 3)) * far
            place = np.array([0.6 * far, -0.8 * far, 2.0])
            seen = np.log(radii_seen(views, mass, times, place, focal))
            where = times, float(np.hypot(far, 2.0)), focal

            def misfit(log_mass, seen=seen, where=where):
                times, distance, focal = where
                law = fireball_law_radius_in_image(
                    times, np.exp(log_mass[0]), np.nan, distance, focal
                )
                return np.log(np.asarray(law)) - seen

            found = float(np.exp(least_squares(misfit, [np.log(3.0 * mass)]).x[0]))
            rows.append(
                [
                    f"{mass:g}",
                    f"{far:g}",
                    f"{found:.3g}",
                    f"{100 * (found / mass - 1):+.0f}",
                ]
            )
    return rows


def tables(views: ExplosionViews) -> str:
    """Return both tables."""
    right = range(5)
    radii = [["TNT [kg]", "mean [%]", "sd [%]", "95 in 100 [%]", "most [%]"]]
    charges = [["TNT [kg]", "distance [m]", "found [kg]", "off [%]"]]
    return "\n".join(
        [
            f"Visible radius off the law's: {VIEWS} directions, {TIMES} times from 5 % "
            "of growth to the end",
            "",
            *aligned(radii + radius_rows(views), right=right),
            "",
            "Charge from visible radii of 12 times, 0.002 to 0.5 of the duration",
            "",
            *aligned(charges + charge_rows(views), right=right),
            "",
        ]
    )


def main() -> None:
    """Write the pictures and the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", required=True, type=Path, metavar="DIRECTORY")
    parser.add_argument("--set", default=None, type=Path, metavar="FOLDER")
    asked = parser.parse_args()
    with jax.enable_x64(True):
        views = explosion_views(asked.set)
        sheet = few_colours(contact_sheet(views))
        sheet.save(asked.out / "explosions.png", optimize=True)
        rows = [np.hstack(film(views, 100.0, 80.0, dusk)) for dusk in (False, True)]
        strip = few_colours(Image.fromarray(np.vstack(rows)))
        strip.save(asked.out / "explosion.png", optimize=True)
        (asked.out / "explosions.txt").write_text(tables(views))


def light_of(frame: Layers, phase: float) -> np.ndarray:
    """Return a frame before the sky, lit by its heat, linear, full scale 1."""
    cooling = (DRAPER_POINT - STANDARD_TEMPERATURE) / (HOTTEST - STANDARD_TEMPERATURE)
    excess = (HOTTEST - STANDARD_TEMPERATURE) * cooling**phase
    warmth = jnp.asarray(STANDARD_TEMPERATURE + frame.heat * excess)
    emitted = np.where(frame.heat[..., None] > 0, blackbody_light(warmth), 0.0) / WHITE
    alpha = frame.alpha[..., None]
    return alpha * (emitted + frame.shade) + (1.0 - alpha) * SKY


def views() -> None:
    """Print the table, draw the sheet."""
    start_jax()
    index = tomllib.loads((SET / "views.toml").read_text(encoding="utf-8"))
    size, phases = index["size_px"], index["phases"]
    views = sorted(index["view"], key=lambda view: view["elevation_deg"])
    files = [SET / view["file"] for view in views]
    whole = [frames_of(file, size, len(phases)) for file in files]
    radii = np.array([view["radius_px"] for view in views]) / size
    total = sum(file.stat().st_size for file in files) / 1e6
    print(
        f"  {len(views)} views of {len(phases)} frames of {size} px, {total:.2f} MB\n"
    )
    print("  frame   phase   radius over side   glowing [%]")
    for number, phase in enumerate(phases):
        opaque = np.concatenate([v[number].heat[v[number].alpha > 0.5] for v in whole])
        glowing = 100.0 * np.mean(opaque > 0.6)
        least, most = radii[:, number].min(), radii[:, number].max()
        print(
            f"  {number:5d} {phase:8.4f}    {least:.3f} to {most:.3f} {glowing:10.1f}"
        )
    chosen = np.linspace(0, len(views) - 1, SHOWN_VIEWS).round().astype(int)
    rows = [
        np.concatenate([light_of(whole[v][f], phases[f]) for f in FRAMES], axis=1)
        for v in chosen
    ]
    Image.fromarray(srgb_bytes(np.concatenate(rows))).save(FIGURE, optimize=True)


if __name__ == "__main__":
    run_part({"sheets": main, "views": views})
