"""What is behind: a texture that moves with the camera, and the noise of its sensor."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, UInt8

WIDTH, HEIGHT = 160, 120
RATE_HZ = 1000.0
"""Frames a second [Hz]."""
SIZE = 512
"""Of the texture, which repeats [px]."""


@dataclass(frozen=True)
class ImageSensor:
    """Noise of a sensor, its variance linear in the light.

    Attributes:
        dark: Standard deviation in the dark, of full scale.
        full: Variance that full light adds.
        hot: Share of pixels that spark now and then, each 10 times a second.
    """

    dark: float = 0.008
    full: float = 2e-4
    hot: float = 1e-4

    def seen(
        self, rng: np.random.Generator, light: Float[np.ndarray, "height width"]
    ) -> UInt8[np.ndarray, "height width"]:
        """Return light as grey values of 8 bits, linear."""
        spread = np.sqrt(self.dark**2 + self.full * np.maximum(light, 0.0))
        noise = rng.standard_normal(light.shape, np.float32)
        seen = light + spread * noise
        sparks = rng.poisson(self.hot * light.size * 10.0 / RATE_HZ)
        if sparks:
            seen[
                rng.integers(light.shape[0], size=sparks),
                rng.integers(light.shape[1], size=sparks),
            ] = 1.0
        return np.rint(255.0 * np.clip(seen, 0.0, 1.0)).astype(np.uint8)


@dataclass(frozen=True)
class Background:
    """A texture, and how the image moves over it.

    Attributes:
        texture: Light, repeating at its edges.
        drift: Columns and rows a second [px/s].
        shake: Amplitude of a vibration in both [px].
        shake_hz: Its frequency [Hz].
        roll: Turn of the image [rad/s].
        jerk_s: When the camera is knocked; infinite for never [s].
        jerk: By how much the drift changes then [px/s].
    """

    texture: Float[np.ndarray, "size size"]
    drift: tuple[float, float] = (0.0, 0.0)
    shake: float = 0.0
    shake_hz: float = 40.0
    roll: float = 0.0
    jerk_s: float = np.inf
    jerk: tuple[float, float] = (0.0, 0.0)

    def moved(self, time: float) -> tuple[float, float]:
        """Return how far what stands still has moved in the image [px]."""
        wave = self.shake * np.sin(2.0 * np.pi * self.shake_hz * time)
        late = max(time - self.jerk_s, 0.0)
        across = self.drift[0] * time + self.jerk[0] * late
        down = self.drift[1] * time + self.jerk[1] * late
        return across + wave, down + 0.7 * wave

    def light(self, time: float) -> Float[np.ndarray, "height width"]:
        """Return the light behind at an instant [s]."""
        dx, dy = self.moved(time)
        if self.roll == 0.0:
            return _shifted(self.texture, dx, dy)
        angle = self.roll * time
        x, y = np.meshgrid(
            np.arange(WIDTH, dtype=np.float32) - 0.5 * WIDTH,
            np.arange(HEIGHT, dtype=np.float32) - 0.5 * HEIGHT,
        )
        c, s = np.float32(np.cos(angle)), np.float32(np.sin(angle))
        u = c * x + s * y + np.float32(0.5 * WIDTH - dx)
        v = c * y - s * x + np.float32(0.5 * HEIGHT - dy)
        return _sampled(self.texture, u, v)


def _shifted(texture: np.ndarray, dx: float, dy: float) -> np.ndarray:
    """Return the texture's corner, moved right and down, linear between pixels."""
    left, top = int(np.floor(-dx)), int(np.floor(-dy))
    a, b = np.float32(-dx - left), np.float32(-dy - top)
    rows = (top + np.arange(HEIGHT + 1)) % SIZE
    columns = (left + np.arange(WIDTH + 1)) % SIZE
    part = texture[rows[:, None], columns]
    across = (1 - a) * part[:, :-1] + a * part[:, 1:]
    return (1 - b) * across[:-1] + b * across[1:]


def _sampled(texture: np.ndarray, u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Return the texture at columns and rows, linear between pixels."""
    left, top = np.floor(u), np.floor(v)
    a, b = u - left, v - top
    i, j = top.astype(np.int32) % SIZE, left.astype(np.int32) % SIZE
    k, m = (i + 1) % SIZE, (j + 1) % SIZE
    above = (1 - a) * texture[i, j] + a * texture[i, m]
    return (1 - b) * above + b * ((1 - a) * texture[k, j] + a * texture[k, m])


def texture(
    rng: np.random.Generator, mean: float, contrast: float, fineness: float = 1.2
) -> Float[np.ndarray, "size size"]:
    """Return a random texture: the spectrum of natural scenes, about 1/f.

    Args:
        rng: Where chance comes from.
        mean: Of the light.
        contrast: Standard deviation of its logarithm.
        fineness: Exponent of the fall of amplitudes with frequency.
    """
    f = np.fft.fftfreq(SIZE)
    size = np.hypot(f[:, None], f[None, : SIZE // 2 + 1])
    size[0, 0] = 1.0
    amplitude = size**-fineness * np.exp(-((size / 0.35) ** 2))
    amplitude[0, 0] = 0.0
    white = np.fft.rfft2(rng.standard_normal((SIZE, SIZE)))
    field = np.fft.irfft2(white * amplitude, s=(SIZE, SIZE))
    field *= contrast / field.std()
    return np.clip(mean * np.exp(field - 0.5 * contrast**2), 0.0, 1.5).astype(
        np.float32
    )


def random_background(rng: np.random.Generator, *, moving: float = 0.7) -> Background:
    """Draw a background, by day or dusk, before a camera that mostly moves.

    Args:
        rng: Where chance comes from.
        moving: Probability that it moves.
    """
    mean, contrast = rng.uniform(0.05, 0.45), rng.uniform(0.1, 0.6)
    made = texture(rng, mean, contrast, rng.uniform(1.0, 1.6))
    if rng.random() > moving:
        return Background(made)
    way, speed = rng.uniform(0, 2 * np.pi), rng.uniform(0.0, 200.0)
    knock = rng.uniform(0, 2 * np.pi)
    return Background(
        made,
        drift=(speed * np.cos(way), 0.5 * speed * np.sin(way)),
        shake=rng.choice([0.0, rng.uniform(0.0, 0.6)]),
        shake_hz=rng.uniform(10.0, 120.0),
        roll=rng.choice([0.0, rng.uniform(-1.0, 1.0)]),
        jerk_s=rng.uniform(0.05, 0.25) if rng.random() < 0.3 else np.inf,
        jerk=(150.0 * np.cos(knock), 150.0 * np.sin(knock)),
    )
