"""What a second of sound costs at a thousand microphones, by what they hear.

    python -m calibration.microphone_speed > calibration/results/microphone_speed.txt

15 kg, microphones 30 to 300 m away, 48,000 samples of each in single precision, in one
compiled call of `vmap`; the fastest of three, with the seconds that all cores together
computed for it: the machine may do other things meanwhile. Noise has a key for each
microphone. What the pulses alone take is in `waveform_speed.py`.
"""

import os
import time
from collections.abc import Callable

import jax
import jax.numpy as jnp

from jblast.report.words import aligned
from jblast.scene import Ambient, Charge, Instrument, Scene, Sensor
from jblast.sensors import microphone

MICROPHONES = 1000
DURATION_S = 1.0
SCENE = Scene(Charge(mass_kg=15.0))
PINK = Scene(Charge(mass_kg=15.0), ambient=Ambient(level=0.1, slope=-3.0))
AIR = microphone.WavePaths(ground=False, absorption=False)
NOISY = Instrument(full_scale=200.0, noise=0.02, bits=24)
CASES = {
    "closed form": (SCENE, Instrument(), AIR),
    "and absorption": (SCENE, Instrument(), AIR._replace(absorption=True)),
    "white noise, 24 bits": (SCENE, NOISY, AIR),
    "pink ambient sound": (PINK, Instrument(), AIR),
}


def recorder(
    scene: Scene, instrument: Instrument, wave_paths: microphone.WavePaths
) -> Callable:
    """Return a compiled function of places and keys."""

    def one(place, key):
        sensor = Sensor("m", place, "microphone", instrument=instrument)
        return microphone.record(scene, sensor, DURATION_S, key, wave_paths=wave_paths)

    return jax.jit(jax.vmap(one))


def fastest(record: Callable) -> tuple[float, float]:
    """Return the least wall time of a call, and what all cores computed in it [s]."""
    east = jnp.linspace(30.0, 300.0, MICROPHONES)
    places = jnp.stack([east, jnp.zeros_like(east), jnp.ones_like(east)], axis=1)
    keys = jax.random.split(jax.random.key(0), MICROPHONES)
    record(places, keys).block_until_ready()
    best = (float("inf"), 0.0)
    for _ in range(3):
        wall, cores = time.perf_counter(), time.process_time()
        record(places, keys).block_until_ready()
        taken = (time.perf_counter() - wall, time.process_time() - cores)
        best = min(best, taken)
    return best


def main() -> None:
    """Print the table."""
    rows = [["", "wall [s]", "cores [s]"]]
    for name, case in CASES.items():
        rows.append([name, *(f"{x:.2f}" for x in fastest(recorder(*case)))])
    print(
        f"{MICROPHONES} microphones, {DURATION_S:g} s, 48 kHz, "
        f"{jax.devices()[0].device_kind} with {os.cpu_count()} cores"
    )
    print()
    print("\n".join(aligned(rows, right=(1, 2))))


if __name__ == "__main__":
    main()
