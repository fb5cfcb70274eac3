"""Are errors of picks right? Two thousand simulated records, and rules of the eye.

    python -m calibration.picks > calibration/results/picks_simulated.txt
    python -m calibration.picks example

Z from 2 to 300, 10 to 500 kHz, SNR (peak over the noise of a sample) from 5 to 1000,
all log-uniform; half of the records drift by 2 to 30 % of the peak, in half the noise
is coloured (an autoregression of 0.3 to 0.9), a quarter come from a sensor that rings.

Nothing in the records is the fit's: the pulse is its formulas again, summed over 32
instants a sample; the sensor is SciPy's bilinear filter run over these; drift is half a
wave of a cosine, which is no parabola. Only what a charge gives at a range (peak,
duration, impulse, suction) comes from jblast's laws.

By eye, the front is the first sample above five times the rms of the first tenth of the
record, whose mean is zero. The peak is the largest sample, the positive phase ends
where the pressure first falls to zero, and the impulse is by the trapezoid rule.

With `example`, ten records to try `jblast pick` and `jblast fit RECORDS/` on are
written to `data/records_example`: what ten gauges about 15 kg of TNT, 50 to 250 m away,
would record by the laws that `jblast listen` takes for the scene
`data/records_example_truth.toml`, with white noise (seed 20), from 25 ms before the
front to 90 ms after it, on one clock.
"""

from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import ArrayLike
from scipy.signal import bilinear, lfilter

from calibration import run_part
from jblast.cli.jax_start import start_jax
from jblast.files import table_text, write_text
from jblast.observations.places import Frame
from jblast.report.view import aligned
from jblast.scene import Charge, Instrument, Scene, read_scene
from jblast.sensors import waves
from jblast.sensors.listening import packets, plan
from jblast.sensors.record_writer import CLOCK, record_comments
from jblast.signals.picks import NAMES as PICKED, pick

MANY, SEEDS = 200, (20, 21, 30, 31, *range(40, 46))
"""Records of a seed."""
SAMPLES, FINE = 4096, 32
SHORTEST, LONGEST = 6.0, 700.0
"""Samples of a positive phase that a record may have."""
NORMAL_90 = 1.6449
NAMES = ("arrival", "peak", "duration", "impulse")
UNKNOWNS = (*NAMES[:3], "decay", "rise", "suction", "suction_duration")
QUIET_SHARE, THRESHOLD = 0.1, 5.0
"""Initial share of a record, and multiple of its rms, by which an eye sees a front."""


class Made(NamedTuple):
    """What is in a record: times in samples, pressures in pascals."""

    scaled_distance: float
    rate: float
    snr: float
    arrival: float
    peak: float
    duration: float
    decay: float
    rise: float
    suction: float
    suction_duration: float
    drift: float
    period: float
    phase: float
    colour: float
    resonance: float
    damping: float

    @property
    def impulse(self) -> float:
        """Of the positive phase [Pa samples]."""
        b = self.decay
        behind = (b - 1.0 + np.exp(-b)) / b**2
        return self.peak * (0.5 * self.rise + (self.duration - self.rise) * behind)


def drawn(many: int, rng: np.random.Generator) -> list[Made]:
    """Draw what records hold: Z of 2 to 300, 10 to 500 kHz, SNR of 5 to 1000."""

    def even(low: float, high: float, size: int | None = None) -> Any:
        return np.exp(rng.uniform(np.log(low), np.log(high), size))

    z, mass, rate = (even(*x, 4 * many) for x in ((2, 300), (0.05, 100), (1e4, 5e5)))

    @jax.jit
    @jax.vmap
    def pulses(mass, z):
        place = jnp.stack([z * mass ** (1 / 3), jnp.zeros(()), jnp.zeros(())])
        return waves(Scene(Charge(mass_kg=mass)), place)[0].pulse

    pulse = jax.tree.map(np.asarray, pulses(jnp.asarray(mass), jnp.asarray(z)))
    found: list[Made] = []
    for k in range(4 * many):
        length = pulse.duration[k] * rate[k]
        if len(found) == many or not SHORTEST <= length <= LONGEST:
            continue
        rise = pulse.rise_time[k] * rate[k] + even(0.3, 8.0)
        if rise > 0.3 * length:
            continue
        found.append(
            Made(
                scaled_distance=z[k],
                rate=rate[k],
                snr=even(5.0, 1000.0),
                arrival=rng.uniform(200.0, 900.0),
                peak=pulse.peak[k],
                duration=length,
                decay=pulse.decay[k],
                rise=rise,
                suction=pulse.suction[k],
                suction_duration=pulse.suction_duration[k] * rate[k],
                drift=pulse.peak[k] * rng.uniform(0.02, 0.3) * (rng.random() < 0.5),
                period=rng.uniform(2.0, 5.0) * SAMPLES,
                phase=rng.uniform(0.0, 2.0 * np.pi),
                colour=rng.uniform(0.3, 0.9) * (rng.random() < 0.5),
                resonance=rng.uniform(0.06, 0.3) * (rng.random() < 0.25),
                damping=rng.uniform(0.02, 0.08),
            )
        )
    return found


def signal_of(made: Made, first: int = 0, count: int = SAMPLES) -> np.ndarray:
    """Return samples without noise, of some in a row."""
    t = first + (np.arange(count * FINE) + 0.5) / FINE - 0.5 - made.arrival
    x = np.clip(t / made.rise, 0.0, 1.0)
    s = np.clip((t - made.rise) / (made.duration - made.rise), 0.0, 1.0)
    q = np.clip((t - made.duration) / made.suction_duration, 0.0, 1.0)
    shape = np.where(x < 1.0, 3 * x**2 - 2 * x**3, (1 - s) * np.exp(-made.decay * s))
    pressure = made.peak * shape - 6.75 * made.suction * q * (1 - q) ** 2
    if made.resonance:
        omega = 2.0 * np.pi * made.resonance
        poles = [1.0, 2.0 * made.damping * omega, omega**2]
        pressure = np.asarray(lfilter(*bilinear([omega**2], poles, FINE), pressure))
    turn = 2.0 * np.pi * (first + np.arange(count)) / made.period + made.phase
    return pressure.reshape(count, FINE).mean(axis=1) + made.drift * np.cos(turn)


def noise_of(made: Made, rng: np.random.Generator) -> np.ndarray:
    """Return noise, its standard deviation the peak over the SNR."""
    white = rng.standard_normal(SAMPLES + 400)
    coloured = lfilter([np.sqrt(1.0 - made.colour**2)], [1.0, -made.colour], white)
    return made.peak / made.snr * np.asarray(coloured)[400:]


def arrival_bound(made: Made) -> float:
    """Return the Cramer-Rao bound of the arrival [samples]; a cubic drift is free.

    By central differences of the signal, whitened by the noise that is in it. Frequency
    and damping of a sensor that rings are free, too.
    """
    first = max(0, int(made.arrival - max(64, 1.5 * made.duration)))
    count = min(SAMPLES - first, int(made.arrival - first + 4.5 * made.duration) + 1)
    columns = []
    for name in (*UNKNOWNS, *(("resonance", "damping") if made.resonance else ())):
        size = 0.02 if name == "arrival" else 1e-3 * getattr(made, name)
        up, down = (
            signal_of(made._replace(**{name: getattr(made, name) + x}), first, count)
            for x in (size, -size)
        )
        columns.append((up - down) / (2 * size))
    x = np.linspace(-1.0, 1.0, count)
    columns += [made.peak * x**k for k in range(4)]
    white = lfilter([1.0, -made.colour], [1.0], np.array(columns), axis=1)
    jacobian = np.asarray(white)[:, 1:]
    sigma = made.peak / made.snr * np.sqrt(1.0 - made.colour**2)
    information = jacobian @ jacobian.T / sigma**2
    scale = 1.0 / np.sqrt(np.diag(information))
    inverse = np.linalg.pinv(information * np.outer(scale, scale), rcond=1e-13)
    return float(scale[0] * np.sqrt(inverse[0, 0]))


class EyePick(NamedTuple):
    """Values read from a record by eye; NaN if a rule does not apply.

    Attributes:
        air_arrival_s: Time of the first sample above the threshold [s].
        peak_overpressure_pa: Largest sample from there on [Pa].
        positive_duration_s: Time from the arrival to the first zero [s].
        positive_impulse_pa_s: Integral between these by the trapezoid rule [Pa s].
    """

    air_arrival_s: float = np.nan
    peak_overpressure_pa: float = np.nan
    positive_duration_s: float = np.nan
    positive_impulse_pa_s: float = np.nan


def eye_pick(time_s: ArrayLike, pressure_pa: ArrayLike) -> EyePick:
    """Pick a record by rules.

    Args:
        time_s: Time of each sample [s].
        pressure_pa: Overpressure of one record [Pa].
    """
    time, pressure = np.asarray(time_s, float), np.asarray(pressure_pa, float)
    quiet = pressure[: max(2, int(QUIET_SHARE * pressure.size))]
    above = pressure - quiet.mean()
    over = above > THRESHOLD * max(float(quiet.std()), 1e-12 * np.ptp(above))
    if not over.any():
        return EyePick()
    first = int(np.argmax(over))
    top = first + int(np.argmax(above[first:]))
    fallen = above[top:] <= 0
    if not fallen.any():
        return EyePick(float(time[first]), float(above[top]))
    last = top + int(np.argmax(fallen))
    end = np.interp(0.0, above[[last, last - 1]], time[[last, last - 1]])
    within = np.append(above[first:last], 0.0)
    impulse = np.trapezoid(within, np.append(time[first:last], end))
    start = float(time[first])
    return EyePick(start, float(above[top]), float(end - start), float(impulse))


class Seed(NamedTuple):
    """Records of one seed, and what is picked of them; the record along the last axis.

    Attributes:
        made: What is in them.
        pick: Arrival in samples, the logarithms of the others.
        sd: Their standard deviations.
        named: Whether the sensor was named as one that rings.
        bound: Cramer-Rao bounds of their arrivals [samples].
        eye: As `pick`, by the rules of an eye.
    """

    made: Sequence[Made]
    pick: np.ndarray
    sd: np.ndarray
    named: np.ndarray
    bound: np.ndarray
    eye: np.ndarray


def of_seed(seed: int) -> Seed:
    """Make and pick the records of one seed."""
    start_jax()
    rng = np.random.default_rng(seed)
    made = drawn(MANY, rng)
    records = [signal_of(one) + noise_of(one, rng) for one in made]
    # in samples, whatever the rate: nothing in a pick depends on the unit of time
    time = np.arange(SAMPLES, dtype=float)
    picks = [pick(time, x) for x in records]
    read = [[getattr(one, name) for name in PICKED[:4]] for one in picks]
    sds = [np.sqrt(np.diag(one.covariance)) for one in picks]
    named = [any(note == "resonating" for note in one.notes) for one in picks]
    bound = [arrival_bound(one) for one in made]
    eye = [eye_pick(time, x) for x in records]
    named, bound = np.array(named), np.array(bound)
    return Seed(made, logs(read), np.transpose(sds), named, bound, logs(eye))


def logs(rows: ArrayLike) -> np.ndarray:
    """Return one row for each of `NAMES`: the arrival, and ln of the others."""
    columns = np.array(rows, float).T
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.concatenate([columns[:1], np.log(columns[1:])])


def simulated() -> None:
    """Print the tables."""
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
        seeds = list(pool.map(of_seed, SEEDS))
    made = [one for seed in seeds for one in seed.made]
    found, sd, named, bound, eye = (
        np.concatenate(each, axis=-1)
        for each in zip(*(seed[1:] for seed in seeds), strict=True)
    )
    value = {name: np.array([getattr(o, name) for o in made]) for name in Made._fields}
    truth = logs([[getattr(o, name) for name in NAMES] for o in made])
    error, eye_error = found - truth, eye - truth
    has_pulse = np.isfinite(found[1])
    drift, colour, rings = (value[x] > 0 for x in ("drift", "colour", "resonance"))
    snr, z, wide = value["snr"], value["scaled_distance"], value["rise"] >= 2
    groups = {
        "all": np.ones(len(made), bool),
        "white, steady, no ring": ~drift & ~colour & ~rings,
        "drift": drift,
        "coloured noise": colour,
        "sensor rings": rings,
        "SNR below 20": snr < 20,
        "SNR above 200": snr > 200,
        "Z below 10": z < 10,
        "Z above 60": z > 60,
    }
    names = ", ".join(str(seed) for seed in SEEDS)
    print(f"{len(made)} records of {SAMPLES} samples, seeds {names}\n")
    print("Bias in standard deviations, share of 90 % intervals that hold the truth")
    heads = [f"{name} {word}" for name in NAMES for word in ("bias", "90 %")]
    rows = [["", "records", "found", *heads]]
    for name, inside in groups.items():
        away = (error / sd)[:, inside & has_pulse]
        # the median is the bias of most; a mean is that of the few that went astray
        each = zip(np.median(away, axis=1), np.abs(away) < NORMAL_90, strict=True)
        cells = [
            x for b, held in each for x in (f"{b:+.2f}", f"{100 * held.mean():.1f}")
        ]
        share = 100 * has_pulse[inside].mean()
        rows.append([name, str(inside.sum()), f"{share:.1f} %", *cells])
    print("\n".join(aligned(rows)), end="\n\n")
    print(
        "Rms error of the arrival over what it is held against: all but the worst 1 %,"
    )
    print("all, and by the median; a bound knows whether the sensor rings")
    rows = [["", "records", "rms/bound", "of all", "median rms/bound"]]
    for name, some, against in (
        ("rise of 2 samples or more, Cramer-Rao", wide, bound),
        ("no ring", wide & ~rings, bound),
        ("a ring that was found", wide & rings & named, bound),
        ("a ring that was overlooked", wide & rings & ~named, bound),
        ("rise below 2 samples, dt/sqrt(12)", ~wide, 12**-0.5 + 0 * bound),
    ):
        ratio = np.abs(error[0] / against)[some & has_pulse]
        low = ratio[ratio <= np.quantile(ratio, 0.99)]
        rms = [np.sqrt(np.mean(x**2)) for x in (low, ratio)]
        cells = [f"{x:.2f}" for x in (*rms, np.median(ratio) / 0.6745)]
        rows.append([name, str(ratio.size), *cells])
    print("\n".join(aligned(rows)), end="\n\n")
    print("Errors (68 % are below): arrival in samples, ln of the rest")
    rows = [["", *(f"{name} {by}" for name in NAMES for by in ("pick", "eye"))]]
    for name, inside in groups.items():
        pairs = zip(error[:, inside], eye_error[:, inside], strict=True)
        sizes = [np.abs(x[np.isfinite(x)]) for pair in pairs for x in pair]
        rows.append([name, *(f"{np.quantile(size, 0.68):.3g}" for size in sizes)])
    print("\n".join(aligned(rows)))


DATA = Path(__file__).parent / "data"
ORIGIN = Frame(52.0, 5.0, 10.0)
"""Where on the Earth the example is put: flat land, a little above the sea."""
EXAMPLE_SEED, BEFORE_S, AFTER_S = 20, 0.025, 0.09
HEAD = "# SIMULATED, not measured: where the gauges of records_example stood\n"


def example() -> None:
    """Write the records of the example, and its stations in metres and in degrees."""
    start_jax(quick=True)
    truth, folder = DATA / "records_example_truth.toml", DATA / "records_example"
    listening = plan(read_scene(truth), EXAMPLE_SEED, None)
    folder.mkdir(exist_ok=True)
    said = record_comments(listening, truth.name, EXAMPLE_SEED)
    comments = [
        *(line for line in said if line != CLOCK),
        "cut from 25 ms before the front to 90 ms after it; one clock for all gauges",
    ]
    for number, sensor in enumerate(listening.sensors):
        (samples,) = packets(listening, sensor)
        rate_hz = (sensor.instrument or Instrument()).rate
        arrival = float(listening.truth.values["air_arrival_s"][number, 0])
        first = int((arrival - BEFORE_S) * rate_hz)
        stretch = samples[first : first + round((BEFORE_S + AFTER_S) * rate_hz), 0]
        times = (first + np.arange(stretch.size)) / rate_hz
        rows = [[f"{t:.5f}", f"{p:.1f}"] for t, p in zip(times, stretch, strict=True)]
        table = table_text([["time_s", "overpressure_pa"], *rows], comments)
        write_text(folder / f"{sensor.name}.csv", table)
    metres = np.array([sensor.position_m for sensor in listening.sensors])
    # eight digits of a degree are a millimetre
    for name, columns, places, forms in (
        ("STATIONS", "east_m north_m up_m", metres, ["{:g}"] * 3),
        (
            "STATIONS_degrees",
            "lat_deg lon_deg alt_m",
            ORIGIN.to_geodetic(metres),
            ["{:.8f}", "{:.8f}", "{:.3f}"],
        ),
    ):
        rows = [
            [sensor.name, *(form.format(x) for form, x in zip(forms, at, strict=True))]
            for sensor, at in zip(listening.sensors, places.tolist(), strict=True)
        ]
        table = table_text([["sensor", *columns.split()], *rows])
        write_text(folder / f"{name}.csv", HEAD + table)


if __name__ == "__main__":
    run_part({"simulated": simulated, "example": example})
