"""A stream of ten million samples: is it the record, does memory stay, is time exact?

    python -m calibration.long_stream > calibration/results/long_stream.txt

A microphone 60 m from 15 kg that goes off after 200 s, with pink ambient sound, its own
noise, a full scale, corners and 24 bits, at 48 kHz; packets of 1/100 and 1/70 s, the
second no whole number of samples. The stream is compared with the record sample by
sample, its packets' times with fractions. Memory is the largest the process has had, as
the system counts it, after a tenth of the packets and after all; the record, which is
not a stream, is made afterwards.
"""

import resource
from fractions import Fraction

import jax
import numpy as np

from jblast.cli.jax_start import start_jax
from jblast.report.words import aligned
from jblast.scene import Ambient, Charge, Instrument, Scene, Sensor
from jblast.sensors import microphone

SAMPLES = 10_000_000
RATE = 48_000
START_S = 12.5
SCENE = Scene(
    Charge(mass_kg=15.0, time_s=200.0), ambient=Ambient(level=0.1, slope=-3.0)
)
MICROPHONE = Sensor(
    "m",
    np.array([60.0, 0.0, 1.5]),
    "microphone",
    instrument=Instrument(RATE, 200.0, 0.02, 24, 20.0, 20_000.0),
)
KEY = jax.random.key(19)


def streamed(packets_hz):
    """Return the samples, how many packets began late or early, memory twice [MB]."""
    samples = np.full(SAMPLES, np.nan)
    wrong = taken = count = 0
    early = 0.0
    for packet in microphone.stream(
        SCENE, MICROPHONE, KEY, packets_hz=packets_hz, start_s=START_S
    ):
        exact = Fraction(START_S) + Fraction(packet.first_sample, RATE)
        wrong += packet.start_s != float(exact) or packet.first_sample != taken
        kept = packet.samples[: SAMPLES - taken]
        samples[taken : taken + kept.size] = kept
        taken, count = taken + kept.size, count + 1
        if not early and taken >= SAMPLES // 10:
            early = peak_memory()
        if taken == SAMPLES:
            return samples, count, wrong, early, peak_memory()
    raise AssertionError("a stream has no end")


def peak_memory():
    """Return the most memory that the process has had [MB]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def main() -> None:
    """Print the table."""
    start_jax()
    rows = [["packets", "taken", "wrong time", "memory at 10 %", "at 100 %", "differ"]]
    rows.append(["Hz", "", "", "MB", "MB", "samples"])
    made = {packets_hz: streamed(packets_hz) for packets_hz in (100.0, 70.0)}
    record = np.asarray(
        microphone.record(SCENE, MICROPHONE, SAMPLES / RATE, KEY, start_s=START_S)
    )
    for packets_hz, (samples, count, wrong, early, late) in made.items():
        differ = np.count_nonzero(samples != record)
        told = (packets_hz, count, wrong, round(early), round(late), differ)
        rows.append([f"{number:.8g}" for number in told])
    print(f"{SAMPLES} samples, {SAMPLES / RATE:.1f} s")
    print()
    print("\n".join(aligned(rows, right=range(6))))


if __name__ == "__main__":
    main()
