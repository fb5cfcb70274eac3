"""From how far does a blast saturate the microphone of a phone?

    python -m calibration.phone_saturation > calibration/results/phone_saturation.txt

A charge on the ground, a microphone on the ground, the laws that a record has where
nothing is said (shock kinematics), 48 kHz. The full scale is declared, not measured:
its peak over 20 uPa, at three levels that bracket what phones are taken to bear. The
range is where the record's largest sample comes to the
full scale, found by bisection of the record itself, and stands beside the range at
which the law's peak is as much. A high-pass of 20 Hz and a low-pass of 20 kHz, as
phones have them, change the peak, and with it the range: the last column.
"""

import jax
import jax.numpy as jnp
import numpy as np

from jblast.cli.jax_start import start_jax
from jblast.report.words import aligned
from jblast.scene import Charge, Instrument, Scene, Sensor
from jblast.sensors import heard, microphone

MASSES_KG = (1.0, 15.0, 100.0)
LEVELS_DB = (120.0, 130.0, 140.0)
"""Full scale, peak over 20 uPa."""
REFERENCE_PA = 20e-6
RATE = 48_000.0
STEPS = 14
"""Of the bisection in ln of the range: its last step is 0.06 %."""
NEAREST_M, FARTHEST_M = 5.0, 50_000.0
BEFORE_S, LONG_S = 0.01, 0.08
PATHS = microphone.WavePaths(ground=False, absorption=False)
PHONE = {"high_pass": 20.0, "low_pass": 20_000.0}


def loudest(mass, distance, corners):
    """Return the largest sample of a record, and the law's peak [Pa]."""
    scene = Scene(Charge(mass_kg=mass))
    place = jnp.stack([distance, jnp.zeros(()), jnp.zeros(())])
    phone = Sensor("phone", place, "microphone", instrument=Instrument(RATE, **corners))
    pulse = heard(scene, place)[0].pulse
    key = jax.random.key(0)
    start = pulse.arrival_time - BEFORE_S
    samples = microphone.record(
        scene, phone, LONG_S, key, start_s=start, wave_paths=PATHS
    )
    return jnp.max(samples), pulse.peak


def ranges(told, full_scale):
    """Return where the record's largest sample, and the law's peak, is the full scale.

    Args:
        told: `loudest` of many masses and distances.
        full_scale: Where the phone clips [Pa].
    """
    masses = jnp.asarray(MASSES_KG)
    found = []
    for of in (0, 1):
        near = np.full(masses.size, np.log(NEAREST_M))
        far = np.full(masses.size, np.log(FARTHEST_M))
        for _ in range(STEPS):
            middle = 0.5 * (near + far)
            over = np.asarray(told(masses, jnp.exp(middle))[of]) >= full_scale
            near, far = np.where(over, middle, near), np.where(over, far, middle)
        found.append(np.exp(0.5 * (near + far)))
    return found


def main() -> None:
    """Print the table."""
    start_jax()
    plain, phone = (
        jax.jit(jax.vmap(lambda mass, r, corners=corners: loudest(mass, r, corners)))
        for corners in ({}, PHONE)
    )
    rows = [["full scale", "peak", "charge", "by record", "by law", "20 Hz-20 kHz"]]
    rows.append(["dB", "Pa", "kg", "m", "m", "m"])
    for level in LEVELS_DB:
        full_scale = REFERENCE_PA * 10 ** (level / 20)
        by_record, by_law = ranges(plain, full_scale)
        filtered, _ = ranges(phone, full_scale)
        for i, mass in enumerate(MASSES_KG):
            numbers = (by_record[i], by_law[i], filtered[i])
            cells = [f"{number:.3g}" for number in (full_scale, mass, *numbers)]
            rows.append([f"{level:g}", *cells])
    print("a phone clips nearer than")
    print()
    print("\n".join(aligned(rows, right=range(6))))


if __name__ == "__main__":
    main()
