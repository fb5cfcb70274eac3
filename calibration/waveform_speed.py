"""How long records of many microphones take: the closed form, beside a copy of memory.

    python -m calibration.waveform_speed

1,000 microphones of 1 s at 48 kHz, around one charge. Timed are the samples of the
pulses alone (`pulse_samples`), the same with the laws of every microphone's waves from
the scene (`even_overpressure`), records through 200 m of air (ISO 9613-1, by FFT), and
a copy of as many numbers in the same run. Traffic is what must be moved: a record is
written once; a copy and a filter read and write. Best of several calls, compiled
before; on a CPU XLA shares each among its cores. Everything goes to standard output.
"""

import math
import os
import time
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jblast.scene import Charge, Scene
from jblast.sensors import even_overpressure
from jblast.sensors.wave_paths import DEFAULT_RECORD_LAWS, waves_at
from jblast.waves.propagation import absorb
from jblast.waves.pulse import pulse_samples

MICROPHONES, SAMPLES, RATE = 1000, 48_000, 48e3
REPEATS = 7
CHARGE = Charge(mass_kg=15.0, burst="surface")


def main() -> None:
    """Measure and print."""
    device = jax.devices()[0]
    cpu = device.platform == "cpu"
    name = f"{os.cpu_count()} cores" if cpu else device.device_kind
    print(
        f"{MICROPHONES:,} records of {SAMPLES:,} samples: {device.platform}, {name}, "
        f"jax {jax.__version__}"
    )
    for dtype in (jnp.float32, jnp.float64):
        with jax.enable_x64(dtype == jnp.float64):
            print("\n".join(table(dtype)), flush=True)


def table(dtype: Any) -> list[str]:
    """Return the lines of one precision."""
    places = draws(dtype)
    scene = jax.tree.map(lambda x: x.astype(dtype), Scene(CHARGE))
    start = jnp.zeros((), dtype)

    def pulse(place):
        waves = waves_at(scene, place, DEFAULT_RECORD_LAWS, 0.0, False)
        return waves[0].pulse

    pulses = jax.jit(jax.vmap(pulse))(places)

    def closed(pulses):
        return jax.vmap(lambda p: pulse_samples(p, start, RATE, SAMPLES))(pulses)

    def whole(places):
        return jax.vmap(
            lambda place: even_overpressure(
                scene, place, start, RATE, SAMPLES, reflection=0.0
            )
        )(places)

    def through_air(samples):
        air = {"temperature": 288.15, "pressure": 101325.0, "relative_humidity": 0.5}
        air = {name: jnp.asarray(x, dtype) for name, x in air.items()}
        return jax.lax.map(
            lambda row: absorb(row, RATE, jnp.asarray(200.0, dtype), **air),
            samples,
            batch_size=100,
        )

    records = jax.jit(closed)(pulses)
    size = records.size * records.dtype.itemsize
    one = jnp.asarray(1.0, dtype)
    copied = seconds(lambda x: x + one, records)
    bandwidth = 2 * size / copied
    return [
        "",
        f"{np.dtype(dtype).name:24}{'s':>10}{'GB/s':>10}{'of a copy':>11}",
        _line("copy", copied, 2 * size, bandwidth),
        _line("closed form", seconds(closed, pulses), size, bandwidth),
        _line("with the laws", seconds(whole, places), size, bandwidth),
        _line("through the air", seconds(through_air, records), 2 * size, bandwidth),
    ]


def _line(what: str, took: float, moved: int, bandwidth: float) -> str:
    rate = moved / took
    return f"{what:24}{took:10.4f}{rate / 1e9:10.1f}{100 * rate / bandwidth:10.0f}%"


def seconds(function: Callable[[Any], Any], argument: Any) -> float:
    """Return what a call takes, compiled before; the best of several [s]."""
    compiled = jax.jit(function).lower(argument).compile()
    jax.block_until_ready(compiled(argument))
    best = math.inf
    for _ in range(REPEATS):
        begin = time.perf_counter()
        jax.block_until_ready(compiled(argument))
        best = min(best, time.perf_counter() - begin)
    return best


def draws(dtype: Any) -> jax.Array:
    """Return places from 20 to 250 m away: all heard within the second."""
    rng = np.random.default_rng(0)
    distance = rng.uniform(20.0, 250.0, MICROPHONES)
    angle = rng.uniform(0.0, 2.0 * math.pi, MICROPHONES)
    up = np.full(MICROPHONES, 1.5)
    place = np.stack([distance * np.cos(angle), distance * np.sin(angle), up], axis=-1)
    return jnp.asarray(place, dtype)


if __name__ == "__main__":
    main()
