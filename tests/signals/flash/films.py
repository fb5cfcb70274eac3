"""Films made by hand: a disc that grows before a texture that may move."""

import numpy as np

SHAPE = 60, 80
RATE = 1000.0


def disc(x, y, radius, shape=SHAPE, half=False):
    """How much of each pixel a disc covers, or its upper half alone: 8 x 8 points."""
    top, left = (max(int(at - radius) - 1, 0) for at in (y, x))
    part = np.s_[top : int(y + radius) + 3, left : int(x + radius) + 3]
    cover = np.zeros(shape)
    height, width = cover[part].shape
    rows, columns = ((np.arange(8 * n) - 3.5) / 8.0 for n in (height, width))
    rows, columns = rows[:, None] + top, columns[None] + left
    inside = np.hypot(columns - x, rows - y) <= radius
    if half:
        inside &= rows <= y
    cover[part] = inside.reshape(height, 8, width, 8).mean(axis=(1, 3))
    return cover


def growing(
    burst_s=0.0304,
    last=15.0,
    tau=3e-3,
    at=(41.0, 33.0),
    frames=80,
    noise=0.01,
    half=False,
    shape=SHAPE,
    rate=RATE,
):
    """Times and light of a film with a fireball of the law."""
    rng = np.random.default_rng(0)
    times = np.arange(frames) / rate
    behind = 0.2 + 0.05 * rng.random(shape)
    light = np.repeat(behind[None], frames, axis=0)
    for i, time in enumerate(times):
        radius = -last * np.expm1(-max(time - burst_s, 0.0) / tau)
        if radius:
            x, y = at
            cover = disc(x, y, radius, shape, half)
            light[i] = cover + (1 - cover) * behind
    light += noise * rng.standard_normal(light.shape)
    return times, np.clip(light, 0.0, 1.0).astype(np.float32)
