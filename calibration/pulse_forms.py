"""Coverage of picks for pulses of several forms, by an independent generator.

    python -m calibration.pulse_forms > calibration/results/pulse_forms.txt

The generator is NumPy and SciPy alone and shares no formula with the fit. A record has
one of five negative phases and one of five rises, each pair equally often:

- negative phase: none; cubic (Granstroem 1956); half-sine; triangle that is deepest at
  a quarter of its duration (UFC 3-340-02, figure 2-8); the Friedlander formula
  p0 (1 - t/td) exp(-b t/td) continued for all t;
- rise: step, linear, exponential 1 - exp(-t/tau), half a cosine, and the Gaussian
  integral from 2.5 standard deviations on. In half of the records the rise multiplies
  the Friedlander formula, in the others the decay begins at its end.

Arrival is the start of the rise. Peak, duration and impulse are those of the pressure
without noise and sensor. Durations are 20 to 2,000 samples, b is 0.2 to 5, the signal
to noise ratio (peak over the noise of a sample) 10 to 300 and rises 0.5 to 50 samples,
all log-uniform, but a rise is at most a tenth of the duration. Half of the records have
coloured noise (autoregression of 0.3 to 0.9), and half are sampled at instants, the
others as means over a sample. Records end 1.6 durations or more behind the front,
so the negative phase of the longest is cut off.
"""

import argparse
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from typing import NamedTuple

import numpy as np
from scipy.signal import lfilter

from calibration.picks_records import Picked, picked

SAMPLES = 4096
FINE = 32
"""Instants per sample, of the mean over it and of the integrals."""

NEGATIVE = ("none", "cubic", "half-sine", "triangle", "continued")
RISES = ("step", "linear", "exponential", "cosine", "Gaussian")
NAMES = ("arrival", "peak", "duration", "impulse")
PER_PAIR = 80
"""Records of each pair: 400 of each kind, so that a coverage of 0.9 has a standard
error of 0.015."""

FEWEST = 100
"""Kinds of fewer picks are not counted among the worst: the standard error of a
coverage of 0.9 is above 0.03."""

NORMAL_90 = 1.6449
SEED = 38


class Form(NamedTuple):
    """Pressure of one record; times in samples, the peak of the formula is 1."""

    negative: str
    rise: str
    multiplied: bool
    at_instants: bool
    arrival: float
    duration: float
    decay: float
    rise_time: float
    depth: float
    negative_duration: float
    snr: float
    colour: float


class Truth(NamedTuple):
    """Values of the pressure without noise, in the order of `NAMES`."""

    arrival: float
    peak: float
    duration: float
    impulse: float


def drawn(per_pair: int, rng: np.random.Generator) -> list[Form]:
    """Draw the forms of records, each pair of rise and negative phase equally often."""

    def log_uniform(low: float, high: float) -> float:
        return float(np.exp(rng.uniform(np.log(low), np.log(high))))

    forms = []
    for negative in NEGATIVE:
        for rise in RISES:
            for _ in range(per_pair):
                duration = log_uniform(20.0, 2000.0)
                time = min(log_uniform(0.5, 50.0), 0.1 * duration)
                forms.append(
                    Form(
                        negative=negative,
                        rise=rise,
                        multiplied=rise == "exponential" or rng.random() < 0.5,
                        at_instants=rng.random() < 0.5,
                        arrival=rng.uniform(300.0, 900.0),
                        duration=duration,
                        decay=log_uniform(0.2, 5.0),
                        # an exponential reaches 95 % in three time constants
                        rise_time=0.0 if rise == "step" else time,
                        depth=rng.uniform(0.1, 0.4),
                        negative_duration=duration * rng.uniform(1.5, 4.5),
                        snr=log_uniform(10.0, 300.0),
                        colour=rng.uniform(0.3, 0.9) * (rng.random() < 0.5),
                    )
                )
    return forms


def pressure_at(form: Form, time):
    """Return the pressure at instants; times in samples."""
    t = time - form.arrival
    late = t >= 0.0
    t = np.where(late, t, 0.0)
    if form.rise_time == 0.0:
        risen = np.ones_like(t)
    else:
        risen = _risen(form.rise, t / form.rise_time)
    if form.multiplied or form.rise_time == 0.0:
        s = t / form.duration
    else:
        s = np.maximum(t - form.rise_time, 0.0) / (form.duration - form.rise_time)
    pressure = risen * (1.0 - s) * np.exp(-form.decay * s)
    if form.negative != "continued":
        over = s > 1.0
        r = (t - form.duration) / form.negative_duration
        sucked = _sucked(form.negative, np.clip(r, 0.0, 1.0))
        pressure = np.where(over, -form.depth * sucked, pressure)
    return np.where(late, pressure, 0.0)


def _risen(rise: str, x):
    """Return the share of the rise that is reached after x rise times."""
    if rise == "linear":
        return np.minimum(x, 1.0)
    if rise == "exponential":
        return -np.expm1(-3.0 * x)
    if rise == "cosine":
        return 0.5 - 0.5 * np.cos(np.pi * np.minimum(x, 1.0))
    # the Gaussian integral from -2.5 to 2.5 standard deviations
    grid = np.linspace(-2.5, 2.5, 2001)
    density = np.exp(-0.5 * grid**2)
    integral = np.concatenate([[0.0], np.cumsum(0.5 * (density[1:] + density[:-1]))])
    return np.interp(x, (grid + 2.5) / 5.0, integral / integral[-1])


def _sucked(negative: str, r):
    """Return the share of the depth at a share of the negative phase."""
    if negative == "none":
        return np.zeros_like(r)
    if negative == "half-sine":
        return np.sin(np.pi * r)
    if negative == "triangle":
        return np.where(r < 0.25, 4.0 * r, (1.0 - r) / 0.75)
    return 27.0 / 4.0 * r * (1.0 - r) ** 2


def truth_of(form: Form) -> Truth:
    """Return the values of the pressure itself, by a fine grid."""
    near = np.linspace(0.0, min(8.0 * form.rise_time + 1.0, form.duration), 40001)
    rest = np.linspace(near[-1], form.duration, 40001)
    p = [pressure_at(form, form.arrival + t) for t in (near, rest)]
    impulse = float(np.trapezoid(p[0], near) + np.trapezoid(p[1], rest))
    peak = float(max(p[0].max(), p[1].max()))
    return Truth(form.arrival, peak, form.duration, impulse)


def samples_of(form: Form, rng: np.random.Generator):
    """Return the samples of a record, noise and a constant offset included."""
    index = np.arange(SAMPLES)
    if form.at_instants:
        signal = pressure_at(form, index.astype(float))
    else:
        fine = (np.arange(SAMPLES * FINE) + 0.5) / FINE - 0.5
        signal = pressure_at(form, fine).reshape(SAMPLES, FINE).mean(axis=1)
    white = rng.standard_normal(SAMPLES + 200)
    scale = np.sqrt(1.0 - form.colour**2)
    noise = np.asarray(lfilter([scale], [1.0, -form.colour], white))
    return signal + noise[200:] / form.snr + rng.normal(0.0, 0.02)


def main(per_pair: int, workers: int, save: str | None) -> None:
    """Print the tables."""
    rng = np.random.default_rng(SEED)
    forms = drawn(per_pair, rng)
    samples = np.array([samples_of(form, rng) for form in forms])
    truth = np.array([truth_of(form) for form in forms]).T
    if workers > 1:
        spawned = get_context("spawn")
        with ProcessPoolExecutor(workers, mp_context=spawned) as pool:
            parts = pool.map(picked, np.array_split(samples, workers))
        found = Picked(*(np.concatenate(x, axis=-1) for x in zip(*parts, strict=True)))
    else:
        found = picked(samples)
    if save:
        np.savez(save, truth=truth, **found._asdict())
    print(tables(forms, truth, found))


def tables(forms: list[Form], truth, found: Picked) -> str:
    """Return the tables of coverage."""
    from jblast.report.view import aligned

    sd, quality = found.sd, found.quality
    expected = truth.copy()
    expected[1:] = np.log(truth[1:])
    z = np.abs(found.value - expected) / sd
    negative = np.array([form.negative for form in forms])
    rise = np.array([form.rise for form in forms])
    snr = np.array([form.snr for form in forms])
    time = np.array([form.rise_time for form in forms])
    duration = np.array([form.duration for form in forms])
    kinds = {"all": np.ones(len(forms), bool)}
    kinds |= {f"negative phase: {name}": negative == name for name in NEGATIVE}
    kinds |= {f"rise: {name}": rise == name for name in RISES}
    kinds |= {
        "SNR below 30": snr < 30,
        "SNR above 100": snr > 100,
        "rise below 2 samples": time < 2,
        "rise of 2 to 10 samples": (time >= 2) & (time < 10),
        "rise of 10 samples or more": time >= 10,
        "duration below 50 samples": duration < 50,
        "duration above 500 samples": duration > 500,
    }
    lines = [f"{len(forms)} records of {SAMPLES} samples, seed {SEED}", ""]
    for words, chosen in (("good", "good"), ("doubtful", "doubtful")):
        lines.append(f"Share of 90 % intervals that contain the truth, {words} picks")
        rows = [["", "records", *NAMES]]
        shares = {}
        for name, inside in kinds.items():
            some = inside & (quality == chosen)
            held = [float(np.mean(row[some] < NORMAL_90)) for row in z if some.any()]
            cells = [f"{share:.3f}" for share in held] or ["-"] * len(NAMES)
            rows.append([name, str(int(some.sum())), *cells])
            if some.sum() >= FEWEST:
                each = zip(NAMES, held, strict=True)
                shares |= {(name, which): share for which, share in each}
        for word, least in (("lowest", min), ("highest", max)):
            if shares:
                name, which = least(shares, key=lambda key: shares[key])
                share = shares[name, which]
                lines.append(f"{word}: {share:.3f}, {which}, {name}")
        lines += [*aligned(rows), ""]
    lines.append("Share of picks without a value: poor, and poor or doubtful;")
    lines.append("median width of a 90 % interval: arrival in samples, others in %")
    rows = [["", "records", "poor", "not good", *NAMES]]
    for name, inside in kinds.items():
        some = inside & (quality != "poor")
        width = 2.0 * NORMAL_90 * np.median(sd[:, some], axis=1)
        cells = [f"{width[0]:.3f}", *(f"{100 * x:.2f}" for x in width[1:])]
        poor, less = quality[inside] == "poor", quality[inside] != "good"
        share = [f"{np.mean(poor):.3f}", f"{np.mean(less):.3f}"]
        rows.append([name, str(int(inside.sum())), *share, *cells])
    return "\n".join([*lines, *aligned(rows)]) + "\n"


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("per_pair", nargs="?", type=int, default=PER_PAIR)
    parser.add_argument("--workers", type=int, default=1, help="processes")
    parser.add_argument("--save", help="NumPy file of values, errors and truths")
    given = parser.parse_args()
    main(given.per_pair, given.workers, given.save)
