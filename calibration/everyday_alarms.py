"""False alarms of the search without a template on everyday sounds, and detections.

    python -m calibration.everyday_alarms

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

import itertools
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

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
from jblast.cli.jax_start import start_jax
from jblast.observations.records.formats import open_record
from jblast.observations.records.sound import resampled
from jblast.scene import Charge, Instrument, Scene, Sensor
from jblast.sensors import recording as recording_of, waves
from jblast.signals import Channel, SoundWatch, bank_of_pulses, search

HERE = Path(__file__).parent
SOUND, RESULT = HERE / "data" / "sound", HERE / "results" / "everyday_alarms.txt"
SEED = 7
LEVELS_DB, EACH = (10.0, 15.0, 20.0, 30.0, 45.0), 24
"""Peaks of explosions over the rms of the background, and number at each."""
BANG_LEVELS_DB, BANGS = (0.0, -10.0), 10
NEAR_S = 0.05
RUNS, RUN_S, PACKET_S = 20, 20.0, 0.05
RUN_LEVELS_DB = (15.0, 35.0)
"""Peaks of blasts over the rms of a run's ambient sound."""
BLASTS = (
    *((5.0, 50.0, 0.0), (5.0, 100.0, 0.0), (5.0, 300.0, 0.0), (5.0, 600.0, 0.0)),
    *((50.0, 900.0, 0.0), (0.2, 60.0, 0.0), (0.2, 100.0, 0.0), (5.0, 80.0, 3.0)),
)
"""Charge [kg], ground range [m] and height of burst [m]."""


class Clip(NamedTuple):
    """Samples, the events in them, and the intervals in which they are found [s]."""

    samples: np.ndarray
    events: int = 0
    near: Sequence[tuple[float, float]] = ()
    rate_hz: float = RATE_HZ


class Count(NamedTuple):
    """What a search finds without the test of the form, and with it.

    Attributes:
        minutes: Sound searched.
        events: Events in it; 0 where they are not counted.
        alarms: Arrivals above the threshold, and those whose form is accepted.
        intervals: Number of intervals in which there is an event.
        found: Intervals with an arrival, and with an accepted one.
    """

    minutes: float
    events: int
    alarms: np.ndarray
    intervals: int
    found: np.ndarray

    def alarms_line(self, name: str) -> str:
        """Return a row of the table of alarms."""
        rates = 60 * self.alarms / self.minutes
        return (
            f"  {name:18s}{self.minutes:8.1f}{self.events or '-':>7}{self.alarms[0]:8d}"
            f"{rates[0]:10.0f}{self.alarms[1]:8d}{rates[1]:9.1f}"
        )


def counted(clips: Iterable[Clip]) -> Count:
    """Search clips as `jblast detect` does without a template."""
    counts = []
    for samples, events, near, rate_hz in clips:
        channel = Channel("sound", "sound.wav", 1, samples, rate_hz)
        found = search(channel, bank_of_pulses(rate_hz))
        accepted = [one.time_s for one in found.detections]
        both = [*accepted, *(one.time_s for one in found.others)], accepted
        hits = [
            sum(any(start <= t <= end for t in times) for start, end in near)
            for times in both
        ]
        minutes = samples.size / rate_hz / 60
        alarms = np.array([len(times) for times in both])
        counts.append(Count(minutes, events, alarms, len(near), np.array(hits)))
    return total(counts)


def total(counts: Iterable[Count]) -> Count:
    """Return the sum of several."""
    sums: list[Any] = [sum(column) for column in zip(*counts, strict=True)]
    return Count(*sums)


def ambient(name: str) -> np.ndarray:
    """Return a recording of `data/sound/` at the rate of the others."""
    samples, rate = soundfile.read(SOUND / f"{name}.ogg")
    return resampled(samples, rate, RATE_HZ)


AMBIENT = [file.stem for file in sorted(SOUND.glob("ambient_*.ogg"))]


def alarms() -> Iterator[str]:
    """Yield the rows of sounds without an explosion."""
    sums = []
    for kind in KINDS:
        sums.append(counted([Clip(*recording(kind, 60.0, SEED))]))
        yield sums[-1].alarms_line(kind)
    yield total(sums).alarms_line("all synthesised")
    for name in AMBIENT:
        yield counted([Clip(ambient(name))]).alarms_line(name)
    noise = background(np.random.default_rng([SEED, 0]), round(60 * RATE_HZ))
    yield counted([Clip(noise)]).alarms_line("stationary noise")


def explosions(level: float) -> Iterator[Clip]:
    """Yield simulated explosions in noise, four in a clip."""
    for nth in range(EACH // 4):
        rng = np.random.default_rng([SEED, 1000 + nth])
        samples, near = background(rng, round(24 * RATE_HZ)), []
        for start_s in (2.0, 8.0, 14.0, 20.0):
            pulse, front = explosion(rng)
            start = round(start_s * RATE_HZ)
            pulse = pulse[: samples.size - start]
            samples[start:][: pulse.size] += 10 ** (level / 20) * pulse
            time = (start + front) / RATE_HZ
            near.append((time - NEAR_S, time + NEAR_S))
        yield Clip(samples, near=near)


def bangs(level: float) -> Iterator[Clip]:
    """Yield the recorded bang in birdsong, rms over rms."""
    samples, rate = soundfile.read(SOUND / "bang.flac")
    bang, birds = recorded_template(samples, rate, 0.07, 1.0), ambient("ambient_birds")
    rng, second = np.random.default_rng(SEED), round(RATE_HZ)
    length = 10 * second
    for _ in range(BANGS):
        start = rng.integers(0, birds.size - length)
        window = birds[start:][:length].copy()
        at = int(rng.integers(second, length - bang.size - second))
        window[at:][: bang.size] += (
            window.std() / bang.std() * 10 ** (level / 20) * bang
        )
        yield Clip(window, near=[(at / RATE_HZ - NEAR_S, at / RATE_HZ + 1.0)])


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


def live() -> Iterator[str]:
    """Yield the rows of blasts in ambient sound, searched in packets."""
    sounds, size = [blast(*one) for one in BLASTS], round(PACKET_S * RATE_HZ)
    table = {name: np.zeros(3, int) for name in AMBIENT}
    errors: list[float] = []
    for nth in range(RUNS):
        rng, name = np.random.default_rng([SEED, nth]), AMBIENT[nth % len(AMBIENT)]
        whole = ambient(name)
        looped = np.resize(
            np.roll(whole, rng.integers(whole.size)), whole.size + 320000
        )
        run, fronts = looped[: round(RUN_S * RATE_HZ)].copy(), []
        level = run.std()
        for k, (sound, front_s) in enumerate(sounds):
            start = round((2.0 + 2.2 * k + rng.uniform(0.0, 0.5)) * RATE_HZ)
            peak = level * 10 ** (rng.uniform(*RUN_LEVELS_DB) / 20)
            run[start:][: sound.size] += peak * sound
            fronts.append(start / RATE_HZ + front_s)
        watch, found = SoundWatch(bank_of_pulses(RATE_HZ), RATE_HZ), []
        for start in range(0, run.size, size):
            found += watch.push(run[start : start + size])
        found = [one for one in [*found, *watch.finish()] if one.is_blast]
        # a sample is the mean over its interval
        times = np.array([one.time_s for one in found]) + 0.5 / RATE_HZ
        away = times[:, None] - np.array(fronts)
        near = np.abs(away) < NEAR_S
        errors += [
            float(row[hit].min() / one.sigma_s)
            for one, row, hit in zip(found, away, near, strict=True)
            if hit.any()
        ]
        hits, alarms = near.any(axis=0).sum(), (~near.any(axis=1)).sum()
        table[name] += len(fronts), hits, alarms
    table["all"] = np.sum([*table.values()], axis=0)
    for name, row in table.items():
        yield f"  {name:22s}" + "".join(f"{n:8d}" for n in row)
    z = np.abs(errors)
    shares = ", ".join(f"{100 * np.mean(z < k):.1f} % below {k}" for k in (1, 2, 3))
    yield f"  errors of times over their sigmas: {shares}"


def phones() -> Iterator[str]:
    """Yield the rows of five phones that recorded 18 kg at 2 to 10 km."""
    for file in sorted((HERE / "data" / "inl_phones").glob("*.mseed")):
        (record,) = open_record(file)
        (samples,) = record.samples(0, record.length)
        clip = Clip(samples, 1, rate_hz=record.rate_hz)
        yield counted([clip]).alarms_line(file.stem)


def levels(clips, levels_db: Sequence[float]) -> Iterator[str]:
    """Yield a row for each level: number of events, found without and with the test."""
    for level in levels_db:
        found = counted(clips(level))
        before, after = found.found
        yield f"  {level:6.0f} dB{found.intervals:8d}{before:8d}{after:8d}"


PARTS = (
    (
        "Search without a template: false alarms on everyday sounds, detections\n"
        "python -m calibration.everyday_alarms\n\n"
        "Alarms at 1 false alarm an hour of stationary noise, 16 kHz\n"
        "                    minutes events  before  per hour   after per hour",
        alarms,
    ),
    (
        "Simulated explosions: peak over rms of the background, number, found\n"
        "without the test, with it",
        lambda: levels(explosions, LEVELS_DB),
    ),
    (
        "bang.flac in ambient_birds.ogg, rms over rms: number, found without the\n"
        "test, with it",
        lambda: levels(bangs, BANG_LEVELS_DB),
    ),
    (
        "Live: 20 runs of 20 s of the recordings, blasts by the laws 15 to 35 dB\n"
        "over their rms: number, found, false alarms",
        live,
    ),
    ("Phones 2 to 10 km from 18 kg (`data/inl_phones/`), columns as above", phones),
)
"""Head and rows of each part of the table."""


def main() -> None:
    """Measure, print, keep the table."""
    start_jax(quick=True)
    text = ""
    for head, rows in PARTS:
        for line in itertools.chain([""] if text else [], [head], rows()):
            print(line, flush=True)
            text += f"{line}\n"
    RESULT.write_text(text)


if __name__ == "__main__":
    main()
