"""What does the shipped set of views of an explosion look like?

    python -m calibration.explosion_views > calibration/results/explosion_views.txt

No random numbers: the set that `jblast bake` made and that comes with jblast, in the
light of the law's temperature at each phase, before a clear sky. Prints of each frame
its phase, the visible radius over the side of a picture (least and greatest of all
views), and the share of the opaque pixels that glow (heat above 0.6). Writes
calibration/results/explosion_views.png: some views, from low to high, and some frames.
"""

import tomllib
from pathlib import Path

import jax.numpy as jnp
import numpy as np
from PIL import Image

from jblast.cli.jax_start import start_jax
from jblast.constants import STANDARD_TEMPERATURE
from jblast.sensors.camera import blackbody_light
from jblast.sensors.camera.bake.baking import read_sheet
from jblast.sensors.camera.bake.coding import Layers, frames_of_sheet
from jblast.sensors.camera.files.images import srgb_bytes
from jblast.sensors.camera.fireball import WHITE
from jblast.waves.fireball import DRAPER_POINT, HOTTEST

SET = Path(__file__).parents[1] / "jblast/sensors/camera/explosion"
FIGURE = Path(__file__).parent / "results" / "explosion_views.png"
SKY = np.array([0.35, 0.5, 0.75])
"""Behind the explosion, linear."""
FRAMES = (0, 1, 3, 5, 8, 11, 14, 17, 20, 24, 30, 39)
VIEWS = 4


def light_of(frame: Layers, phase: float) -> np.ndarray:
    """Return a frame before the sky, lit by its heat, linear, full scale 1."""
    cooling = (DRAPER_POINT - STANDARD_TEMPERATURE) / (HOTTEST - STANDARD_TEMPERATURE)
    excess = (HOTTEST - STANDARD_TEMPERATURE) * cooling**phase
    warmth = jnp.asarray(STANDARD_TEMPERATURE + frame.heat * excess)
    emitted = np.where(frame.heat[..., None] > 0, blackbody_light(warmth), 0.0) / WHITE
    alpha = frame.alpha[..., None]
    return alpha * (emitted + frame.shade) + (1.0 - alpha) * SKY


def main() -> None:
    """Print the table, draw the sheet."""
    start_jax()
    index = tomllib.loads((SET / "views.toml").read_text(encoding="utf-8"))
    size, phases = index["size_px"], index["phases"]
    views = sorted(index["view"], key=lambda view: view["elevation_deg"])
    files = [SET / view["file"] for view in views]
    whole = [frames_of_sheet(read_sheet(file), size, len(phases)) for file in files]
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
    chosen = np.linspace(0, len(views) - 1, VIEWS).round().astype(int)
    rows = [
        np.concatenate([light_of(whole[v][f], phases[f]) for f in FRAMES], axis=1)
        for v in chosen
    ]
    Image.fromarray(srgb_bytes(np.concatenate(rows))).save(FIGURE, optimize=True)


if __name__ == "__main__":
    main()
