r"""Cost against error of every method: the table, the page and the figures.

    python -m calibration.charts [TOPIC ...]            # page and figures, as kept
    python -m calibration.charts [TOPIC ...] --measure  # measured again on this machine

A topic has panels, a panel has methods with a cost, an error and at most one reference.
Rows are kept in `results/charts.csv`; the page `results/charts.md` has all of them.

Laws are compared with the reference of their quantity. Waveforms are compared with the
shock solver (`calibration.euler`) at gauges of a point source, where the closed forms
have the peak, durations, impulses and underpressure of the solver's history: only the
shape is compared. The logs of `fit` have poor starts (`stability_fits`); a fit misses
if its likelihood is lower than a shift by 0.1 standard deviations would make it. The
reference of `sampler` is a long walk. Draws of `montecarlo` have an exact mean and an
exact probability. Camera events are those of a bright disc with known events. Flights
are compared with steps of 0.05 ms. Thresholds of a detector are exceeded in 1 % of the
windows without a blast. The records of `records` are those of six gauges about 15 kg.
"""

import argparse
import functools
import itertools
import math
import textwrap
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from time import perf_counter
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke
from matplotlib.ticker import EngFormatter, FuncFormatter, LogLocator, NullFormatter
from matplotlib.transforms import Bbox
from scipy.interpolate import PchipInterpolator
from scipy.optimize import least_squares
from scipy.special import ndtr, ndtri
from scipy.stats import qmc

from calibration import cases, stability_fits as poor, table_rows
from calibration.euler import decay_at, march
from calibration.picks import eye_pick
from calibration.timing import best_of, machine, seconds
from jblast.cli.jax_start import start_jax
from jblast.constants import STANDARD_PRESSURE
from jblast.files import table_text, write_text
from jblast.inference import solve
from jblast.inference.answer import unconstrained
from jblast.inference.density import Density, density_of
from jblast.inference.mcmc import walk
from jblast.inference.regions import quantiles
from jblast.inference.sample import ORDINARY, sample
from jblast.observations import Observations
from jblast.observations.table import RECORD_QUANTITIES
from jblast.progress import in_words
from jblast.quantities import QUANTITIES
from jblast.registry import call, law_for
from jblast.report.colours import BLUE, INK, MUTED, VERMILLION
from jblast.report.figures import new_figure, quiet, titled, write_figure
from jblast.report.numbers import capitalised
from jblast.report.view import Column, Table, markdown
from jblast.scene import Charge, Scene, UncertainScene, freed, with_laws
from jblast.scene.charge import BURSTS
from jblast.sensors.camera.pixel import NoiseModel, Pixel, noisy_pixel
from jblast.sensors.camera.stream import event_stream
from jblast.sensors.simulated_readings import readings
from jblast.signals import filtered, matched_kernel, threshold_for, white_noise
from jblast.signals.picks import pick_records
from jblast.vehicle import (
    PositionHold,
    State,
    blast_load,
    named,
    named_gains,
    simulate,
)
from jblast.waves import kingery_bulmash_pressure
from jblast.waves.choice import compared
from jblast.waves.friedlander import friedlander_decay
from jblast.waves.pulse import friedlander_pressure

RESULTS = Path(__file__).parent / "results"
KEPT = RESULTS / "charts.csv"
SHOWN = ("arrival", "sampler", "vehicle", "records", "montecarlo")
"""Topics whose figure a page of the manual shows; others are drawn in `out/charts`."""


class Point(NamedTuple):
    """Measured cost and error of one method.

    Attributes:
        panel: Panel of the figure; methods compete within one panel.
        method: Name of the method.
        cost_s: Cost as defined by the topic [s].
        error: Error as defined by the topic, positive.
        over: Range of the measurement.
        whole: True if the range covers the panel; others are not on its Pareto front.
        reference: True if the other methods of the panel are compared with this one.
    """

    panel: str
    method: str
    cost_s: float
    error: float
    over: str = ""
    whole: bool = True
    reference: bool = False


class Topic(NamedTuple):
    """One figure: title, definitions of cost and error, and the measurement.

    Attributes:
        title: Title of the figure.
        cost: Definition of the cost.
        error: Definition of the error.
        measure: Function that measures all points.
        relative: True if an error is a share, drawn in per cent.
        orders: Expected orders of convergence, by the first word of the methods.
    """

    title: str
    cost: str
    error: str
    measure: Callable[[], list[Point]]
    relative: bool = True
    orders: Mapping[str, int] = {}


# Laws
BANDS = ((0.5, 3.0), (3.0, 40.0), (40.0, 1000.0))
"""Scaled distances of the panels [m/kg^(1/3)]; 40 ends the Kingery-Bulmash tables."""
READINGS = 1 << 17
"""Readings in a timed call of a law: the time of the call itself does not count."""
PER_BAND, MIN_NODES = 80, 5
"""Places compared in a band; with fewer nodes the largest error of a law depends on
their choice."""
JUST_PAST = 1.0 + 1e-9


def method_seconds(quantity: str, method: str) -> float:
    """Return the time of a reading by a law, many at once [s]."""
    law = law_for(quantity, method)
    rng = np.random.default_rng(0)
    # In random order: sorted ranges would read neighbouring rows of a table.
    z, mass = (
        jnp.asarray(np.exp(rng.uniform(math.log(low), math.log(high), READINGS)))
        for low, high in ((0.07, 40.0), (1e-2, 1e6))
    )
    pressure = jnp.asarray(rng.uniform(7e4, 1.05e5, READINGS))
    distance = z * jnp.cbrt(mass * STANDARD_PRESSURE / pressure)
    path = replace(
        jax.tree.map(jnp.asarray, cases.standard_path(np.ones(READINGS), "surface")),
        slant_range=distance,
        ground_range=distance,
        charge_mass=mass,
        ambient_pressure=pressure,
    )
    compiled = eqx.filter_jit(lambda path: call(law.function, path))
    return seconds(lambda: compiled(path)) / READINGS


def law_points(quantity: str) -> list[Point]:
    """Return cost and largest error of every law, by burst and band."""
    points, costs = [], {}
    for (start, end), burst in itertools.product(BANDS, BURSTS):
        # just past a join of two references, the farther one holds
        z = np.geomspace(start * JUST_PAST, end, PER_BAND)
        found = compared(quantity, [cases.standard_path(z, burst)])
        own = found.uncertainty[np.isfinite(found.uncertainty)].max()
        where = "surface" if burst == "surface" else "free air"
        for i, law in enumerate(found.laws):
            known = np.isfinite(found.error[i])
            if known.sum() < MIN_NODES:
                continue
            if law.name not in costs:
                costs[law.name] = method_seconds(quantity, law.name)
            low, high = z[known][[0, -1]]
            points.append(
                Point(
                    f"{where}, Z = {start:g} to {end:g}",
                    law.name,
                    costs[law.name],
                    max(own, found.error[i, known].max()),
                    f"{where}, Z = {low:.3g} to {high:.3g} m/kg^(1/3)",
                    bool(known.all()),
                    bool((found.law[0] == i).all()),
                )
            )
    return points


# Waveforms
GAUGES = (0.5, 2.0, 10.0)
"""lambda of the gauges: shocks of 1.9, 0.17 and 0.02 ambient pressures."""
GAUGES_END = 12.5
"""lambda of the shock at the end: behind the negative phase at the last gauge."""
CELLS = (50, 100, 200, 400)
"""Cells of the runs; the last is the reference."""
SAMPLES, BATCH = 256, 4096
"""Samples of a waveform, and waveforms in a timed call."""


class Pulse(NamedTuple):
    """Peak, duration and impulse; largest underpressure and its impulse, positive."""

    peak: Any
    duration: Any
    impulse: Any
    suction: Any
    suction_impulse: Any


def _own_tail(time, pulse: Pulse):
    decay = friedlander_decay(pulse.peak, pulse.impulse, pulse.duration)
    return friedlander_pressure(time, pulse.peak, pulse.duration, decay)


def _printed(time, pulse: Pulse):
    return friedlander_pressure(time, pulse.peak, pulse.duration, 1.0)


def _cubic(time, pulse: Pulse):
    # the cubic 6.75 s (1 - s)^2 has an area of 9/16
    length = 16.0 / 9.0 * pulse.suction_impulse / pulse.suction
    s = jnp.clip((time - pulse.duration) / length, 0.0, 1.0)
    after = -6.75 * pulse.suction * s * jnp.square(1.0 - s)
    return jnp.where(time < pulse.duration, _own_tail(time, pulse), after)


FORMS: dict[str, dict[str, Callable]] = {
    "positive phase": {
        "triangle": lambda t, p: p.peak * jnp.maximum(1.0 - t / p.duration, 0.0),
        "Friedlander, b = 1": _printed,
        "Friedlander, b of impulse": _own_tail,
    },
    "both phases": {
        "b = 1, own tail": _printed,
        "b of impulse, own tail": _own_tail,
        "b of impulse, then nothing": lambda t, p: jnp.where(
            t < p.duration, _own_tail(t, p), 0.0
        ),
        "b of impulse, then cubic": _cubic,
    },
}
"""Closed forms by phase: overpressure against the time since arrival."""


def form_seconds(form: Callable) -> float:
    """Return the time of a waveform in a float64 batch [s]."""
    rng = np.random.default_rng(0)
    peak, duration, fraction, suction, length = (
        jnp.asarray(rng.uniform(*bounds, (BATCH, 1)))
        for bounds in ((1e3, 1e5), (1e-3, 1e-1), (0.2, 0.5), (0.05, 0.4), (1.0, 5.0))
    )
    low = suction * peak
    pulse = Pulse(
        peak, duration, fraction * peak * duration, low, low * length * duration
    )
    time = jnp.linspace(0.0, 4.0, SAMPLES)[None, :] * duration
    compiled = jax.jit(form)
    return seconds(lambda: compiled(time, pulse)) / BATCH


def waveform_at(history, column: int) -> tuple[PchipInterpolator, Pulse, float]:
    """Return the overpressure at a gauge since arrival, its pulse and its end."""
    front = decay_at(np.array([GAUGES[column]]), history)
    # decay_at counts time in ambient sound speeds, the history in sqrt(P_0/rho_0)
    arrival = float(front.arrival[0]) / math.sqrt(1.4)
    past = history.time > arrival
    since = np.concatenate([[0.0], history.time[past] - arrival])
    peak = float(front.overpressure_ratio[0])
    record = np.concatenate([[peak], history.pressure[past, column] - 1.0])
    pressure = PchipInterpolator(since, record)
    # the first zero ends the positive phase, the second the negative one
    duration, end = pressure.roots(extrapolate=False)[:2]
    turns = pressure.derivative().roots(extrapolate=False)
    lowest = pressure(turns[(turns > duration) & (turns < end)]).min()
    areas = pressure.integrate(0.0, duration), -pressure.integrate(duration, end)
    return pressure, Pulse(peak, duration, areas[0], -lowest, areas[1]), float(end)


def waveform_points() -> list[Point]:
    """Return cost and rms error of every form, for both phases at each gauge.

    Errors below the uncertainty of the reference (Richardson) are set to it.
    """
    costs, runs = {}, {}
    for cells in CELLS:
        costs[cells], runs[cells] = best_of(
            lambda n=cells: march(n, GAUGES_END, stride=4, gauges=GAUGES)[1], 1
        )
    points = []
    for (column, gauge), (what, forms) in itertools.product(
        enumerate(GAUGES), FORMS.items()
    ):
        waves = {cells: waveform_at(runs[cells], column) for cells in CELLS}
        true, pulse, end = waves[CELLS[-1]]
        time = np.linspace(0.0, pulse.duration if "positive" in what else end, SAMPLES)

        def rms(one, other, peak=pulse.peak) -> float:
            return float(np.sqrt(np.mean(np.square(one - other)))) / peak

        coarse, middle, fine = (waves[cells][0](time) for cells in CELLS[-3:])
        last = rms(middle, fine)
        # orders between 0.8 and 2.5; near a zero of the error the estimate is arbitrary
        ratio = np.clip(rms(coarse, middle) / last, 2.0**0.8, 2.0**2.5)
        least = last / (ratio - 1.0)
        panel = f"{what}, lambda = {gauge:g}"
        over = f"{panel}, peak {pulse.peak:.2g} ambient pressures"
        for name, form in forms.items():
            off = rms(np.asarray(form(jnp.asarray(time), pulse)), true(time))
            points.append(Point(panel, name, form_seconds(form), max(least, off), over))
        for cells, (wave, _, _) in waves.items():
            off, last_one = rms(wave(time), true(time)), cells == CELLS[-1]
            points.append(
                Point(
                    panel,
                    f"{cells} cells",
                    costs[cells],
                    max(least, off),
                    over,
                    reference=last_one,
                )
            )
    return points


# Fits
LOGS, SOLVED, LOOPED = 2000, 100, 500
"""Logs for batches, for `solve` and for scipy, which fit one at a time."""
STOCK = (
    *((name, "float64") for name in ("Gauss-Newton", "Dogleg", poor.LM, "BFGS")),
    (poor.LM, "float32"),
    ("BFGS", "float32"),
)
"""Solvers of optimistix and their precision."""


def fit_points() -> list[Point]:
    """Return the cost of a fit by every method, and the share that misses."""
    logs = poor.draw(LOGS)
    # readings as an argument, not a constant: one program serves all logs
    function = jax.jit(lambda z, m: poor.residuals(z, (logs.blank, m)))
    slopes = jax.jit(jax.jacfwd(lambda z, m: poor.residuals(z, (logs.blank, m))))

    def by_scipy(count: int) -> np.ndarray:
        rows = zip(logs.readings[:count], logs.starts[:count], strict=True)
        return np.array(
            [
                least_squares(
                    lambda z, m=m: np.asarray(function(z, m)),
                    start,
                    jac=lambda z, m=m: np.asarray(slopes(z, m)),  # type: ignore
                    method="lm",
                    x_scale="jac",
                ).x
                for m, start in rows
            ]
        )

    def by_solve(count: int) -> np.ndarray:
        some = (replace(logs.log, value=read) for read in logs.readings[:count])
        found = (solve(log, logs.uncertain, noise="gaussian") for log in some)
        return np.array([one.answer.z for one in found])

    timed = {
        "fit_many": best_of(lambda: poor.ours(logs), 3),
        "fit_many, poor starts": best_of(lambda: poor.ours(logs, logs.starts), 3),
    }
    fits = {name: (took, np.asarray(fit.z)) for name, (took, fit) in timed.items()}
    for name, precision in STOCK:
        took, found = best_of(
            lambda name=name, precision=precision: poor.stock_fits(
                name, logs.blank, logs.readings, logs.starts, precision
            ),
            3,
        )
        words = name if name != poor.LM else "LM"
        fits[words + ", float32" * (precision == "float32")] = took, found.z
    fits["scipy, lm"] = best_of(lambda: by_scipy(LOOPED), 1, lambda: by_scipy(1))
    fits["solve"] = best_of(lambda: by_solve(SOLVED), 1, lambda: by_solve(1))

    # fmin ignores NaN: a method that diverged does not define the optimum
    least = poor.costs(logs, poor.best_known(logs))
    for _, z in fits.values():
        least[: len(z)] = np.fmin(least[: len(z)], poor.costs(logs, z))
    points = []
    for name, (took, z) in fits.items():
        count = len(z)
        wrong = ~(poor.costs(logs, z) - least[:count] <= poor.MISFIT_LIMIT)
        misses = int(wrong.sum())
        starts = "own starts" if name in ("fit_many", "solve") else "poor starts"
        over = f"{misses} of {count:,} missed, {starts}"
        points.append(Point("", name, took / count, max(misses, 0.5) / count, over))
    return points


# Samplers
STEPS, DRAWN_LAST = (200, 1000, 5000), (500, 2000, 8000, 30_000)
"""Steps of the walks, and last draws of the default method, which takes 2,000."""
REFERENCE_STEPS, RUNS, MAX_RUNS, WALKERS = 20_000, 3, 5, 256
"""Steps of the reference; runs of the longest and at most of others; walkers."""
SHARES = (0.05, 0.95)
"""Quantiles at the bounds of the 90 % interval."""


def one_density() -> Density:
    """Return the density of one simulated log of five microphones, exact laws."""
    uncertain = with_laws(
        UncertainScene(cases.scene_with(scatter=False)), cases.MICROPHONE_LAWS
    )
    log = readings(jax.random.key(11), uncertain.scene)
    return density_of(log, freed(uncertain, list(cases.TRUTH)))


def sampler_points() -> list[Point]:
    """Return the cost of every sampler, and the error of its worst interval bound.

    Errors are rms over the runs, and not below the uncertainty of the reference.
    """
    density = one_density()
    base, known = best_of(lambda: sample(density))
    free = known.values.shape[1]

    def walked(steps: int, seed: int) -> tuple[float, np.ndarray]:
        def along(steps: int) -> np.ndarray:
            states = walk(density, known, seed=seed, walkers=WALKERS)
            return np.array([x for *_, x in itertools.islice(states, steps)])

        took, chain = best_of(lambda: along(steps), 1, lambda: along(2))
        kept = chain[steps // 10 :]
        return took, unconstrained(density, kept.reshape(-1, free))

    def ends(draws: np.ndarray) -> np.ndarray:
        return np.quantile(draws, SHARES, axis=0)

    long_s, long = walked(REFERENCE_STEPS, 100)
    true, sd = ends(long), long.std(axis=0)
    # two halves differ by twice the error of the whole, if they are independent
    half = ends(long[: len(long) // 2]) - ends(long[len(long) // 2 :])
    least = 0.5 * float(np.max(np.abs(half) / sd))
    over = f"{free} parameters, 90 % intervals"
    points = []

    def add(method: str, took: float, found: list[np.ndarray], words: str) -> None:
        worst = [np.max(np.abs(one - true) / sd) for one in found]
        error = max(least, float(np.sqrt(np.mean(np.square(worst)))))
        points.append(Point("", method, took, error, over + words))

    for steps in STEPS:
        runs = min(RUNS * max(STEPS) // steps, MAX_RUNS)
        walks = [walked(steps, seed) for seed in range(runs)]
        words = f", {WALKERS} walkers, {runs} runs"
        took = base + min(took for took, _ in walks)
        add(f"emcee, {steps:,} steps", took, [ends(x) for _, x in walks], words)
    for count in DRAWN_LAST:
        effort = ORDINARY._replace(final=count)
        drawn = [
            best_of(lambda e=effort, s=seed: sample(density, s, e), 1)
            for seed in range(MAX_RUNS)
        ]
        bounds = [
            np.array(
                [
                    quantiles(x, one.weights, SHARES)
                    for x in unconstrained(density, one.values).T
                ]
            ).T
            for _, one in drawn
        ]
        took = min(took for took, _ in drawn)
        add(f"weighted, {count:,} draws", took, bounds, f", {MAX_RUNS} runs")
    name, words = f"emcee, {REFERENCE_STEPS:,} steps", f"{over}, {WALKERS} walkers"
    points.append(Point("", name, base + long_s, least, words, reference=True))
    return points


# Monte Carlo
DRAWN = (1 << 10, 1 << 14, 1 << 18)
"""Samples of an estimate: powers of two, where a Sobol' sequence is balanced."""
REPETITIONS, THRESHOLD_PA = 16, 12e3
MASS_KG, RANGE_M, SCATTER = (15.0, 1.5), (40.0, 1.05), 0.1
"""Medians with their standard deviations as factors; that of ln pressure."""


@jax.jit
def pressures(scores):
    """Return the peak pressures of standard normal scores, shape (sample, 3) [Pa]."""
    mass, distance = (
        middle * factor**u
        for (middle, factor), u in zip((MASS_KG, RANGE_M), scores.T[:2], strict=True)
    )
    return kingery_bulmash_pressure(distance, mass) * jnp.exp(SCATTER * scores[:, 2])


def exact_answers() -> tuple[float, float]:
    """Return mean pressure [Pa] and P(pressure > threshold), by quadrature in ln Z."""
    middle = math.log(RANGE_M[0]) - math.log(MASS_KG[0]) / 3.0
    spread = math.hypot(math.log(RANGE_M[1]), math.log(MASS_KG[1]) / 3.0)
    nodes, weights = np.polynomial.hermite_e.hermegauss(120)
    weights /= weights.sum()
    value = np.asarray(
        kingery_bulmash_pressure(np.exp(middle + spread * nodes), np.ones(nodes.size))
    )
    above = ndtr(np.log(value / THRESHOLD_PA) / SCATTER)
    return float(value @ weights) * math.exp(0.5 * SCATTER**2), float(above @ weights)


def montecarlo_points() -> list[Point]:
    """Return cost and rms error of estimates of a mean and of a probability."""

    def plain(count: int, seed: int) -> np.ndarray:
        return np.random.default_rng(seed).standard_normal((count, 3))

    def sobol(count: int, seed: int) -> np.ndarray:
        points = qmc.Sobol(3, scramble=True, bits=52, rng=seed)
        return ndtri(np.clip(points.random(count), 2.0**-53, 1.0 - 2.0**-53))

    mean, above = exact_answers()
    points = []
    for (panel, true, of), (name, scores), count in itertools.product(
        (
            ("mean pressure", mean, np.mean),
            (f"probability of {above:.2g}", above, lambda p: np.mean(p > THRESHOLD_PA)),
        ),
        (("plain", plain), ("Sobol", sobol)),
        DRAWN,
    ):

        def estimate(seed: int, of=of, scores=scores, count=count) -> float:
            return float(of(np.asarray(pressures(jnp.asarray(scores(count, seed))))))

        took, _ = best_of(lambda estimate=estimate: estimate(0), 3)
        off = [estimate(seed) / true - 1.0 for seed in range(REPETITIONS)]
        over = f"{count:,} samples, {REPETITIONS} repetitions"
        error = float(np.sqrt(np.mean(np.square(off))))
        points.append(Point(panel, f"{name} {count // 1024}k", took, error, over))
    return points


# Camera events
FPS = (100, 300, 1000, 3000, 10000)
"""Frame rates, from slow motion of a telephone to a laboratory camera."""
BOTH = (cases.THRESHOLD, cases.THRESHOLD)
"""Positive and negative contrast threshold [-]."""
RECORDING_S, SAME_S = 1.0, 0.2e-3
"""Recording of the real camera; largest difference of equal events [s]."""
USUAL = NoiseModel()
IDEAL = NoiseModel(
    mismatch=None,
    bandwidth_hz=None,
    leak_hz=None,
    hot_fraction=None,
    shot_hz=None,
    refractory_s=None,
)
EFFECTS = {
    "none of them": IDEAL,
    "mismatch": IDEAL._replace(mismatch=USUAL.mismatch),
    "bandwidth": IDEAL._replace(bandwidth_hz=USUAL.bandwidth_hz),
    "leak and hot pixels": IDEAL._replace(
        leak_hz=USUAL.leak_hz, hot_fraction=USUAL.hot_fraction, hot_hz=USUAL.hot_hz
    ),
    "shot noise": IDEAL._replace(shot_hz=USUAL.shot_hz),
    "refractory time": IDEAL._replace(refractory_s=USUAL.refractory_s),
    "mismatch and bandwidth": IDEAL._replace(
        mismatch=USUAL.mismatch, bandwidth_hz=USUAL.bandwidth_hz
    ),
    "all": USUAL,
}
"""Cameras between an ideal one and a usual one."""


class Sent(NamedTuple):
    """Pixel, time [s] and sign of events, in any order."""

    pixel: np.ndarray
    time: np.ndarray
    sign: np.ndarray


def sent(parts) -> Sent:
    """Return the events of all parts."""
    rows = [
        np.array([np.asarray(e.y) * cases.WIDTH + e.x, e.time, e.polarity])[
            :, : int(e.count)
        ]
        for e in parts
    ]
    pixel, time, sign = np.concatenate(rows, axis=1)
    return Sent(pixel.astype(int), time, sign)


def _blocks(times: np.ndarray, frames: np.ndarray):
    for a in range(0, len(times), 32):
        yield times[a : a + 32], frames[a : a + 32]


def grey(logs: np.ndarray) -> np.ndarray:
    """Return grey values of 8 bits."""
    return np.round(255.0 * np.exp(logs)).astype(np.uint8)


def of_frames(fps: int) -> Sent:
    """Return events of float frames, with ln(light) linear between frames."""
    times, logs = cases.film(fps)
    return sent(event_stream(_blocks(times, np.exp(logs)), Pixel(*BOTH)))


def of_bytes(fps: int, stamped: bool = False) -> Sent:
    """Return events of frames of 8 bits; stamped with the time of the next frame."""
    times, logs = cases.film(fps)
    found = sent(event_stream(_blocks(times, grey(logs)), Pixel(*BOTH)))
    # the margin keeps an event exactly at a frame in that frame
    late = np.ceil(found.time * fps - 1e-6) / fps
    return found._replace(time=late) if stamped else found


def event_points() -> list[Point]:
    """Return the cost of each method, and the mean error of its times."""
    whole, (known, _, when) = cases.passed_wholly(), cases.analytic()
    points = []
    for name, method in (
        *((f"frames, {fps:,}/s", functools.partial(of_frames, fps)) for fps in FPS),
        ("8 bits, 1,000/s", lambda: of_bytes(1000)),
        ("8 bits at frame's end, 1,000/s", lambda: of_bytes(1000, stamped=True)),
    ):
        took, found = best_of(method, 5)
        order = np.lexsort((found.time, found.pixel))
        pixel, time = found.pixel[order], found.time[order]
        events, truth = (np.bincount(p, minlength=whole.size) for p in (pixel, known))
        right = whole & (events == truth)
        off = 1e6 * np.abs(time[right[pixel]] - when[right[known]])
        wrong = int((whole & ~right).sum())
        over = f"{off.max():.2g} us at most; count wrong in {wrong} of {whole.sum():,}"
        cost, error = took / whole.size, float(off.mean())
        points.append(Point("", name, cost, error, f"{over} pixels"))
    return points


def effect_points() -> list[Point]:
    """Return the cost of each effect, and the share of wrong events without others."""
    times = np.arange(round(RECORDING_S * 1000) + 1) / 1000
    frames, key = grey(cases.disc_frames(times)), jax.random.key(0)

    def noisy(effects: NoiseModel) -> Sent:
        pixel = noisy_pixel(key, BOTH, effects, cases.SHAPE)
        return sent(event_stream(_blocks(times, frames), pixel))

    def alone(ours: Sent, theirs: Sent) -> int:
        # one axis: the offset between pixels and signs exceeds any time difference
        a, b = (
            np.sort((2 * e.pixel + (e.sign > 0)) * (2.0 * RECORDING_S) + e.time)
            for e in (ours, theirs)
        )
        after = np.searchsorted(b, a)
        near = [np.abs(a - b[np.clip(after - k, 0, b.size - 1)]) for k in (0, 1)]
        return int((np.minimum(*near) > SAME_S).sum())

    known, points = noisy(USUAL), []
    for name, effects in EFFECTS.items():
        took, found = best_of(functools.partial(noisy, effects), 5)
        missing, extra = alone(known, found), alone(found, known)
        both = known.time.size + found.time.size
        over = f"{missing:,} missing, {extra:,} extra, of {both:,} of both"
        cost, share = took / frames.size, max(missing + extra, 0.5) / both
        points.append(Point("", name, cost, share, over, reference=name == "all"))
    return points


# Flights
VEHICLES, FLIGHT_S, PERIOD_S = 64, 2.5, 10e-3
"""Vehicles in a batch; duration, and period of controller and compared rows [s]."""
FLIGHT_STEPS = {
    "swinging wind": (1e-4, 5e-4, 2e-3, 5e-3, 1e-2),
    "blast, held in place": (5e-4, 2e-3, 1e-2),
}
"""Steps of each case [s]; each divides the period."""
REFERENCE_STEP_S = 5e-5


def flight_points() -> list[Point]:
    """Return the cost of a second of flight at each step, and the largest error."""
    rng, count = np.random.default_rng(0), VEHICLES
    home, still = np.tile((0.0, 0.0, 5.0), (count, 1)), np.zeros((count, 3))
    level, hover = np.tile([0.0, 0, 0, 1], (count, 1)), np.full((count, 4), 1788.5)
    turning = rng.uniform(-2.0, 2.0, (count, 3))
    moving = State(home, rng.uniform(-2.0, 2.0, (count, 3)), level, turning, hover)
    offset = rng.uniform([-2.0, -2.0, -1.0], [2.0, 2.0, 1.0], (count, 3))
    charge = Charge(
        mass_kg=1.0, position_m=(8.0, 0.0, 1.0), time_s=0.1, burst="surface"
    )

    def wind(time_s, position_m):
        fast = jnp.sin(2 * jnp.pi * time_s + 0.1 * position_m[2])
        slow = jnp.cos(1.2 * jnp.pi * time_s)
        return jnp.stack([5 * fast, 4 * slow, fast * slow])

    held = {
        "control": PositionHold((0.0, 0.0, 5.0), named_gains("crazyflie")),
        "loads": (blast_load(Scene(charge)),),
        "control_period_s": PERIOD_S,
    }
    starts: tuple[tuple[State, dict[str, Any]], ...] = (
        (moving, {"wind": wind}),
        (State(home + offset, still, level, still, hover), held),
    )
    points = []
    for (case, steps), (start, options) in zip(
        FLIGHT_STEPS.items(), starts, strict=True
    ):

        def fly(step: float, dtype: str, start=start, options=options) -> np.ndarray:
            flown = simulate(
                named("crazyflie"),
                jax.tree.map(lambda x: x.astype(dtype), start),
                duration_s=FLIGHT_S,
                step_s=step,
                store_every=round(PERIOD_S / step),
                **options,
            )
            return np.asarray(flown.position_m, float)

        truth = fly(REFERENCE_STEP_S, "float64")
        for dtype in ("float64", "float32"):
            for step in steps:
                took, found = best_of(lambda s=step, d=dtype, f=fly: f(s, d), 1)
                off = float(np.linalg.norm(found - truth, axis=-1).max())
                cost, name = took / (count * FLIGHT_S), f"RK4 {1e3 * step:g} ms"
                over, panel = f"{dtype}, {case}", f"{case}, {dtype}"
                points.append(Point(panel, name, cost, 1e3 * off, over))
    return points


# Detectors
LENGTHS_S, WHOLE_S, BLOCK_S = (0.005, 0.01, 0.02, 0.05, 0.1, 0.2), 0.2, 0.01
"""Lengths of the templates, the beginning of the blast; of the blast; of a block."""
WINDOW, WINDOWS, SNR_DB = 2**16, 100, 17.0
"""Samples of a window; windows with and without a blast; 2E/N0 of the blasts [dB]."""


def detector_points() -> list[Point]:
    """Return delay and loss of each template; cost and misses of each method."""
    rate, whole, noise = cases.RATE, cases.pulse(WHOLE_S), cases.rumble(lines=True)

    def beginning(length_s: float) -> np.ndarray:
        count = round(length_s * rate)
        fade = np.clip(np.arange(count, 0, -1) / (0.3 * count), 0, 1)
        return whole[:count] * np.sin(0.5 * np.pi * fade) ** 2

    alone, points = np.zeros(2**15), []
    alone[2**14 :][: whole.size] = whole
    white = white_noise(1.0, rate)
    for panel, spectrum in (
        ("waiting, wind and a rotor", noise),
        ("waiting, white noise", white),
    ):
        possible = matched_kernel(whole, rate, spectrum).response
        for length in LENGTHS_S:
            kernel = matched_kernel(beginning(length), rate, spectrum)
            response = filtered(alone, kernel)[2**14]
            lost = max(1 - (response / possible) ** 2, 1e-3)
            needed = 20 * np.log10(threshold_for(kernel))
            over = f"threshold {needed:.1f} dB for one false alarm an hour"
            delay, name = (
                2 * kernel.reach / rate + BLOCK_S,
                f"template {1e3 * length:g} ms",
            )
            points.append(Point(panel, name, delay, lost, over))

    def matched(shape, spectrum) -> Callable[[np.ndarray], float]:
        kernel = matched_kernel(shape, rate, spectrum)

        def loudest(window: np.ndarray) -> float:
            inside = filtered(window, kernel)[kernel.before : -kernel.reach]
            return float(inside.max())

        return loudest

    bank = [
        matched(cases.pulse(WHOLE_S * k), noise) for k in (0.25, 0.5, 0.8, 1.25, 2.0)
    ]
    rng = np.random.default_rng(0)
    windows = [cases.coloured(rng, noise, WINDOW)[0] for _ in range(2 * WINDOWS)]
    blast = 10 ** (SNR_DB / 20) / matched_kernel(whole, rate, noise).response * whole
    loud = [window.copy() for window in windows[WINDOWS:]]
    # the blast lies well within the window, so that the ends do not matter
    for window, at in zip(loud, rng.integers(26_000, 50_000, WINDOWS), strict=True):
        window[at:][: blast.size] += blast
    for name, loudest in {
        "matched, whitened": matched(whole, noise),
        "matched, whitened, first 20 ms": matched(beginning(0.02), noise),
        "matched, as if white": matched(whole, white),
        "plain normalised": lambda x: float(cases.plain_normalised(x, whole).max()),
        "bank of five other lengths": lambda x: max(one(x) for one in bank),
    }.items():
        height = np.quantile([loudest(window) for window in windows[:WINDOWS]], 0.99)
        missed = sum(loudest(window) <= height for window in loud)
        took, _ = best_of(functools.partial(loudest, windows[0]), 40)
        cost, share = took / (WINDOW / rate), max(missed, 0.5) / WINDOWS
        points.append(
            Point("misses", name, cost, share, f"{missed} of {WINDOWS} missed")
        )
    return points


# Pressure records
RECORD_LOGS, SNR, EYE_ERROR = 60, 20.0, 0.05
"""Logs for each case; peak over noise; assumed error of a duration by eye."""


def mass_of(log: Observations, uncertain: UncertainScene) -> np.ndarray:
    """Return low end, median and high end of the 90 % interval, and sd of ln mass."""
    draws = solve(log, uncertain).draws
    ln_mass = np.log(draws.values[:, 0])
    away = ln_mass - draws.weights @ ln_mass
    sd = np.sqrt(draws.weights @ away**2)
    return np.array([*quantiles(ln_mass, draws.weights), sd])


def by_eye(records) -> Observations:
    """Return the rows of readings by eye, with assumed errors (`EYE_ERROR`)."""
    log = cases.log_of_picks(pick_records(records))
    value, sigma = log.value.copy(), log.sigma.copy()
    for k, record in enumerate(records):
        eye = eye_pick(record.time_s, record.samples)
        noise = record.samples[: record.samples.size // 10].std()
        rows = slice(len(RECORD_QUANTITIES) * k, len(RECORD_QUANTITIES) * (k + 1))
        value[rows] = eye
        sigma[rows] = [
            1 / record.rate_hz / math.sqrt(12),
            noise,
            EYE_ERROR * eye.positive_duration_s,
            EYE_ERROR * eye.positive_impulse_pa_s,
        ]
    return replace(log, value=value, sigma=sigma, covariances=())


def record_points() -> list[Point]:
    """Return cost and errors of each method, with exact laws and with scatter."""
    points, truth = [], math.log(cases.MASS)
    for words, scatter in (("laws exact", False), ("laws scatter", True)):
        uncertain = cases.uncertain_scene(scatter=scatter)

        def picked(records) -> Observations:
            return cases.log_of_picks(pick_records(records))

        methods: dict[str, Callable[[Any], np.ndarray]] = {
            "by eye": lambda r, u=uncertain: mass_of(by_eye(r), u),
            "picks": lambda r, u=uncertain: mass_of(
                replace(picked(r), covariances=()), u
            ),
            "picks, covariance": lambda r, u=uncertain: mass_of(picked(r), u),
        }
        # another layout is another program: logs with a poor pick are left out
        rng, drawn, count = np.random.default_rng(20), [], 0
        while len(drawn) < RECORD_LOGS:
            count += 1
            truths = cases.readings(rng, scatter=scatter)
            records = cases.recorded(rng, truths, cases.Recorder(snr=SNR))
            if all(one.quality != "poor" for one in pick_records(records)):
                drawn.append(records)
        for name, method in methods.items():
            method(drawn[0])  # compiles, so that the timed calls do not
            start = perf_counter()
            low, middle, high, sds = np.transpose([method(one) for one in drawn])
            took = (perf_counter() - start) / RECORD_LOGS
            off, sd = middle - truth, np.median(sds)
            covered = int(((low <= truth) & (truth <= high)).sum())
            over = (
                f"bias {off.mean():+.2%}, reported sd {sd:.2%}, 90 % intervals contain "
                f"{covered} of {RECORD_LOGS}"
            )
            if count > RECORD_LOGS:
                over += f", the logs without a poor pick of {count} drawn"
            rms = float(np.sqrt(np.mean(off**2)))
            missed = max(abs(covered / RECORD_LOGS - 0.9), 0.5 / RECORD_LOGS)
            points.append(Point(f"mass, {words}", name, took, rms, over))
            points.append(Point(f"interval, {words}", name, took, missed, over))
    return points


TOPICS = {
    name: Topic(
        f"{QUANTITIES[quantity].words.capitalize()}: cost against error",
        "time of a reading, many at once",
        "the largest over the span, or the uncertainty of the reference",
        functools.partial(law_points, quantity),
    )
    for name, quantity in (
        ("arrival", "air_arrival_s"),
        ("pressure", "peak_overpressure_pa"),
        ("impulse", "positive_impulse_pa_s"),
        ("duration", "positive_duration_s"),
    )
} | {
    "waveform": Topic(
        "Pressure history: cost against error",
        f"time of a waveform of {SAMPLES} samples, many at once; of the solver, of a "
        "run with all gauges",
        "rms over the phases, in peaks, or the uncertainty of the reference",
        waveform_points,
    ),
    "fit": Topic(
        "Finding the optimum of a log: cost against misses",
        f"time of a fit, {LOGS:,} at once; scipy and solve one by one",
        "share that misses the optimum; half a log if none does",
        fit_points,
    ),
    "sampler": Topic(
        "Sampling a posterior: cost against error",
        "time of a run from the log; walkers start from the default draws",
        "worst bound of a 90 % interval [posterior sd], or that of the reference",
        sampler_points,
        relative=False,
    ),
    "montecarlo": Topic(
        "Monte Carlo: cost against standard error, by number of samples",
        "time of an estimate",
        "rms over repetitions, relative to the exact value",
        montecarlo_points,
    ),
    "events": Topic(
        "Times of events: cost against error",
        f"time of a pixel over {1e3 * cases.DURATION:g} ms, with that of the light",
        "mean error of a time [us]; a disc whose edge moves at 260 px/s",
        event_points,
        relative=False,
    ),
    "event_effects": Topic(
        "Effects of a real event camera: cost against error without them",
        "time of a pixel in a frame, 8 bits at 1,000 frames/s",
        "share of events without a counterpart within 0.2 ms, relative to a camera "
        "with all effects; half an event if none",
        effect_points,
    ),
    "vehicle": Topic(
        "Flights: cost against error",
        f"time of a second of flight, one of {VEHICLES} Crazyflies at once",
        f"largest distance from the reference over {FLIGHT_S:g} s [mm]",
        flight_points,
        relative=False,
        orders={"RK4": 4},
    ),
    "detector": Topic(
        "Detectors: delay or computing time, against loss or misses",
        "waiting: from the first sample of a blast; misses: a second of sound",
        f"waiting: lost share of 2E/N0, to 0.001; misses: share at {SNR_DB:g} dB",
        detector_points,
        relative=False,
    ),
    "records": Topic(
        f"A mass from six pressure records, peak {SNR:g} times the noise",
        "time of a log: picks and fit",
        "rms of ln mass; coverage of 90 % intervals minus 90 %",
        record_points,
    ),
}


# Page and figures
def panels(points: Sequence[Point]) -> dict[str, list[Point]]:
    """Return the points of each panel, in order of appearance."""
    names = dict.fromkeys(point.panel for point in points)
    return {name: [p for p in points if p.panel == name] for name in names}


def pareto_front(panel: Sequence[Point]) -> set[Point]:
    """Return the points of a panel that no other point of it dominates."""
    found, least = set(), math.inf
    for (_, error), points in itertools.groupby(
        sorted((p for p in panel if p.whole), key=lambda p: p[2:4]), lambda p: p[2:4]
    ):
        if error < least:
            found.update(points)
            least = error
    return found


def page(kept: Mapping[str, Sequence[Point]], measured_on: str) -> str:
    """Return the page of all topics, the cheapest method of a panel first."""
    lines = [
        "# Cost against error",
        "",
        f"Drawn by `make chart` from `charts.csv`. {measured_on}. A star marks the "
        "Pareto front: no other method is better in both.",
    ]
    for name, points in kept.items():
        topic = TOPICS[name]
        lines += ["", f"## {topic.title}", ""]
        lines.append(f"`{name}`. Cost: {topic.cost}. Error: {topic.error}.")
        for panel, within in panels(points).items():
            lines += ["", f"### {capitalised(panel)}", ""] if panel else [""]
            front = pareto_front(within)
            columns = [
                Column("", lambda p, front=front: "*" * (p in front)),
                Column("method", lambda p: p.method),
                Column("cost [s]", lambda p: f"{p.cost_s:.2g}", right=True),
                Column(
                    "error",
                    lambda p: f"{p.error:.2g}" + " (the reference)" * p.reference,
                    right=True,
                ),
                Column("over", lambda p: p.over),
            ]
            rows = sorted(within, key=lambda point: point.cost_s)
            lines.append(markdown(Table(columns, rows)))
    return "\n".join(lines) + "\n"


def figure_of(topic: Topic, points: Sequence[Point]) -> Figure:
    """Draw every panel of a topic: cost to the right, error upwards, one scale.

    A filled point covers the whole panel, a blue one is on the Pareto front, and a
    diamond is the reference.
    """
    parts = panels(points)
    columns = min(2, len(parts))
    rows = math.ceil(len(parts) / columns)
    height = 2.7 * rows + 1.0 if len(parts) > 1 else 4.6
    figure = new_figure(5.4 * columns if columns > 1 else 7.0, height)
    figure.suptitle(topic.title, fontsize=13, color=INK, fontweight="bold")
    grid = figure.subplots(rows, columns, squeeze=False, sharex=True, sharey=True)
    for axes in grid.flat[len(parts) :]:
        axes.set_visible(False)
    axes = grid[0, 0]
    axes.set(xscale="log", yscale="log")
    for axis, set_limits, values, gap in (
        (axes.xaxis, axes.set_xlim, [p.cost_s for p in points], 2.5),
        (axes.yaxis, axes.set_ylim, [p.error for p in points], 2.2),
    ):
        low, high = min(values) / gap, max(values) * gap
        set_limits(low, high)
        subs = (1.0, 2.0, 5.0) if high / low < 300.0 else (1.0,)
        axis.set_major_locator(LogLocator(subs=subs))
        axis.set_minor_formatter(NullFormatter())
    axes.xaxis.set_major_formatter(EngFormatter(unit="s"))
    size, unit = (100, " %") if topic.relative else (1, "")
    axes.yaxis.set_major_formatter(FuncFormatter(lambda y, _: f"{size * y:g}{unit}"))
    for axes, (panel, within) in zip(grid.flat, parts.items(), strict=False):
        _draw(axes, panel, within, topic)
    figure.supxlabel(f"cost: {topic.cost}", fontsize=10, color=INK)
    error = textwrap.fill(f"error: {topic.error}", int(10 * height))
    figure.supylabel(error, fontsize=10, color=INK, ma="center")
    # names are placed by the pixels they cover, which exist after a draw only
    figure.canvas.draw()
    for axes, within in zip(grid.flat, parts.values(), strict=False):
        _name(axes, within)
    return figure


def _draw(axes, panel: str, points: Sequence[Point], topic: Topic) -> None:
    quiet(axes)
    titled(axes, capitalised(panel))
    front = pareto_front(points)
    for point in points:
        colour = _colour(point, front)
        look = {"markerfacecolor": colour if point.whole else "white", "zorder": 3}
        form = "D" if point.reference else "o"
        axes.plot(point.cost_s, point.error, form, color=colour, markersize=6, **look)
    if front:
        x, y = zip(*sorted((p.cost_s, p.error) for p in front), strict=True)
        axes.step(x, y, where="post", color=BLUE, linewidth=1.2, zorder=1)
    for word, order in topic.orders.items():
        # the theoretical decrease through the last point of the method
        last = [point for point in points if point.method.startswith(word)][-1]
        cost = np.array(axes.get_xlim())
        error = last.error * (cost / last.cost_s) ** -float(order)
        axes.plot(cost, error, color=MUTED, linewidth=0.9, linestyle="--", zorder=0)
        axes.set_title(f"dashed: order {order}", loc="right", fontsize=8, color=MUTED)


def _colour(point: Point, front: set[Point]) -> str:
    return VERMILLION if point.reference else BLUE if point in front else MUTED


PLACES = (
    (5, 4, "left", "bottom"),
    *((7 * side, dy, across, "center") for dy in (0, 10, -10, 18, -18)
      for side, across in ((1, "left"), (-1, "right"))),
    (0, 7, "center", "bottom"),
    (0, -7, "center", "top"),
)  # fmt: skip
"""Candidate positions of a name relative to its point: offset [point], alignment."""


def _name(axes, points: Sequence[Point]) -> None:
    """Write each name next to its point, at the position where it covers least."""
    front = pareto_front(points)
    at = [axes.transData.transform((p.cost_s, p.error)) for p in points]
    taken = [Bbox.from_bounds(x - 5, y - 5, 10, 10) for x, y in at]
    inside = axes.get_window_extent().frozen()

    def shared(one: Bbox, other: Bbox) -> float:
        both = Bbox.intersection(one, other)
        return 0.0 if both is None else both.width * both.height

    # from the right: names near the right edge have the fewest free positions
    for point in sorted(points, key=lambda p: -p.cost_s):
        colour = _colour(point, front)
        text = axes.annotate(
            point.method,
            (point.cost_s, point.error),
            xytext=(0, 0),
            textcoords="offset points",
            fontsize=8,
            color=INK if colour == MUTED else colour,
            path_effects=[withStroke(linewidth=2.5, foreground="white")],
        )

        def covered(place, text=text) -> float:
            dx, dy, across, along = place
            text.set(position=(dx, dy), ha=across, va=along)
            box = text.get_window_extent()
            outside = box.width * box.height - shared(box, inside)
            return outside + sum(shared(box, other) for other in taken)

        covered(min(PLACES, key=covered))
        taken.append(text.get_window_extent())


def read() -> tuple[dict[str, list[Point]], str]:
    """Return the kept points of each topic, and the machine that measured them."""
    kept: dict[str, list[Point]] = {}
    for row in table_rows(KEPT):
        topic, cost, error = row["topic"], float(row["cost_s"]), float(row["error"])
        flags = (row[name] == "true" for name in ("whole", "reference"))
        point = Point(row["panel"], row["method"], cost, error, row["over"], *flags)
        kept.setdefault(topic, []).append(point)
    return kept, KEPT.read_text().partition("\n")[0].removeprefix("# ")


def table(kept: Mapping[str, Sequence[Point]], measured_on: str) -> str:
    """Return the table of all points; four digits, as repeated timings differ more."""

    def cell(value: str | float) -> str:
        if isinstance(value, bool):
            return str(value).lower()
        return value if isinstance(value, str) else f"{value:.4g}"

    rows = [(name, *map(cell, p)) for name, points in kept.items() for p in points]
    return table_text([("topic", *Point._fields), *rows], [measured_on])


def main() -> None:
    """Draw the kept tables; with --measure, measure first."""
    parser = argparse.ArgumentParser(description="Cost against error of every method.")
    parser.add_argument("topic", nargs="*", metavar="TOPIC", help=", ".join(TOPICS))
    parser.add_argument("--measure", action="store_true", help="measure again")
    options = parser.parse_args()
    if unknown := [name for name in options.topic if name not in TOPICS]:
        parser.error(f"no topic {unknown[0]!r}: expected {', '.join(TOPICS)}")
    kept, measured_on = read()
    if options.measure:
        start_jax()
        progress = in_words()
        for name in options.topic or TOPICS:
            progress(name)
            kept[name] = TOPICS[name].measure()
        kept = {name: kept[name] for name in TOPICS if name in kept}
        measured_on = machine()
        write_text(KEPT, table(kept, measured_on))
    write_text(KEPT.with_suffix(".md"), page(kept, measured_on))
    for name in options.topic or SHOWN:
        folder = RESULTS / "charts" if name in SHOWN else Path("out/charts")
        folder.mkdir(parents=True, exist_ok=True)
        write_figure(figure_of(TOPICS[name], kept[name]), folder / f"{name}.png")
        print(f"Written: {folder / name}.png")


if __name__ == "__main__":
    main()
