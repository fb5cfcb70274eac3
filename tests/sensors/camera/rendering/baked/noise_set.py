"""An explosion set of puffs of noise: written in the format of those that are baked."""

from pathlib import Path

import numpy as np
from PIL import Image

SIZE, COLUMNS = 64, 4
PHASES = (0.002, 0.006, 0.02, 0.08, 0.3, 0.8, 1.2)
AZIMUTHS = (0.0, 72.0, 144.0, 216.0, 288.0)
ELEVATIONS = (5.0, 35.0, 65.0)
ANCHOR = (31.5, 45.0)


def directions() -> list[tuple[float, float]]:
    """Return azimuth and elevation of the views in degrees."""
    rings = [
        ((azimuth + 36.0 * ring) % 360.0, elevation)
        for ring, elevation in enumerate(ELEVATIONS[:2])
        for azimuth in AZIMUTHS
    ]
    return [*rings, (0.0, ELEVATIONS[2]), (180.0, ELEVATIONS[2])]


def puffs(phase: float, count: int = 60):
    """Return places, radii, heats and shades of puffs, in units of the radius.

    Args:
        phase: Of the frame.
        count: Of puffs.
    """
    rng = np.random.default_rng(3)
    way = rng.normal(size=(count, 3))
    way[:, 2] = np.abs(way[:, 2])
    way /= np.linalg.norm(way, axis=1)[:, None]
    place = way * rng.uniform(0.3, 0.8, (count, 1))
    place[:, 2] += 0.5 * phase
    size = rng.uniform(0.15, 0.35, count)
    heat = np.clip(rng.uniform(0.5, 1.1, count) - 0.3 * phase, 0.0, 1.0)
    shade = rng.uniform(0.1, 0.5, (count, 1)) * np.array([1.0, 0.85, 0.7])
    return place, size, heat, shade


def picture(phase: float, azimuth: float, elevation: float, size: int = SIZE):
    """Return heat, shade and alpha of one frame, and its visible radius."""
    a, e = np.radians([azimuth, elevation])
    towards = np.array([np.sin(a) * np.cos(e), np.cos(a) * np.cos(e), np.sin(e)])
    right = np.array([-np.cos(a), np.sin(a), 0.0])
    up = np.cross(towards, right)
    up = up if up[2] > 0 else -up
    right = np.cross(up, towards)
    scale = 0.22 * size * (1.0 + 0.2 * phase)
    y, x = np.mgrid[:size, :size].astype(float)
    anchor = np.array(ANCHOR) * (size / SIZE)
    heat, alpha, shade = (np.zeros((size, size, k)) for k in (1, 1, 3))
    place, radius, hot, grey = puffs(phase)
    for k in np.argsort(place @ towards):
        cx = anchor[0] + scale * (place[k] @ right)
        cy = anchor[1] - scale * (place[k] @ up)
        square = ((x - cx) ** 2 + (y - cy) ** 2) / (scale * radius[k]) ** 2
        cover = np.clip(1.5 * (1.0 - square), 0.0, 1.0)[..., None]
        heat = cover * hot[k] + (1 - cover) * heat
        shade = cover * grey[k] + (1 - cover) * shade
        alpha = cover + (1 - cover) * alpha
    alpha[[0, -1]] = alpha[:, [0, -1]] = 0.0
    return heat, shade, alpha, visible_radius(alpha[..., 0])


def visible_radius(alpha: np.ndarray) -> float:
    """Return two standard deviations of the columns of what is opaque."""
    columns = (alpha > 0.5).sum(axis=0).astype(float)
    x = np.arange(len(columns))
    middle = columns @ x / columns.sum()
    return 2.0 * float(np.sqrt(columns @ (x - middle) ** 2 / columns.sum()))


def write_noise_set(
    folder: Path,
    *,
    size: int = SIZE,
    views=None,
    phases=PHASES,
    lossless: bool = False,
) -> Path:
    """Write a set into a folder, and return it."""
    folder.mkdir(parents=True, exist_ok=True)
    anchor = [value * size / SIZE for value in ANCHOR]
    lines = [
        'kind = "explosion"',
        f"size_px = {size}",
        f"phases = {list(phases)}",
        f"anchor_px = {anchor}",
        "reference_temperature_k = 2200.0",
        "air_temperature_k = 288.15",
        f"columns = {COLUMNS}",
        "[made]",
        'recipe = "puffs of noise"',
        'licence = "CC0-1.0"',
    ]
    rows = -(-len(phases) // COLUMNS)
    for number, (azimuth, elevation) in enumerate(views or directions()):
        sheet = np.zeros((2 * rows * size, COLUMNS * size, 4))
        sheet[: rows * size, :, 3] = 1.0
        radii = []
        for frame, phase in enumerate(phases):
            heat, shade, alpha, radius = picture(phase, azimuth, elevation, size)
            radii.append(round(radius, 4))
            top, left = frame // COLUMNS * size, frame % COLUMNS * size
            sheet[top : top + size, left : left + size, :3] = heat
            low = slice(rows * size + top, rows * size + top + size)
            sheet[low, left : left + size] = np.concatenate([shade, alpha], axis=2)
        name = f"{number:02}.webp"
        pixels = Image.fromarray(np.rint(255 * sheet).astype(np.uint8), "RGBA")
        how = {"lossless": True, "exact": True} if lossless else {"quality": 85}
        pixels.save(folder / name, format="WEBP", method=0, **how)
        lines += [
            "[[view]]",
            f'file = "{name}"',
            f"azimuth_deg = {azimuth}",
            f"elevation_deg = {elevation}",
            f"radius_px = {radii}",
        ]
    (folder / "views.toml").write_text("\n".join(lines) + "\n")
    return folder
