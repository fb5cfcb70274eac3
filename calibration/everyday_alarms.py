"""False alarms of the search without a template on everyday sounds, and detections.

    python -m calibration.everyday_alarms [MINUTES]

Negatives: synthesised sounds of `calibration.everyday_sounds`, which shares nothing
with this package, in background noise, a minute at a time; recordings of `data/sound/`
without an explosion; and stationary noise. Each minute has far more events than
everyday life; their number is given, too. "Before" counts arrivals above the threshold,
"after" those whose form is accepted (`jblast.signals.pulse_fit`).

Explosions: pulses of three other forms after absorption, a reflection, reverberation, a
microphone's high-pass and clipping; and `data/sound/bang.flac` at several levels.

Live: blasts by the laws, absorbed and reflected, in the recordings of ambient sound,
searched in packets as in `jblast world`: found, false alarms, errors of times.
"""

import sys
from pathlib import Path
from typing import NamedTuple

import jax
import numpy as np
import soundfile

from calibration.cases import recorded_template
from calibration.everyday_sounds import (
    KINDS,
    RATE_HZ,
    background,
    explosion,
    recording,
)
from jblast.observations.records.formats import open_record
from jblast.observations.records.sound import resampled
from jblast.progress import each
from jblast.scene import Charge, Instrument, Scene, Sensor
from jblast.sensors import recording as recording_of, waves
from jblast.signals import (
    Channel,
    Searched,
    SoundWatch,
    bank_of_pulses,
    search,
)

HERE = Path(__file__).parent
SOUND, RESULT = HERE / "data" / "sound", HERE / "results" / "everyday_alarms.txt"
MINUTES = 1
"""Of each kind."""
SEED = 7
LEVELS_DB = (10.0, 15.0, 20.0, 30.0, 45.0)
"""Peaks of explosions over the rms of the background."""
EACH = 24
BANG_LEVELS_DB = (0.0, -10.0)
BANGS = 10
NEAR_S = 0.05
RUNS, RUN_S, PACKET_S = 20, 20.0, 0.05
RUN_LEVELS_DB = (15.0, 35.0)
"""Peaks of blasts over the rms of a run's ambient sound."""
BLASTS = (
    *((5.0, 50.0, 0.0), (5.0, 100.0, 0.0), (5.0, 300.0, 0.0), (5.0, 600.0, 0.0)),
    *((50.0, 900.0, 0.0), (0.2, 60.0, 0.0), (0.2, 100.0, 0.0), (5.0, 80.0, 3.0)),
)
"""Charge [kg], ground range [m] and height of burst [m]."""


class Count(NamedTuple):
    """Alarms of a kind of sound.

    Attributes:
        hours: Sound searched [h].
        events: Events in it; 0 where they are not counted.
        before: Arrivals above the threshold.
        after: Those whose form is accepted.
    """

    hours: float
    events: int
    before: int
    after: int

    def line(self, name: str) -> str:
        """Return a row of the table."""
        events = f"{self.events:7d}" if self.events else f"{'-':>7s}"
        return (
            f"  {name:18s}{60 * self.hours:8.1f}{events}{self.before:8d}"
            f"{self.before / self.hours:10.0f}{self.after:8d}"
            f"{self.after / self.hours:9.1f}"
        )


def searched(samples: np.ndarray, bank: list[np.ndarray]) -> Searched:
    """Search samples as `jblast detect` does without a template."""
    channel = Channel("sound", "sound.wav", 1, samples, RATE_HZ)
    return search(channel, bank)


def counted(found: Searched, seconds: float, events: int) -> Count:
    """Return the alarms of a search."""
    after = len(found.detections)
    return Count(seconds / 3600, events, after + len(found.others), after)


def total(counts: list[Count]) -> Count:
    """Return the sum of several."""
    return Count(*(sum(column) for column in zip(*counts, strict=True)))


def negatives(bank: list[np.ndarray], minutes: int) -> tuple[list[str], Count]:
    """Return lines for each kind of synthesised sound, and their sum."""
    lines, sums = [], []
    for kind in each(list(KINDS), "kinds"):
        counts = []
        for nth in range(minutes):
            samples, events = recording(kind, 60.0, SEED + nth)
            counts.append(counted(searched(samples, bank), 60.0, events))
        sums.append(total(counts))
        lines.append(sums[-1].line(kind))
        print(lines[-1], flush=True)
    return lines, total(sums)


def ambient(name: str) -> np.ndarray:
    """Return a recording of `data/sound/` at the rate of the others."""
    samples, rate = soundfile.read(SOUND / name)
    return resampled(samples, rate, RATE_HZ)


def recordings(bank: list[np.ndarray]) -> list[str]:
    """Return lines for the recordings of ambient sound."""
    lines = []
    for file in sorted(SOUND.glob("ambient_*.ogg")):
        samples = ambient(file.name)
        seconds = samples.size / RATE_HZ
        lines.append(counted(searched(samples, bank), seconds, 0).line(file.stem))
    return lines


def steady(bank: list[np.ndarray], minutes: int) -> str:
    """Return the line of stationary noise."""
    counts = []
    for nth in range(minutes):
        rng = np.random.default_rng([SEED, nth])
        samples = background(rng, round(60 * RATE_HZ))
        counts.append(counted(searched(samples, bank), 60.0, 0))
    return total(counts).line("stationary noise")


def near(found: Searched, start_s: float, end_s: float) -> tuple[bool, bool]:
    """Return whether an arrival lies in an interval, before and after the test."""
    of = [one.time_s for one in found.detections]
    every = of + [one.time_s for one in found.others]
    hits = [any(start_s <= t <= end_s for t in times) for times in (every, of)]
    return hits[0], hits[1]


def explosions(bank: list[np.ndarray]) -> list[str]:
    """Return lines for explosions by level."""
    lines = []
    for level in each(list(LEVELS_DB), "levels"):
        hits = []
        for nth in range(EACH // 4):
            rng = np.random.default_rng([SEED, 1000 + nth])
            samples = background(rng, round(24 * RATE_HZ))
            fronts = []
            for start_s in (2.0, 8.0, 14.0, 20.0):
                pulse, front = explosion(rng)
                start = round(start_s * RATE_HZ)
                pulse = pulse[: samples.size - start]
                samples[start:][: pulse.size] += 10 ** (level / 20) * pulse
                fronts.append((start + front) / RATE_HZ)
            found = searched(samples, bank)
            hits += [near(found, t - NEAR_S, t + NEAR_S) for t in fronts]
        before, after = np.sum(hits, axis=0)
        lines.append(f"  {level:6.0f} dB{len(hits):8d}{before:8d}{after:8d}")
        print(lines[-1], flush=True)
    return lines


def bangs(bank: list[np.ndarray]) -> list[str]:
    """Return lines for the recorded bang in birdsong, rms over rms."""
    samples, rate = soundfile.read(SOUND / "bang.flac")
    bang = recorded_template(samples, rate, 0.07, 1.0)
    birds, lines = ambient("ambient_birds.ogg"), []
    for level in BANG_LEVELS_DB:
        rng, hits = np.random.default_rng(SEED), []
        for _ in range(BANGS):
            second = round(RATE_HZ)
            length = 10 * second
            start = rng.integers(0, birds.size - length)
            window = birds[start:][:length].copy()
            at = int(rng.integers(second, length - bang.size - second))
            amount = window.std() / bang.std() * 10 ** (level / 20)
            window[at:][: bang.size] += amount * bang
            began = at / RATE_HZ
            hits.append(near(searched(window, bank), began - NEAR_S, began + 1.0))
        before, after = np.sum(hits, axis=0)
        lines.append(f"  {level:6.0f} dB{len(hits):8d}{before:8d}{after:8d}")
        print(lines[-1], flush=True)
    return lines


def blast(mass_kg: float, range_m: float, up_m: float) -> tuple[np.ndarray, float]:
    """Return the sound of a blast of unit peak, and the time of its front [s]."""
    scene = Scene(Charge(mass_kg=mass_kg, position_m=(0.0, 0.0, up_m)), scatter=False)
    place = np.array([range_m, 0.0, 1.5])
    ear = Sensor("m", place, "microphone", instrument=Instrument(RATE_HZ))
    met = waves(scene, place)
    front_s = min(float(wave.pulse.arrival_time) for wave in met) - 0.01
    begin = int(front_s * RATE_HZ)
    record = recording_of(scene, ear, jax.random.key(0)).samples(front_s + 0.5)
    sound = np.asarray(record)[begin:]
    fade = np.cos(np.linspace(0.0, np.pi / 2, sound.size))
    return fade * sound / np.abs(sound).max(), front_s + 0.01 - begin / RATE_HZ


def live(bank: list[np.ndarray]) -> list[str]:
    """Return lines for blasts in ambient sound, searched in packets."""
    sounds = [blast(*one) for one in BLASTS]
    files = sorted(SOUND.glob("ambient_*.ogg"))
    table: dict[str, list[tuple[int, int, int]]] = {}
    errors: list[float] = []
    size = round(PACKET_S * RATE_HZ)
    for nth in each(list(range(RUNS)), "runs"):
        rng, name = np.random.default_rng([SEED, nth]), files[nth % len(files)].stem
        whole = ambient(f"{name}.ogg")
        looped = np.resize(
            np.roll(whole, rng.integers(whole.size)), whole.size + 320000
        )
        run = looped[: round(RUN_S * RATE_HZ)].copy()
        level = run.std()
        fronts = []
        for k, (sound, front_s) in enumerate(sounds):
            start = round((2.0 + 2.2 * k + rng.uniform(0.0, 0.5)) * RATE_HZ)
            peak = level * 10 ** (rng.uniform(*RUN_LEVELS_DB) / 20)
            run[start:][: sound.size] += peak * sound
            fronts.append(start / RATE_HZ + front_s)
        watch, found = SoundWatch(bank, RATE_HZ), []
        for start in range(0, run.size, size):
            found += watch.push(run[start : start + size])
        found = [one for one in [*found, *watch.finish()] if one.is_blast]
        # a sample is the mean over its interval
        away = np.array(
            [[one.time_s + 0.5 / RATE_HZ - t for t in fronts] for one in found]
        )
        near = np.abs(away.reshape(-1, len(fronts))) < NEAR_S
        errors += [
            float(row[hit].min() / one.sigma_s)
            for one, row, hit in zip(found, away, near, strict=True)
            if hit.any()
        ]
        counts = (
            len(fronts),
            int(near.any(axis=0).sum()),
            int((~near.any(axis=1)).sum()),
        )
        table.setdefault(name, []).append(counts)
    lines = [
        f"  {name:22s}" + "".join(f"{n:8d}" for n in np.sum(rows, axis=0))
        for name, rows in sorted(table.items())
    ]
    total = np.sum([row for rows in table.values() for row in rows], axis=0)
    lines.append(f"  {'all':22s}" + "".join(f"{n:8d}" for n in total))
    z = np.abs(errors)
    shares = ", ".join(f"{100 * np.mean(z < k):.1f} % below {k}" for k in (1, 2, 3))
    return [*lines, f"  errors of times over their sigmas: {shares}"]


def phones() -> list[str]:
    """Return lines for five phones that recorded 18 kg at 2 to 10 km."""
    lines = []
    for file in sorted((HERE / "data" / "inl_phones").glob("*.mseed")):
        (record,) = open_record(file)
        (samples,) = record.samples(0, record.length)
        channel = Channel(file.stem, str(file), 1, samples, record.rate_hz)
        found = search(channel, bank_of_pulses(record.rate_hz))
        seconds = samples.size / record.rate_hz
        lines.append(counted(found, seconds, 1).line(file.stem))
    return lines


def main() -> None:
    """Measure, print, keep the table."""
    from jblast.cli.jax_start import start_jax

    start_jax(quick=True)
    minutes = int(sys.argv[1]) if len(sys.argv) > 1 else MINUTES
    bank = bank_of_pulses(RATE_HZ)
    lines, every = negatives(bank, minutes)
    text = "\n".join(
        [
            "Search without a template: false alarms on everyday sounds, detections",
            "python -m calibration.everyday_alarms",
            "",
            "Alarms at 1 false alarm an hour of stationary noise, 16 kHz",
            "                    minutes events  before  per hour   after per hour",
            *lines,
            every.line("all synthesised"),
            *recordings(bank),
            steady(bank, minutes),
            "",
            "Simulated explosions: peak over rms of the background, number, found",
            "without the test, with it",
            *explosions(bank),
            "",
            "bang.flac in ambient_birds.ogg, rms over rms: number, found without the",
            "test, with it",
            *bangs(bank),
            "",
            "Live: 20 runs of 20 s of the recordings, blasts by the laws 15 to 35 dB",
            "over their rms: number, found, false alarms",
            *live(bank),
            "",
            "Phones 2 to 10 km from 18 kg (`data/inl_phones/`), columns as above",
            *phones(),
        ]
    )
    print(text)
    RESULT.write_text(text + "\n")


if __name__ == "__main__":
    main()
