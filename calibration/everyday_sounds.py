r"""Everyday sounds that are no explosions, synthesised: negatives for the detector.

Each kind is a physical model of its own with random parameters, made with NumPy alone
and nothing of `jblast`, so that negatives do not share the detector's assumptions.

- Doors, drums, hammers, footsteps and claps: an impact excites modes, each a decaying
  oscillation $e^{-\pi f t/Q} \sin 2\pi f t$, and a room adds decaying noise. Drums have
  the modes of a circular membrane (Fletcher and Rossing, The Physics of Musical
  Instruments, 1998, chapter 18).
- Plosives and gusts: turbulence at the microphone, whose pressure spectrum has a slope
  of -7/3 (Raspet, Webster and Dillion 2006, J. Acoust. Soc. Am. 119, 834).
- Thunder: a lightning channel of straight pieces, each of which radiates an N-wave that
  is strongest at right angles to it (Few 1969, J. Geophys. Res. 74, 6926; Ribner and
  Roy 1982, J. Acoust. Soc. Am. 72, 1911), behind absorption that grows with range.
- Speech and barks: pulses of a glottis through resonances.
"""

from collections.abc import Callable

import numpy as np
from numpy.random import Generator

RATE_HZ = 16_000.0
Sound = np.ndarray
SOUND_SPEED = 343.0
GAP_S = 2.0
"""Mean time between the events of a recording [s]; thunder is rarer by its length."""
LEVELS_DB = (10.0, 50.0)
"""Peaks of events over the rms of the background: from just heard to close by."""


def _seconds(duration_s: float) -> Sound:
    return np.arange(max(round(duration_s * RATE_HZ), 2)) / RATE_HZ


def _band_noise(rng: Generator, size: int, slope: float, low: float, high: float):
    """Return noise whose power falls as f^slope between two frequencies [Hz]."""
    f = np.fft.rfftfreq(size, 1 / RATE_HZ)
    gain = np.maximum(f, 1.0) ** (slope / 2)
    gain *= 1 / np.sqrt(1 + (low / np.maximum(f, 1e-3)) ** 4)
    gain *= 1 / np.sqrt(1 + (f / high) ** 4)
    noise = np.fft.irfft(np.fft.rfft(rng.standard_normal(size)) * gain, size)
    return noise / noise.std()


def _filtered(sound: Sound, answer: Sound) -> Sound:
    size = sound.size + answer.size - 1
    padded = 1 << (size - 1).bit_length()
    product = np.fft.rfft(sound, padded) * np.fft.rfft(answer, padded)
    return np.fft.irfft(product, padded)[:size]


def _room(rng: Generator, sound: Sound, time_60_s: float, share: float) -> Sound:
    """Add a room's decaying noise; `share` is its amplitude over the direct sound."""
    t = _seconds(time_60_s)
    late = rng.standard_normal(t.size) * np.exp(-6.9 * t / time_60_s)
    late /= np.linalg.norm(late)
    late[: round(0.003 * RATE_HZ)] = 0.0
    late = np.r_[1.0, share * late[1:]]
    return _filtered(sound, late)


def _modes(
    rng: Generator, frequencies: Sound, qualities: Sound, contact_s: float
) -> Sound:
    """Return modes excited by a half sine of contact."""
    longest = float(np.max(2.2 * qualities / frequencies))
    t = _seconds(min(longest, 1.5))
    sizes = rng.normal(size=frequencies.size)
    ringing = sum(
        a * np.exp(-np.pi * f * t / q) * np.sin(2 * np.pi * f * t)
        for a, f, q in zip(sizes, frequencies, qualities, strict=True)
    )
    force = np.sin(np.pi * np.linspace(0, 1, max(round(contact_s * RATE_HZ), 3)))
    return _filtered(np.asarray(ringing), force / force.sum())


def _together(parts: list[tuple[float, Sound]]) -> Sound:
    """Add sounds that begin at given times [s]."""
    starts = [round(at * RATE_HZ) for at, _ in parts]
    whole = np.zeros(max(s + p.size for s, (_, p) in zip(starts, parts, strict=True)))
    for start, (_, part) in zip(starts, parts, strict=True):
        whole[start : start + part.size] += part
    return whole


def _unit(sound: Sound) -> Sound:
    return sound / np.abs(sound).max()


def door(rng: Generator) -> Sound:
    """A slam: panel and wall modes of 40 to 400 Hz, a latch, rattle, a room."""
    count = int(rng.integers(4, 12))
    f = np.sort(rng.uniform(40, 400, count))
    slam = _unit(_modes(rng, f, rng.uniform(5, 25, count), rng.uniform(1e-3, 6e-3)))
    latch_f = rng.uniform(1500, 5000, 3)
    latch = _unit(_modes(rng, latch_f, rng.uniform(10, 40, 3), 2e-4))
    parts = [
        (0.05, slam),
        (0.05 - rng.uniform(0, 0.04), rng.uniform(0.02, 0.3) * latch),
    ]
    at = 0.05
    for nth in range(int(rng.integers(0, 6))):
        at += rng.uniform(0.02, 0.07)
        parts.append((at, slam * rng.uniform(0.1, 0.4) / (1 + nth)))
    return _room(rng, _together(parts), rng.uniform(0.2, 0.9), rng.uniform(0.1, 0.8))


def click(rng: Generator) -> Sound:
    """A switch or a key: one or two short strokes; or a single wrong sample."""
    if rng.uniform() < 0.2:
        return np.array([0.0, float(rng.choice([-1, 1])), 0.0])
    parts, at = [], 0.0
    for _ in range(int(rng.integers(1, 4))):
        f = rng.uniform(800, 6000, 3)
        one = _unit(_modes(rng, f, rng.uniform(2, 12, 3), rng.uniform(5e-5, 4e-4)))
        parts.append((at, rng.uniform(0.3, 1) * one))
        at += rng.uniform(0.01, 0.12)
    return _room(rng, _together(parts), rng.uniform(0.1, 0.5), rng.uniform(0, 0.5))


MEMBRANE = np.array([1.0, 1.594, 2.136, 2.296, 2.653, 2.918, 3.156, 3.501])


def drum(rng: Generator) -> Sound:
    """A bass drum, a tom or a snare."""
    kind = rng.integers(3)
    if kind == 0:
        t = _seconds(rng.uniform(0.15, 0.5))
        f0, fall = rng.uniform(40, 75), rng.uniform(0.01, 0.04)
        turn = f0 * t + rng.uniform(1, 3) * f0 * fall * (1 - np.exp(-t / fall))
        body = np.sin(2 * np.pi * turn) * np.exp(-5 * t / t[-1])
        beater = _band_noise(rng, 200, 0.0, 500, 4000) * np.exp(-np.arange(200) / 40)
        sound = _together([(0.0, body), (0.0, rng.uniform(0.02, 0.2) * beater)])
    else:
        f = rng.uniform(80, 300) * MEMBRANE[: int(rng.integers(3, 8))]
        q = rng.uniform(8, 40, f.size)
        sound = _unit(_modes(rng, f, q, rng.uniform(5e-4, 3e-3)))
        if kind == 2:
            t = _seconds(0.25)
            wires = _band_noise(rng, t.size, 0.0, 1000, 6000) * np.exp(-t / 0.06)
            sound = _together([(0.0, sound), (0.003, rng.uniform(0.1, 0.4) * wires)])
    return _room(rng, sound, rng.uniform(0.2, 1.0), rng.uniform(0.0, 0.6))


def plosive(rng: Generator) -> Sound:
    """A breath or a gust that passes the microphone in some hundredths of a second."""
    duration = rng.uniform(0.02, 0.15)
    t = _seconds(4 * duration)
    rise = rng.uniform(0.1, 0.5) * duration
    shape = (1 - np.exp(-t / rise)) * np.exp(-t / duration)
    eddies = _band_noise(
        rng, t.size, -7 / 3, rng.uniform(5, 40), rng.uniform(200, 1500)
    )
    push = np.sign(rng.normal()) * rng.uniform(0, 2) * shape / shape.max()
    return _unit(shape / shape.max() * eddies + push * shape)


def gusts(rng: Generator) -> Sound:
    """Wind in gusts for 5 to 15 s."""
    t = _seconds(rng.uniform(5, 15))
    slow = _band_noise(rng, t.size, -5 / 3, 0.05, 3.0)
    loud = np.exp(rng.uniform(0.5, 1.2) * slow) * np.sin(np.pi * t / t[-1])
    return _unit(loud * _band_noise(rng, t.size, -7 / 3, 4.0, 800.0))


def n_wave(duration_s: float, rise_s: float) -> Sound:
    """Return an N-wave of unit peak with fronts of a finite rise."""
    t = _seconds(duration_s + 6 * rise_s) - 3 * rise_s
    fronts = 0.25 * (1 + np.tanh(2 * t / rise_s))
    fronts = fronts * (1 + np.tanh(2 * (duration_s - t) / rise_s))
    return (1 - 2 * t / duration_s) * fronts


def thunder(rng: Generator, distance_m: float | None = None) -> Sound:
    """A tortuous channel of 4 to 7 km, heard from 1 to 10 km away."""
    far = rng.uniform(1000, 10_000) if distance_m is None else distance_m
    piece = 25.0
    count = int(rng.uniform(4000, 7000) / piece)
    # large bends of some hundred metres and small ones of each piece
    bends = np.repeat(rng.normal(0, 0.35, (count // 12 + 1, 3)), 12, axis=0)[:count]
    steps = bends + rng.normal(0, 0.25, (count, 3)) + [0, 0, 0.6]
    steps /= np.linalg.norm(steps, axis=1)[:, None]
    along = np.cumsum(piece * steps, axis=0)
    places = along + np.array([far, 0.0, 0.0])
    ranges = np.linalg.norm(places, axis=1)
    across = np.abs(np.sum(places * steps, axis=1)) / ranges
    strength = np.exp(-((across / 0.35) ** 2)) / ranges
    strength *= rng.lognormal(0, 0.5, count)
    arrivals = (ranges - ranges.min()) / SOUND_SPEED
    sound = np.zeros(round((arrivals.max() + 0.5) * RATE_HZ))
    for size, at, distance in zip(strength, arrivals, ranges, strict=True):
        duration = rng.uniform(0.006, 0.025) * (distance / 1000) ** 0.25
        wave = n_wave(duration, 2e-4 + 4e-7 * distance)
        start = round(at * RATE_HZ)
        sound[start : start + wave.size] += size * wave
    return _unit(sound)


def clap(rng: Generator) -> Sound:
    """Two hands: a pulse of a millisecond through their hollow, in a room."""
    f = rng.uniform(500, 2500, 2)
    sound = _modes(rng, f, rng.uniform(1.5, 6, 2), rng.uniform(2e-4, 8e-4))
    return _room(rng, _unit(sound), rng.uniform(0.2, 1.2), rng.uniform(0.2, 1.0))


def hammer(rng: Generator) -> Sound:
    """A blow on wood or metal: high modes of high quality, a thump."""
    f = np.r_[rng.uniform(600, 6000, 6), rng.uniform(80, 300, 2)]
    q = np.r_[rng.uniform(20, 200, 6), rng.uniform(3, 10, 2)]
    sound = _modes(rng, f, q, rng.uniform(1e-4, 1e-3))
    return _room(rng, _unit(sound), rng.uniform(0.2, 1.0), rng.uniform(0.0, 0.5))


def rain(rng: Generator) -> Sound:
    """A shower of rain or hail on a surface, some seconds long."""
    t = _seconds(rng.uniform(3, 10))
    drops = np.zeros(t.size)
    count = int(rng.uniform(20, 300) * t[-1])
    np.add.at(drops, rng.integers(0, t.size, count), rng.lognormal(0, 1.0, count))
    f = np.exp(rng.uniform(np.log(300), np.log(5000), 3))
    hit = _modes(rng, f, rng.uniform(2, 10, 3), rng.uniform(1e-4, 1e-3))
    return _unit(_filtered(drops, hit)[: t.size] * np.sin(np.pi * t / t[-1]))


def footstep(rng: Generator) -> Sound:
    """A heel's thump and the scuff of a sole."""
    f = rng.uniform(50, 250, 3)
    thump = _unit(_modes(rng, f, rng.uniform(2, 8, 3), rng.uniform(3e-3, 12e-3)))
    t = _seconds(rng.uniform(0.05, 0.2))
    scuff = _band_noise(rng, t.size, -1.0, 500, 5000) * np.sin(np.pi * t / t[-1])
    parts = [(0.0, thump), (rng.uniform(0, 0.08), rng.uniform(0.02, 0.2) * scuff)]
    return _room(rng, _together(parts), rng.uniform(0.2, 0.8), rng.uniform(0, 0.6))


def _voiced(rng: Generator, duration_s: float, pitch: Sound, formants: Sound) -> Sound:
    """Return pulses of a glottis through resonances."""
    cycles = np.cumsum(pitch) / RATE_HZ
    pulses = np.diff(np.floor(cycles), prepend=0.0)
    t = _seconds(0.03)
    for f in formants:
        width = rng.uniform(60, 200)
        ring = np.exp(-np.pi * width * t) * np.sin(2 * np.pi * f * t)
        pulses = _filtered(pulses, ring)[: pitch.size]
    return _unit(pulses)


def bark(rng: Generator) -> Sound:
    """A dog: one to three barks."""
    parts, at = [], 0.0
    for _ in range(int(rng.integers(1, 4))):
        t = _seconds(rng.uniform(0.08, 0.25))
        pitch = rng.uniform(250, 700) * (1 + 0.3 * np.sin(np.pi * t / t[-1]))
        call = _voiced(rng, t[-1], pitch, rng.uniform(500, 2500, 2))
        call = call + 0.1 * _band_noise(rng, t.size, 0.0, 500, 4000)
        rise = rng.uniform(0.003, 0.02)
        call *= np.clip(t / rise, 0, 1) * np.clip((t[-1] - t) / 0.04, 0, 1)
        parts.append((at, call))
        at += rng.uniform(0.25, 0.6)
    return _room(rng, _together(parts), rng.uniform(0.2, 0.8), rng.uniform(0, 0.5))


def speech(rng: Generator) -> Sound:
    """Some syllables, hisses and stops."""
    parts, at, base = [], 0.0, rng.uniform(80, 240)
    for _ in range(int(rng.integers(3, 12))):
        t = _seconds(rng.uniform(0.06, 0.25))
        edge = np.sqrt(np.abs(np.sin(np.pi * t / t[-1])))
        kind = rng.uniform()
        if kind < 0.65:
            pitch = base * (1 + 0.1 * rng.normal() * t / t[-1])
            low, high = rng.uniform(250, 850), rng.uniform(900, 2500)
            part = _voiced(rng, t[-1], pitch, np.array([low, high, 2800.0])) * edge
        elif kind < 0.85:
            part = 0.2 * edge * _band_noise(rng, t.size, 0.0, 2000, 7000)
        else:
            burst = np.exp(-t / rng.uniform(0.003, 0.02))
            part = 0.4 * burst * _band_noise(rng, t.size, -0.5, 300, 5000)
        parts.append((at, part))
        at += t[-1] + rng.uniform(-0.02, 0.1)
    return _together(parts)


def car(rng: Generator) -> Sound:
    """A car that passes: tyres and an engine's harmonics."""
    t = _seconds(rng.uniform(6, 14))
    near = 1 / (1 + ((t - t[-1] / 2) / rng.uniform(0.5, 1.5)) ** 2)
    tyres = _band_noise(rng, t.size, -0.5, 300, 2500)
    f0 = rng.uniform(25, 60)
    engine = sum(
        np.sin(2 * np.pi * n * f0 * t + rng.uniform(0, 6)) / n for n in range(1, 8)
    )
    return _unit(near * (tyres + rng.uniform(0.2, 1.0) * engine))


def handling(rng: Generator) -> Sound:
    """A hand on a phone: bumps and rubbing, cut off at full scale."""
    t = _seconds(rng.uniform(0.3, 2.0))
    slow = np.abs(_band_noise(rng, t.size, -1.0, 0.5, 10.0))
    rub = slow * _band_noise(rng, t.size, -2.0, 20, 2000)
    for _ in range(int(rng.integers(1, 5))):
        bump = _unit(_modes(rng, rng.uniform(30, 200, 3), rng.uniform(1, 5, 3), 3e-3))
        at = int(rng.integers(0, t.size))
        part = bump[: t.size - at]
        rub[at : at + part.size] += rng.uniform(1, 6) * part
    rub = _unit(rub * np.clip(t / 0.02, 0, 1) * np.clip((t[-1] - t) / 0.02, 0, 1))
    level = rng.uniform(0.3, 1.0)
    return np.clip(rub, -level, level) / level


def birds(rng: Generator) -> Sound:
    """Chirps of 1.5 to 6 kHz."""
    parts, at = [], 0.0
    for _ in range(int(rng.integers(2, 15))):
        t = _seconds(rng.uniform(0.02, 0.2))
        f = rng.uniform(1500, 5000) + rng.uniform(-1000, 1000) * t / t[-1]
        parts.append((at, np.sin(np.pi * t / t[-1]) * np.sin(2 * np.pi * f * t)))
        at += t[-1] + rng.uniform(0.01, 0.2)
    return _together(parts)


KINDS: dict[str, Callable[[Generator], Sound]] = {
    "door slams": door,
    "clicks": click,
    "drums": drum,
    "plosives": plosive,
    "gusts of wind": gusts,
    "thunder": thunder,
    "claps": clap,
    "hammer": hammer,
    "rain and hail": rain,
    "footsteps": footstep,
    "barks": bark,
    "speech": speech,
    "cars": car,
    "handling": handling,
    "birdsong": birds,
}


def background(rng: Generator, size: int) -> Sound:
    """Return steady ambient noise of unit rms, pink to brown, and a recorder's hiss."""
    noise = _band_noise(rng, size, rng.uniform(-2.0, -0.7), 10.0, 7000.0)
    return noise + 10 ** rng.uniform(-2.5, -1.0) * rng.standard_normal(size)


def recording(kind: str, seconds: float, seed: int) -> tuple[Sound, int]:
    """Return a recording with events of a kind at random times, and their number.

    Args:
        kind: One of `KINDS`.
        seconds: Its length [s].
        seed: Of its random numbers.
    """
    rng = np.random.default_rng([sorted(KINDS).index(kind), seed])
    sound = background(rng, round(seconds * RATE_HZ))
    at, events = rng.exponential(GAP_S), 0
    while True:
        event = KINDS[kind](rng) * 10 ** (rng.uniform(*LEVELS_DB) / 20)
        start = round(at * RATE_HZ)
        if start + event.size > sound.size:
            return sound, events
        sound[start : start + event.size] += event
        events += 1
        at += rng.exponential(GAP_S) + event.size / RATE_HZ


def explosion(rng: Generator) -> tuple[Sound, int]:
    """Return an explosion after propagation, and the sample of its front.

    Form, absorption, reflections, room, microphone and clipping are all random; no
    pulse is one of the detector's bank.
    """
    duration = np.exp(rng.uniform(np.log(0.0015), np.log(0.05)))
    t = _seconds(8 * duration)
    form = rng.integers(3)
    if form == 0:  # Friedlander with its own negative phase
        b = rng.uniform(0.5, 2.5)
        wave = (1 - t / duration) * np.exp(-b * t / duration)
    elif form == 1:  # N-wave of a burst balloon or a sonic boom
        wave = np.zeros(t.size)
        short = n_wave(2 * duration, 1e-4)[: t.size]
        wave[: short.size] = short
    else:  # positive exponential and a long shallow suction
        wave = (1 - t / duration) * np.exp(-0.5 * t / duration)
        x = t / duration - 1
        suction = -rng.uniform(0.1, 0.4) * x * (1 - x / 4) ** 3
        wave = np.where((x > 0) & (x < 4), suction, np.where(x > 0, 0.0, wave))
    before = 400
    sound = np.r_[np.zeros(before), wave, np.zeros(800)]
    f = np.fft.rfftfreq(sound.size, 1 / RATE_HZ)
    absorbed = np.exp(-0.5 * (f / np.exp(rng.uniform(np.log(600), np.log(8000)))) ** 2)
    corner = rng.choice([0.5, 20.0, 80.0])  # of the microphone, first order [Hz]
    high_passed = 1j * f / (corner + 1j * f)
    sound = np.fft.irfft(np.fft.rfft(sound) * absorbed * high_passed, sound.size)
    if rng.uniform() < 0.7:  # ground reflection
        late = round(rng.uniform(2e-4, 8e-3) * RATE_HZ)
        sound = _together(
            [(0.0, sound), (late / RATE_HZ, rng.uniform(0.3, 0.95) * sound)]
        )
    if rng.uniform() < 0.5:
        sound = _room(rng, sound, rng.uniform(0.3, 2.0), rng.uniform(0.05, 0.5))
    sound = _unit(sound)
    if rng.uniform() < 0.2:
        sound = np.clip(sound, -rng.uniform(0.3, 0.9), rng.uniform(0.3, 0.9))
    return _unit(sound), before
