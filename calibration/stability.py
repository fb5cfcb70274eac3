r"""Where does each method fail, and what does jblast do there?

    python -m calibration.stability [AREA ...]            # page and figure, as kept
    python -m calibration.stability [AREA ...] --measure  # measured again

Each method is used past its limit. There jblast marks the answer as extrapolated,
refuses with a message, or falls back to another method: every row states the limit,
the behaviour of the method alone, and the response, which is observed and not claimed.
Rows are kept in `results/stability.csv`; the page is `results/stability.md`. Their
words are in `stability.toml`, the numbers in them are measured here.

Laws fail beyond their tables and ranges, clocks where the resolution of numbers exceeds
the error of a recorder, cameras behind the lens and beyond the fold of its distortion,
flights at long steps and strong blasts, picks by noise, drift and echoes.
The logs, solvers and walks of the rows on fits and MCMC are those of `stability_fits`.
Near hover a vehicle's loop depends on times only as multiples of the step: a step
longer by $s$ is the same step with motors and gains faster by $s$. Therefore one
program flies all vehicles at all steps.
"""

import argparse
import csv
import dataclasses
import itertools
import math
import tomllib
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from scipy.optimize import root_scalar

from calibration import cases, stability_fits as poor
from jblast.cli.jax_start import start_jax
from jblast.constants import (
    STANDARD_PRESSURE,
    STANDARD_SOUND_SPEED,
    TNT_SPECIFIC_ENERGY,
)
from jblast.errors import InputError, whole_number
from jblast.files import table_text, write_text
from jblast.inference import fit_many, solve
from jblast.inference.fitting.goodness_of_fit import suspected_outliers
from jblast.inference.fitting.warnings import POINT_SOURCES, charge_is_no_point
from jblast.inference.identify import AMBIGUITY
from jblast.inference.posterior.parameters import NORMAL_Q95
from jblast.inference.sample import NEAR
from jblast.observations import observed, resolve_positions
from jblast.observations.clocks import refuse_unresolved
from jblast.progress import in_words
from jblast.registry import LAWS, Law, call
from jblast.report.colours import BLUE, GRID, INK, MUTED, VERMILLION
from jblast.report.figures import new_figure, quiet, runs, titled, write_figure
from jblast.report.numbers import capitalised, printed_number, quantity_words
from jblast.report.view import Column, Table, markdown
from jblast.scene import Camera, Charge, Scene
from jblast.scene.charge import BURSTS, Burst
from jblast.sensors.calculator import COMBINATIONS, calculated_laws
from jblast.sensors.camera.geometry import project, unproject
from jblast.signals import noise_spectrum
from jblast.signals.picks import pick_records
from jblast.vehicle import (
    PositionHold,
    State,
    Vehicle,
    blast_load,
    flight_metrics,
    named,
    named_gains,
    simulate,
    step_limit,
)
from jblast.vehicle.quadrotor import PARAMETERS
from jblast.vehicle.state import unit
from jblast.waves import (
    kingery_bulmash_arrival_time,
    kingery_bulmash_duration,
    kingery_bulmash_pressure,
    kinney_graham_duration,
    point_source_arrival_time,
    point_source_pressure,
    sedov_taylor_energy,
    sedov_taylor_shock_radius,
    shock_kinematics_pressure,
    wu_hao_air_arrival_time,
)
from jblast.waves.friedlander import impulse_fraction
from jblast.waves.laws.kingery_bulmash import kingery_bulmash_curves
from jblast.waves.laws.sedov_taylor import sedov_taylor_shock_pressure
from jblast.waves.laws.wu_hao import wu_hao_air_valid
from jblast.waves.pulse import friedlander_pressure, pulse_of

HERE = Path(__file__).parent
KEPT = HERE / "results" / "stability.csv"
WORDS = tomllib.loads((HERE / "stability.toml").read_text("utf-8"))
COLOURS = {"marks": VERMILLION, "refuses": INK, "falls back": "#E69F00"}
COLOURS["accepts"] = "#CC79A7"
"""Responses of jblast where a method fails."""
MASS = 15.0
"""Charge of the examples [kg]: that of the thesis."""


class Mode(NamedTuple):
    """One measured failure mode of one method.

    Attributes:
        area: A key of `AREAS`.
        method: The method, or the law and its quantity.
        failure: Short description of the failure.
        boundary: Begin of the failure, in the unit; a share of cases has "of N".
        unit: Unit of the boundary; "" for a pure number.
        beyond: Measured behaviour of the method alone past the boundary.
        response: Response of jblast past the boundary.
        message: The mark, the message, or the method that takes over.
    """

    area: str
    method: str
    failure: str
    boundary: float
    unit: str
    beyond: str
    response: str
    message: str

    @property
    def cases(self) -> int:
        """Number N of a unit "of N"; 0 for any other unit."""
        of, _, number = self.unit.partition(" ")
        return whole_number(number) or 0 if of == "of" else 0


def row(key: str, boundary: float, seen: Any, **numbers: Any) -> Mode:
    """Return a row of the table.

    Args:
        key: Its words in `stability.toml`.
        boundary: Begin of the failure.
        seen: True if the response that the words state was observed.
        numbers: Numbers in the words.

    Raises:
        RuntimeError: The response was not observed, so no table may state it.
    """
    if not seen:
        expected = WORDS[key]["response"]
        raise RuntimeError(f'{key}: expected the response "{expected}", got another')
    numbers["boundary"] = float(boundary)
    words = {name: text.format(**numbers) for name, text in WORDS[key].items()}
    return Mode(boundary=float(boundary), **words)


def crossing(
    function: Callable[[float], float], low: float, high: float, to: float = 1e-12
) -> float:
    """Return the zero of a function with different signs at two bounds."""
    return float(root_scalar(function, bracket=(low, high), rtol=to).root)


def switching_point(
    answer: Callable[[float], bool | np.bool_ | jax.Array], low: float, high: float
) -> float:
    """Return the point between two bounds at which a condition changes."""
    # +-0.5 gives the root finder the sign change that a truth value lacks
    return crossing(lambda x: 0.5 - bool(answer(x)), low, high)


def first_failure(failed: np.ndarray, what: str) -> int:
    """Return the first level at which a method fails, easiest first.

    Raises:
        RuntimeError: It fails at no level, so the levels contain no boundary.
    """
    if not failed.any():
        raise RuntimeError(
            f"{what}: expected a failure at one of {failed.size} levels, got none"
        )
    return int(np.argmax(failed))


def refusal(attempt: Callable[[], object]) -> str:
    """Return the message of a refusal; "" if there is none."""
    try:
        attempt()
    except (InputError, ValueError) as error:
        return str(error)
    return ""


# Laws
CURVES = {
    "peak_overpressure_pa": "incident_pressure",
    "positive_impulse_pa_s": "incident_impulse",
    "positive_duration_s": "positive_phase_duration",
    "air_arrival_s": "arrival_time",
}
"""Curve of the Kingery-Bulmash table by its quantity."""
INNER_Z, OUTER_Z, LAST_Z = 0.01, 100.0, 1e3
"""Scaled distances beyond the table, which covers 0.07 to 40 m/kg^(1/3)."""
AIR = 1.225, 1.4
"""Density of standard air [kg/m3] and ratio of specific heats [-]."""


def law_failures() -> Iterator[Mode]:
    """Measure every failure mode of a law."""

    def lead(distance: float) -> float:
        time = wu_hao_air_arrival_time(distance, 1.0, STANDARD_SOUND_SPEED)
        return float(distance / time) / STANDARD_SOUND_SPEED - 1.0

    mean = crossing(lead, 1.0, 100.0)
    marked = switching_point(lambda r: wu_hao_air_valid(r, 1.0), 1.0, 100.0)
    numbers = {"metres": mean * math.sqrt(MASS), "slow": -100 * lead(2 * mean)}
    seen = math.isclose(marked, mean, rel_tol=1e-6)
    yield row("wu_hao", mean, seen, mass=MASS, **numbers)
    for quantity in CURVES:
        yield from _table_limits(quantity)
    yield from _kinney_graham()
    yield from _point_sources()
    yield _at_the_charge()


def _table_limits(quantity: str) -> Iterator[Mode]:
    law = LAWS[quantity, "kingery_bulmash"]
    curve = kingery_bulmash_curves(CURVES[quantity])["surface"]

    def ratio_at(z: float) -> str:
        """Return the printed polynomials over the curve as jblast evaluates it."""
        log_z: Any = np.log(z)
        with np.errstate(over="ignore"):
            ratio = float(np.exp(curve.form(log_z) - curve.exact(log_z)))
        return f"{'overflows' if math.isinf(ratio) else f'{ratio:.3g}'} at Z = {z:g}"

    farther = ""
    if quantity == "peak_overpressure_pa":
        high = float(law.function(jnp.asarray([LAST_Z]), 1.0)[0])
        weak = float(shock_kinematics_pressure(LAST_Z, 1.0))
        farther = f": {high:.3g} Pa at Z = {LAST_Z:g}, where shock_kinematics has "
        farther += f"{weak:.3g}"
    for key, bounds, places, factor in (
        ("table_near", (INNER_Z, 1.0), (INNER_Z,), 0.5),
        ("table_far", (1.0, LAST_Z), (OUTER_Z, LAST_Z), 2.0),
    ):
        end = switching_point(lambda z: law.valid(z, 1.0), *bounds)
        # three points outside the table: two equal slopes in ln make a power law
        z = end * np.array([factor**0.0015, factor, factor**2])
        slopes = np.diff(np.log(np.asarray(law.function(z, 1.0)))) / np.diff(np.log(z))
        straight = math.isclose(slopes[0], slopes[1], rel_tol=1e-6)
        ratios = ", ".join(map(ratio_at, places))
        seen = straight and not np.any(law.valid(z, 1.0))
        yield row(key, end, seen, quantity=quantity, ratios=ratios, farther=farther)


def _kinney_graham() -> Iterator[Mode]:
    """Compare the duration with Kingery-Bulmash in free air; accepted is 30 %."""

    def ratio(z: float) -> float:
        reference = kingery_bulmash_duration(z, 1.0, burst="free-air")
        return float(kinney_graham_duration(z, 1.0) / reference)

    grid = np.geomspace(0.15, 40.0, 200)
    ratios = [ratio(z) for z in grid]
    best, worst = grid[np.argmax(ratios)], grid[np.argmin(ratios)]
    near, far = (
        crossing(lambda z: ratio(z) - 0.7, *b) for b in ((1.5, best), (best, 40))
    )
    law = LAWS["positive_duration_s", "kinney_graham"]
    places = 0.99 * near, best, 1.01 * far
    valid = [bool(law.valid(z, 1.0, burst="free-air")) for z in places]
    numbers = {
        name: 100 * ratio(z)
        for name, z in {"worst": worst, "two": 2.0, "best": best, "last": 40.0}.items()
    }
    numbers |= {"range": law.range, "worst_z": worst, "best_z": best}
    for key, z in (("kinney_graham_near", near), ("kinney_graham_far", far)):
        yield row(key, z, valid == [False, True, False], **numbers)


def _point_sources() -> Iterator[Mode]:
    """Measure laws of point sources for 1 kg; they scale."""

    def is_reported(law: str) -> bool:
        chemical = charge_is_no_point([law], Charge(mass_kg=1.0))
        nuclear = charge_is_no_point([law], Charge(mass_kg=1.0, explosive="nuclear"))
        return law in POINT_SOURCES and bool(chemical) and not nuclear

    def sedov_error(z: float) -> float:
        exact = float(point_source_pressure(z, 1.0)) + STANDARD_PRESSURE
        return 100 * (float(sedov_taylor_shock_pressure(z, 1.0, AIR[1])) / exact - 1)

    law = LAWS["shock_radius_m", "sedov_taylor"]

    def sedov_valid(z: float):
        energy = float(sedov_taylor_energy(z, 1.0, *AIR))
        time = math.sqrt(energy / TNT_SPECIFIC_ENERGY)
        return law.valid(time, 1.0, *AIR, STANDARD_PRESSURE)

    def share(z: float) -> float:
        time = kingery_bulmash_arrival_time(z, 1.0, burst="free-air")
        return 100 * float(sedov_taylor_energy(z, time, *AIR)) / TNT_SPECIFIC_ENERGY

    def energy_error(z: float) -> float:
        """Return the error of 4.184 MJ/kg as the energy with the peak of TNT [%]."""
        peak = float(kingery_bulmash_pressure(z, 1.0, burst="free-air"))
        mass = crossing(lambda m: float(point_source_pressure(z, m)) - peak, 1e-3, 1e3)
        return 100 * (1.0 / mass - 1.0)

    weak = crossing(lambda z: sedov_error(z) + 10, 0.4, 1.0)
    strength = float(point_source_pressure(weak, 1.0)) / STANDARD_PRESSURE
    end = switching_point(sedov_valid, 0.4, 1.0)
    time = float(point_source_arrival_time(end, 1.0))
    radius = 100 * (float(sedov_taylor_shock_radius(time, 1.0, *AIR)) / end - 1)
    numbers = {"strength": strength, "low": -sedov_error(1.0), "end": end}
    numbers |= {"pressure": sedov_error(end), "radius": radius}
    yield row("sedov_weak", weak, end < weak, **numbers)
    energies = {"near": share(0.2), "middle": share(0.4), "far": share(end)}
    yield row("sedov_tnt", end, is_reported("sedov_taylor"), **energies)
    # 4.184 MJ/kg is the right energy at one range only; farther out it is too little
    boundary = crossing(lambda z: energy_error(z) + 30, 2.5, 5.0)
    off = [energy_error(z) for z in np.geomspace(0.3, boundary, 40)]
    numbers = {"least": min(off), "most": max(off), "far": energy_error(10.0)}
    numbers["energy"] = TNT_SPECIFIC_ENERGY / 1e6
    yield row("point_source_tnt", boundary, is_reported("point_source"), **numbers)


def _at_the_charge() -> Mode:
    laws = [law for law in calculated_laws() if "slant_range" in law.arguments()]
    path = jax.tree.map(jnp.asarray, cases.standard_path(np.ones(1), "surface"))

    def values(distance):
        ranges = distance[None]
        at = dataclasses.replace(path, slant_range=ranges, ground_range=ranges)
        return jnp.stack([jnp.sum(call(law.function, at)) for law in laws])

    # jvp gives value and slope in one pass, for all laws in one program
    zero = jnp.zeros(())
    both = jax.jit(lambda x: jax.jvp(values, (x,), (jnp.ones(()),)))(zero)
    bad = int(np.sum(~np.isfinite(both).all(axis=0)))
    pressure = LAWS["peak_overpressure_pa", "kingery_bulmash"].function
    peak = ["a"], ["peak_overpressure_pa"], [1e4], [1e3]
    log = observed(*peak, position=np.zeros((1, 3)))
    attempts = lambda: pressure(0.0, 1.0), lambda: resolve_positions(log, Scene())
    seen = all(map(refusal, attempts))
    return row("at_the_charge", 0.0, seen, bad=bad, laws=len(laws))


# Wave forms and clocks
def wave_form_failures() -> Iterator[Mode]:
    """Measure the failure modes of Friedlander's pulse."""
    late = float(friedlander_pressure(10.0, 1.0, 1.0, -0.5))
    # half of this fills a triangle: more needs a negative decay
    pulse = pulse_of(0.0, 1.0, 0.6, 1.0, 0.0, 0.3, 0.6)
    ended = float(pulse.decay) < 0.0 and float(pulse.pressure(50.0)) == 0.0
    yield row("tail", 0.0, ended, late=late)
    # the pressure is largest at t/t_d = 1 + 1/b, which is behind the front for b < -1
    largest = float(friedlander_pressure(0.5, 1.0, 1.0, -2.0))
    holds = COMBINATIONS["friedlander_decay"].holds
    marked = not holds(-1.0 - 1e-9) and bool(holds(-1.0 + 1e-9))
    fraction = float(impulse_fraction(jnp.array(-1.0)))
    yield row("rising", -1.0, marked, fraction=fraction, largest=largest)


TIMES = {"60 s": 60.0, "1 h": 3600.0, "Unix time": 1.7e9}
"""Clocks that count from a start-up, from an hour ago and from 1970 [s]."""
SIGMAS = {np.float32: 1e-3, np.float64: 1e-6}
"""Standard errors of the arrivals of a plain and of the best recorder [s]."""


def arrival_at(time: float, sigma: float):
    """Return a log of one arrival with its standard error [s]."""
    row = ["a"], ["air_arrival_s"], [time], [sigma]
    return observed(*row, position=np.array([[30.0, 0.0, 0.0]]), source="one arrival")


def clock_failures() -> Iterator[Mode]:
    """Measure the failure modes of clocks in single and in double precision."""
    for dtype, sigma in SIGMAS.items():
        # the spacing doubles at powers of two, so no other times need a test
        powers = 2.0 ** np.arange(60)
        coarse = np.spacing(powers.astype(dtype)).astype(float) > sigma
        boundary = float(powers[first_failure(coarse, "clock")])
        steps = ", ".join(
            f"{float(np.spacing(dtype(time))):.3g} s at {words}"
            for words, time in TIMES.items()
        )
        start, travel = TIMES["Unix time"], 0.1234567
        before, after = (
            refusal(
                lambda t=t, s=sigma, d=dtype: refuse_unresolved(arrival_at(t, s), d)
            )
            for t in (math.nextafter(boundary, 0.0) / 1.01, boundary)
        )
        numbers = {"dtype": np.dtype(dtype).name, "sigma": sigma, "steps": steps}
        numbers |= {"travel": travel, "read": float(dtype(start + travel)) - start}
        yield row("clock", boundary, bool(after) and not before, **numbers)


# Fits
OUTLIER_SD = 20
"""Outlier size in the table [sd]: 2 ms, a clear straggler but no gross error."""
SIZES = np.arange(0.0, 2 * OUTLIER_SD + 1)
"""Outlier sizes [sd]: up to twice the size in the table, to see the error grow."""
MIRRORED = (30.0, 10.0, 20.0)
"""Mass [kg], east and north [m] of the charge next to a line of sensors: its mirror
image, 40 m away, is a separate optimum, not a ridge."""
WU_HAO_NULL = (1.0, -0.2, -0.02)
"""Exponents of the mass in 0.91 R^1.03 Q^-0.02 / c_s and 0.34 R^1.4 Q^-0.2 / c_a."""
SOLVE_LOGS = 5
"""Logs for `solve`, which fits one at a time and is far slower than `fit_many`."""


def fit_failures() -> Iterator[Mode]:
    """Measure every failure mode of a fit."""
    yield from _poor_starts()
    yield from (_collinear(), _one_place(), _outlier(), _null_direction())


def _poor_starts() -> Iterator[Mode]:
    logs = poor.draw()
    best = poor.costs(logs, poor.best_known(logs))

    def missed(z) -> np.ndarray:
        # negated: a cost of NaN is a miss
        return ~(poor.costs(logs, z) - best[: len(z)] <= poor.MISFIT_LIMIT)

    own, started = poor.ours(logs), poor.ours(logs, logs.starts)
    alone = [
        solve(
            dataclasses.replace(logs.log, value=read), logs.uncertain, noise="gaussian"
        ).answer.z
        for read in logs.readings[:SOLVE_LOGS]
    ]
    own_missed, poor_missed = missed(own.z), missed(started.z)
    unmarked = int((poor_missed & ~np.asarray(started.doubtful)).sum())
    counts = {"own": own_missed.sum(), "alone": missed(np.array(alone)).sum()}
    counts |= {"solved": SOLVE_LOGS, "poor": poor_missed.sum(), "unmarked": unmarked}
    distance = np.linalg.norm((logs.starts - logs.truth)[:, 1:], axis=1)
    for precision, solver in itertools.product(
        poor.TOLERANCE, ("Gauss-Newton", "BFGS", poor.LM)
    ):
        fits = poor.stock_fits(
            solver, logs.blank, logs.readings, logs.starts, precision
        )
        wrong = missed(fits.z)
        numbers = {"silent": (wrong & fits.successful).sum(), "fits": poor.FITS}
        numbers |= {"metres": distance[wrong].min(), "solver": solver, **counts}
        seen = not (own_missed.any() or unmarked)
        yield row("poor_start", wrong.sum(), seen, precision=precision, **numbers)


def _collinear() -> Mode:
    def excess(bent: float) -> float:
        """Return the excess of -2 ln density at the mirror image of the charge."""
        found = poor.solved_log(poor.line(bent), *MIRRORED).solution
        modes = found.draws.modes
        north = np.array([found.density.best(u)[2] for u in modes.u])
        other = modes.log_density[np.sign(north) != np.sign(north[0])]
        # a mode farther below the best is not kept
        fall = modes.log_density[0] - other.max(initial=-np.inf)
        return 2 * min(float(fall), NEAR)

    # at the limit of jblast's own search for ambiguities; 1 % is enough for the table
    boundary = crossing(lambda bent: excess(bent) - AMBIGUITY, 0.0, 5.0, to=0.01)
    at, resolved = (
        poor.solved_log(poor.line(bent), *MIRRORED).solution
        for bent in (0.0, 2 * boundary)
    )
    fits = poor.stock_solutions(at, poor.poor_starts())
    south = int(np.sum(fits[:, 2] < 0))
    numbers = {"fits": len(fits), "south": south, "north": len(fits) - south}
    named = len(at.identified.other_modes) == 1 and resolved.identified.is_identifiable
    metres = abs(float(at.answer.z[2]))
    return row("collinear", boundary, named, metres=metres, **numbers)


def _one_place() -> Mode:
    def at_positions(count: int):
        places = tuple(poor.ring()[i % count] for i in range(poor.SENSORS))
        return poor.solved_log(places, *poor.KNOWN).solution

    needed = next(
        count
        for count in range(1, poor.SENSORS + 1)
        if at_positions(count).identified.is_identifiable
    )
    one = at_positions(1)
    fits = poor.stock_solutions(one, poor.poor_starts())
    mass, null = np.exp(fits[:, 0]), one.identified.null
    valued = any(x.identified for x in one.identified.estimates.values())
    apart = np.linalg.norm(fits[:, None, 1:] - fits[None, :, 1:], axis=-1).max()
    numbers = {"fits": len(fits), "of": poor.FITS, "null": len(null), "apart": apart}
    numbers |= {"least": mass.min(), "most": mass.max()}
    return row("one_place", needed, len(null) == 2 and not valued, **numbers)


def _outlier() -> Mode:
    clean = poor.solved_log(poor.ring(), *poor.KNOWN, "student")
    posterior, z = poor.rows_of(clean.solution), clean.solution.answer.z
    # the nearest sensor, whose reading constrains the fit most
    outlier = poor.SIGMA * (np.arange(poor.SENSORS) == 0)
    fine = np.linspace(0.0, 2 * OUTLIER_SD, poor.FITS)
    normal = fit_many(
        clean.uncertain,
        posterior.layout,
        clean.log.value + fine[:, None] * outlier,
        np.asarray(posterior.sigma),
        poor.LAWS,
        noise="gaussian",
        starts=np.tile(z, (poor.FITS, 1)),
    )
    mass, sd = np.asarray(normal.z)[:, 0], float(normal.sd()[0, 0])
    moved = np.abs(mass - mass[0]) / sd
    boundary = np.interp(NORMAL_Q95, moved, fine)
    student, suspected = np.empty(SIZES.size), np.empty(SIZES.size, bool)
    for i, size in enumerate(SIZES):
        log = dataclasses.replace(clean.log, value=clean.log.value + size * outlier)
        answer = solve(log, clean.uncertain).answer
        student[i] = answer.z[0]
        suspects = suspected_outliers(log, answer.residual, answer.density.noise)
        suspected[i] = any(o.sensor == log.sensor[0] for o in suspects)
    shift = np.abs(student - student[0]) / sd
    # the size from which every larger one is suspected
    first = SIZES[min(np.flatnonzero(~suspected)[-1] + 1, SIZES.size - 1)]
    worst = int(np.argmax(shift))
    numbers = {"size": OUTLIER_SD, "moved": np.interp(OUTLIER_SD, fine, moved)}
    numbers |= {"student": shift[SIZES == OUTLIER_SD][0], "worst": shift[worst]}
    numbers |= {"worst_size": SIZES[worst], "suspected": first}
    seen = first <= OUTLIER_SD and moved[-1] > NORMAL_Q95
    return row("outlier", boundary, seen, **numbers)


def _null_direction() -> Mode:
    found = poor.wu_hao_solution()
    rng = np.random.default_rng(0)
    # starts from 0.1 to 1,000 kg, and speeds of air and rock far beyond plausible ones
    low, high = np.log([[0.1, 200.0, 3000.0], [1000.0, 600.0, 8000.0]])
    fits = poor.stock_solutions(found, rng.uniform(low, high, (poor.FITS, 3)))
    values = np.exp(fits[np.argsort(fits[:, 0])])
    least, most = values[0], values[-1]
    (null,) = found.identified.null
    along = ", ".join(f"{weight:.3g}" for weight in null)
    named = np.allclose(null, WU_HAO_NULL, atol=1e-6)
    numbers = {"fits": len(fits), "of": poor.FITS, "null": along}
    factor = most[0] / least[0]
    return row("null_direction", factor, named, least=least, most=most, **numbers)


# Walks
SEPARATED_SD, MINOR_SHARE = 12.0, 1 / 3
"""Separation of two normals [sd], which hardly any walker crosses; the second's weight,
unequal so that walkers that stay where they started have a visibly wrong share."""
TWO_MODE_STEPS, MIRROR_STEPS, SHORT_CHAIN, LONG_CHAIN = 1000, 2500, 500, 4000
"""Steps of the walks. The first satisfies emcee's condition of 50 autocorrelation
times, the second every check of convergence."""


def walk_failures() -> Iterator[Mode]:
    """Measure every failure mode of MCMC."""
    yield from (_shares_of_walks(), _mirror(), _null_walk(), _endless())


def two_normals(w):
    """Return ln of the density of unit normals apart, the second of half the weight."""
    other = jnp.log(0.5) - 0.5 * (w[0] - SEPARATED_SD) ** 2
    return jnp.logaddexp(-0.5 * w[0] ** 2, other) - 0.5 * jnp.sum(w[1:] ** 2)


def _shares_of_walks() -> Mode:
    start = poor.unit_normals()
    start[::2, 0] += SEPARATED_SD
    walk = poor.bare_walk(two_normals, start, TWO_MODE_STEPS)
    share, tau = np.mean(walk.kept[..., 0] > SEPARATED_SD / 2), walk.judged.tau.max()
    seen = not walk.judged.reached(1.0) and tau > TWO_MODE_STEPS / 50
    numbers = {"apart": SEPARATED_SD, "weight": MINOR_SHARE, "share": share}
    numbers |= {"steps": TWO_MODE_STEPS, "tau": walk.own_tau, "judged": tau}
    return row("walk_shares", TWO_MODE_STEPS / walk.own_tau, seen, **numbers)


def _mirror() -> Mode:
    found = poor.solved_log(poor.line(), *MIRRORED).solution
    density, root = poor.about(found)
    walk = poor.bare_walk(density, poor.unit_normals(), MIRROR_STEPS)
    best = found.answer.z[2]
    north = best + walk.chain @ root[2]
    beyond = int((np.sign(north) != np.sign(best)).any(axis=0).sum())
    draws = found.draws
    share = float(draws.weights @ (np.sign(draws.values[:, 2]) == np.sign(best)))
    numbers = {"steps": MIRROR_STEPS, "walkers": poor.WALKERS, "beyond": beyond}
    numbers |= {"share": share, "rest": 1 - share, "r_hat": walk.judged.r_hat.max()}
    numbers["times"] = MIRROR_STEPS / walk.own_tau
    return row("walk_mirror", poor.WALKERS - beyond, 0.3 < share < 0.7, **numbers)


def _null_walk() -> Mode:
    found = poor.wu_hao_solution()
    z, likelihood = jnp.asarray(found.answer.z), poor.bare_likelihood(found)
    start = 0.1 * poor.unit_normals()
    walk = poor.bare_walk(lambda w: likelihood(z + w), start, LONG_CHAIN)
    mass = found.answer.z[0] + walk.kept[..., 0]
    estimates = found.identified.estimates.values()
    named = len(found.identified.null) == 1 and not any(x.identified for x in estimates)
    tau = float(walk.judged.tau.max())
    numbers = {"least": mass.min(), "most": mass.max(), "tau": tau}
    numbers |= {"r_hat": walk.judged.r_hat.max(), "steps": LONG_CHAIN}
    return row("walk_null", LONG_CHAIN / tau, named, **numbers)


def _endless() -> Mode:
    # seen from 300 m, the sensors subtend 4 degrees
    found = poor.solved_log(poor.circle(10.0), 30.0, 300.0, 0.0).solution
    density, root = poor.about(found)
    walks = [
        poor.bare_walk(density, poor.unit_normals(), n)
        for n in (SHORT_CHAIN, LONG_CHAIN)
    ]
    low = [
        np.quantile(np.exp(found.answer.z[0] + walk.kept @ root[0]), 0.05)
        for walk in walks
    ]
    mass = found.identified.estimates["charge_mass_kg"]
    words = f"no value of the mass; it is below {mass.q95:.3g} kg"
    if mass.identified:
        words = "not converged (exit code 4)"
    marked = not mass.identified or not found.converged
    times = LONG_CHAIN / float(walks[-1].judged.tau.max())
    numbers = {"low": low, "words": words, "short": SHORT_CHAIN, "long": LONG_CHAIN}
    return row("walk_endless", times, marked, **numbers)


# Cameras
def camera_failures() -> Iterator[Mode]:
    """Measure the failure modes of lens formulas, for a view of over 90 degrees."""
    k1 = -0.3  # usual for a wide lens
    plain, bent = (
        Camera(
            position=jnp.zeros(3),
            quaternion=jnp.array([-np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)]),
            focal=jnp.full(2, 200.0),
            center=jnp.array([319.5, 239.5]),
            width=640,
            height=480,
            distortion=jnp.array([k, 0.0, 0.0, 0.0, 0.0]),
        )
        for k in (0.0, k1)
    )
    ahead, behind = (project(plain, jnp.array([1.0, y, 0.5])).seen for y in (5.0, -5.0))
    column, line = (200.0 * x / -5.0 + c for x, c in ((1.0, 319.5), (-0.5, 239.5)))
    seen = bool(ahead) and not bool(behind)
    yield row("behind", 0.0, seen, column=column, row=line)
    fold = math.sqrt(-1.0 / (3.0 * k1))  # 1 + 3 k1 r^2 = 0
    out, top = 1.4 * fold, fold * (1.0 + k1 * fold**2)
    beyond, inside = (
        project(bent, jnp.array([x, 1.0, 0.0])).seen for x in (out, 0.99 * fold)
    )
    past = bent.center + jnp.array([200.0 * 1.01 * top, 0.0])
    refused = bool(refusal(lambda: unproject(bent, past)))
    angle, off = np.degrees(np.arctan([fold, out]))
    numbers = {"k1": k1, "out": off, "x": out * (1.0 + k1 * out**2), "top": top}
    seen = bool(inside) and not bool(beyond) and refused
    yield row("fold", angle, seen, **numbers)


# Flights
HOME = (0.0, 0.0, 5.0)
"""Target position [m]: above the ground, so that no small motion touches it."""
NAMES = tuple(PARAMETERS)
CHARGES = np.geomspace(1.0, 1000.0, 31)
"""Masses of TNT at 5 m from the vehicle [kg]."""
SPEEDS = np.geomspace(1e4, 1e7, 100)
"""Absurd initial speeds: drag is stiff at 0.5 ms only far above real ones [m/s]."""
SHARES = np.append(np.linspace(0.9, 1.1, 21), np.arange(1.15, 2.01, 0.05))
"""Steps as shares of the stated limit: 1 % apart about it."""
POWERS = {"position": 2, "velocity": 1, "attitude": 2, "body_rate": 1, "integral": 3}
"""Powers of 1/time in the units of gains."""
START, HOVER_STEP_S, HOVER_STEPS = 1e-6, 1e-3, 6000
"""Initial body rate [rad/s], so small that the loop is linear; step and its number: a
mode 1 % past its limit grows visibly between 1,500 and 6,000 steps."""
EARLY, LATE = slice(15, 30), slice(45, 61)
"""Early and late rows, one per hundred steps, that show growth or decay."""


def flight_failures() -> Iterator[Mode]:
    """Measure every failure mode of a flight."""
    yield from _step_limits()
    yield from (_quaternion(), _lost(), _near())
    yield from _charges()


def hovering(vehicle: Vehicle, body_rate=(0.0, 0.0, 0.0)) -> State:
    """Return the state of a level vehicle at rest with a body rate [rad/s]."""
    speed = jnp.sqrt(vehicle.mass_kg * 9.81 / 4 / vehicle.thrust_coefficient)
    level, still = jnp.array([0.0, 0.0, 0.0, 1.0]), jnp.zeros(3)
    turn = jnp.asarray(body_rate)
    return State(jnp.asarray(HOME), still, level, turn, jnp.full(4, speed))


def stacked(trees: Sequence[Any]) -> Any:
    """Return trees of one structure as one tree, with a leading axis of rows."""
    return jax.tree.map(lambda *parts: jnp.stack(parts), *trees)


def _step_limits() -> Iterator[Mode]:
    limits, vehicles, holds = [], [], []
    for name in NAMES:
        vehicle, gains = named(name), named_gains(name)
        limits.append(step_limit(float(vehicle.motor_lag_s), gains))
        for share in SHARES:
            times = jnp.asarray(share * limits[-1] / HOVER_STEP_S)
            lag = vehicle.motor_lag_s / times
            # names are static: different ones could not be stacked
            vehicles.append(
                dataclasses.replace(vehicle, name="", body=None, motor_lag_s=lag)
            )
            faster = {key: times**k * getattr(gains, key) for key, k in POWERS.items()}
            holds.append(PositionHold(HOME, dataclasses.replace(gains, **faster)))
    starts = [hovering(vehicle, (START, 2 * START, START)) for vehicle in vehicles]

    @jax.jit  # simulate refuses steps past a limit unless the limit is a tracer
    def rates(fleet, starts, holds):
        flown = simulate(
            fleet,
            starts,
            duration_s=HOVER_STEPS * HOVER_STEP_S,
            step_s=HOVER_STEP_S,
            control=holds,
            store_every=100,
        )
        return jnp.linalg.norm(flown.body_rate_rad_s, axis=-1)

    spin = np.asarray(rates(stacked(vehicles), stacked(starts), stacked(holds)))
    spin = np.where(np.isfinite(spin), spin, np.inf)  # a lost flight has grown
    early, late = (
        spin[:, rows].max(axis=1).reshape(len(NAMES), SHARES.size)
        for rows in (EARLY, LATE)
    )
    # a decayed rate is rounding alone
    up = ((late > early) & (late > 1e-3 * START)) | (late > 1e3 * START)
    for name, limit, grows, last in zip(NAMES, limits, up, late, strict=True):

        def refused(step: float, name=name) -> bool:
            hold, vehicle = PositionHold(HOME, named_gains(name)), named(name)
            options = {"duration_s": step, "step_s": step, "control": hold}
            return bool(
                refusal(lambda: simulate(vehicle, hovering(vehicle), **options))
            )

        first = first_failure(grows[:-1], name)
        end = "lost" if np.isinf(last[first + 1]) else f"{last[first + 1]:.1g} rad/s"
        seen = SHARES[first] > 0.99 and not refused(0.999 * limit)
        at, longer = 1e3 * limit * SHARES[first], 1e3 * limit * SHARES[first + 1]
        numbers = {"vehicle": name, "longer": longer, "end": end, "steps": HOVER_STEPS}
        seen = seen and refused(1.001 * limit)
        yield row("step_limit", at, seen, limit=1e3 * limit, **numbers)


def _quaternion() -> Mode:
    def shortest(dtype: type) -> float:
        """Return the length at which a quaternion can no longer be scaled to 1."""
        lengths = np.array([float(f"1e-{n}") for n in range(320)]).astype(dtype)
        zero = jnp.zeros(lengths.size, dtype)
        scaled = np.asarray(jax.vmap(unit)((zero, zero, zero, jnp.asarray(lengths)))[3])
        return float(f"1e-{first_failure(np.abs(scaled - 1) > 1e-3, 'quaternion')}")

    def attempt(length: float) -> str:
        short = np.array([0.0, 0.0, 0.0, length], np.float32)
        level = hovering(named("crazyflie"))
        return refusal(lambda: dataclasses.replace(level, quaternion=short))

    nan = int(np.isnan(np.asarray(unit(tuple(jnp.zeros(4))))).sum())
    single, double = shortest(np.float32), shortest(np.float64)
    zero, short = attempt(0.0), attempt(single)
    seen = "length 1, got" in zero and "length 1, got" in short
    messages = zero, short.partition(", ")[2]
    numbers = {"nan": nan, "double": double, "messages": messages}
    return row("quaternion", single, seen, **numbers)


def _lost() -> Mode:
    vehicle = named("hummingbird")
    level = hovering(vehicle)

    def fly(speeds: np.ndarray):
        starts = [
            dataclasses.replace(level, velocity_m_s=jnp.array([speed, 0.0, 0.0]))
            for speed in speeds
        ]
        return simulate(vehicle, stacked(starts), duration_s=0.05, store_every=10)

    slow = np.linspace(0.0, 10.0, SPEEDS.size)
    calm, both = fly(slow), fly(np.where(np.arange(SPEEDS.size) % 2, SPEEDS, slow))
    lost = np.asarray(both.lost)
    alike = all(
        np.array_equal(getattr(calm, name)[::2], getattr(both, name)[::2])
        for name in ("position_m", "quaternion")
    )
    first = first_failure(lost, "a batch with ever faster vehicles")
    seen = alike and lost[first::2].all() and not lost[::2].any()
    return row("lost", SPEEDS[first], seen, lost=int(lost.sum()))


def _near() -> Mode:
    load, vehicle = blast_load(Scene(Charge(mass_kg=1.0))), named("crazyflie")
    level = hovering(vehicle)

    def given(distance):
        position = jnp.array([1.0, 0.0, 0.0]) * distance
        state = dataclasses.replace(level, position_m=position)
        push, _ = load.impulse(jnp.zeros(()), jnp.ones(()), state, vehicle)
        return jnp.linalg.norm(push), load.in_range(position)[0]

    near = jnp.array([0.0, 0.01, 0.1, 0.2, 0.5, 1.0, 2.0])
    sizes, valid = map(np.asarray, jax.jit(jax.vmap(given))(near))
    begins = switching_point(
        lambda r: load.in_range(jnp.array([r, 0.0, 0.0]))[0], 0.1, 1.0
    )
    seen = np.isfinite(sizes).all() and not valid[:3].any() and valid[4:].all()
    return row("near", begins, seen, close=sizes[1], zero=sizes[0])


def _charges() -> Iterator[Mode]:
    # one batch of all vehicles and charges, so that one program flies them
    vehicles, holds, loads = [], [], []
    for name, mass in itertools.product(NAMES, CHARGES):
        charge = Charge(mass_kg=mass, position_m=(5.0, 0.0, 5.0), burst="free-air")
        vehicles.append(dataclasses.replace(named(name), name=""))
        holds.append(PositionHold(HOME, named_gains(name)))
        loads.append(blast_load(Scene(charge)))
    flown = simulate(
        stacked(vehicles),
        stacked([hovering(vehicle) for vehicle in vehicles]),
        duration_s=2.0,
        step_s=1e-3,
        control=stacked(holds),
        loads=(stacked(loads),),
        ground_up_m=0.0,
        store_every=10,
    )
    found = flight_metrics(flown, jnp.asarray(HOME), blast_time_s=0.0, ground_up_m=0.0)
    alive, moved = (
        np.asarray(each).reshape(len(NAMES), CHARGES.size)
        for each in (~found.crashed, found.peak_deviation_m)
    )
    for name, flies, peak in zip(NAMES, alive, moved, strict=True):
        first = int(np.argmin(flies))
        numbers = {"smaller": CHARGES[first - 1], "moved": peak[first - 1]}
        numbers |= {"flies": flies[first:].sum(), "larger": CHARGES.size - first - 1}
        seen = first > 0 and not flies[first]
        yield row("charge", CHARGES[first], seen, vehicle=name, **numbers)


# Detectors and picks
OUTLIER, FAILED_SHARE, PICK_LOGS = 4.0, 0.05, 5
"""Error of a failed pick [sd]; accepted share (one of 30 is 3 %); shots of six."""
CLEAR, WANDER, ECHO = 100.0, 0.1, 0.3
"""Peak over noise in the rows on other effects; amplitude of the baseline and peak of
the echo, as shares of the peak."""
TWO_OF_30 = 0.07
"""Share of unmarked outliers up to which picks count as marked: chance gives 2 of 30
with 45 % at 5 %."""


def detector_failures() -> Iterator[Mode]:
    """Measure the failure mode of a detector of sound."""
    message = refusal(lambda: noise_spectrum(np.zeros(2**15), cases.RATE))
    yield row("silence", 1.0, "digital silence" in message, message=message)


def pick_shares(recorders: Sequence[cases.Recorder]) -> np.ndarray:
    """Return the shares of failed picks and of unmarked outliers, by recorder."""
    rng = np.random.default_rng(3)
    truths = [cases.readings(rng, scatter=True) for _ in range(PICK_LOGS)]
    records = []
    for recorder in recorders:
        # common random numbers: shares differ by the recorder alone
        drawn = np.random.default_rng(4)
        records += [r for one in truths for r in cases.recorded(drawn, one, recorder)]
    seen = []
    truth = np.tile(np.concatenate(truths), (len(recorders), 1))
    for one, true in zip(pick_records(records), truth, strict=True):
        pick = one.pick
        others = [
            pick.peak_overpressure_pa,
            pick.positive_duration_s,
            pick.positive_impulse_pa_s,
        ]
        off = np.log(np.array(others) / true[1:])
        error = np.append(pick.air_arrival_s - true[0], off)
        far = bool((np.abs(error) > OUTLIER * np.sqrt(np.diag(pick.covariance))).any())
        seen.append((far or not pick.found, far and one.quality == "good"))
    return np.reshape(seen, (len(recorders), -1, 2)).mean(axis=1).T


def pick_failures() -> Iterator[Mode]:
    """Measure every failure mode of picks of pressure records."""
    sets = {
        "noise": [
            (snr, cases.Recorder(snr=snr, colour=0.7))
            for snr in (1000.0, 100.0, 30.0, 10.0, 7.0, 5.0, 4.0, 3.0, 2.0)
        ],
        "baseline": [
            (period, cases.Recorder(snr=CLEAR, wander=WANDER, wander_period=period))
            for period in (20.0, 10.0, 7.0, 4.0, 2.0)
        ],
        "echo": [
            (d, cases.Recorder(snr=CLEAR, echo=d, echo_size=ECHO, echo_rise=4.0))
            for d in (0.7, 0.4, 0.1, 0.05, 0.02, 0.01)
        ],
    }
    for key, recorders in sets.items():
        levels, cases_of_it = zip(*recorders, strict=True)
        failed, unmarked = pick_shares(cases_of_it)
        numbers: dict[str, Any] = {"share": FAILED_SHARE, "sd": OUTLIER}
        numbers |= {"wander": WANDER, "echo": ECHO}
        worst, silent = int(np.argmax(failed)), int(np.argmax(unmarked))
        numbers |= {"worst": failed[worst], "worst_at": levels[worst]}
        numbers |= {"unmarked": unmarked[silent], "unmarked_at": levels[silent]}
        numbers["response"] = "marks" if unmarked.max() <= TWO_OF_30 else "accepts"
        first = first_failure(failed > FAILED_SHARE, key)
        yield row(key, levels[first], True, **numbers)


AREAS = {
    "laws": law_failures,
    "wave forms": wave_form_failures,
    "clocks": clock_failures,
    "fits": fit_failures,
    "walks": walk_failures,
    "cameras": camera_failures,
    "flights": flight_failures,
    "detectors": detector_failures,
    "records": pick_failures,
}
"""Function that measures the failure modes of each area."""


# Page and figure
def read() -> dict[str, list[Mode]]:
    """Return the kept failure modes by area."""
    kept: dict[str, list[Mode]] = {}
    with KEPT.open(newline="") as file:
        for row in csv.DictReader(file):
            given: dict[str, Any] = {**row, "boundary": float(row["boundary"])}
            mode = Mode(**given)
            kept.setdefault(mode.area, []).append(mode)
    return kept


def boundary_words(mode: Mode) -> str:
    """Return the limit at which a failure begins, with its unit."""
    number = mode.boundary
    words = f"{number:g}" if mode.cases else printed_number("", number, 3)
    return f"{words} {mode.unit}".rstrip()


def page(modes: Mapping[str, Sequence[Mode]]) -> str:
    """Return the page, with a table for each area."""
    lines = [
        "# Where each method fails",
        "",
        "Drawn by `make stability`. Each method was used past its limit. There jblast",
        "*marks* the answer as extrapolated, *refuses* with a message, or *falls back*",
        "to another method; where it does none of these, it *accepts* a wrong answer.",
        "",
        "![Where each method fails](stability.png)",
    ]
    columns = [
        Column("method", lambda m: m.method),
        Column("failure", lambda m: m.failure),
        Column("at", boundary_words),
        Column("beyond it", lambda m: m.beyond),
        Column("jblast", lambda m: f"**{m.response}**: {m.message}"),
    ]
    for area, found in modes.items():
        table = markdown(Table(columns, found))
        lines += ["", f"## {capitalised(area)}", "", table]
    return "\n".join(lines) + "\n"


Z = np.geomspace(0.02, 2e4, 1200)
"""Scaled distances drawn [m/kg^(1/3)]; scaled laws have one map for every mass."""
DRAWN = (*CURVES, "shock_radius_m")
"""Quantities of the map; the ranges of the remaining ones are equal to these."""
UNITS = {"m/kg^(1/3)": 1.0, "m/kg^(1/2)": MASS ** (1.0 / 2.0 - 1.0 / 3.0)}
"""Units of boundaries, in scaled distances of `MASS`."""


def figure_of(modes: Mapping[str, Sequence[Mode]]) -> Figure:
    """Draw the laws over scaled distance, clocks, and the shares of failing cases."""
    figure = new_figure(15.0, 10.5)
    left, right = figure.subfigures(1, 2, width_ratios=[0.92, 1.0], squeeze=False)[0]
    _law_map(left.subplots(), modes["laws"])
    above, below = right.subplots(2, 1, height_ratios=[1.0, 1.2])
    _clocks(above, modes["clocks"])
    _shares(below, [mode for found in modes.values() for mode in found if mode.cases])
    return figure


def _law_map(axes: Axes, modes: Sequence[Mode]) -> None:
    line, names = 0.0, {}
    for quantity in DRAWN:
        words = f"  {capitalised(quantity_words(quantity))}"
        head = {"fontsize": 9.5, "fontweight": "bold", "color": INK, "va": "center"}
        axes.text(0.0, line, words, transform=axes.get_yaxis_transform(), **head)
        for law in (law for law in LAWS.values() if law.quantity == quantity):
            line += 1.0
            names[line] = law.name
            # a law counts as valid if it is so for at least one kind of burst
            valid = np.any([_valid(law, burst) for burst in BURSTS], axis=0)
            for start, stop, good in runs(valid):
                width, low = Z[stop - 1] - Z[start], Z[start]
                look = (BLUE, 0.75, 0.56) if good else ("#d8d8d8", 1.0, 0.17)
                color, alpha, height = look
                axes.barh(line, width, height, left=low, color=color, alpha=alpha)
            limits = sorted(
                mode.boundary * UNITS[mode.unit]
                for mode in modes
                if mode.method == f"{quantity} by {law.name}" and mode.unit in UNITS
            )
            for z in limits:
                axes.plot([z, z], [line - 0.42, line + 0.42], color=VERMILLION, lw=2)
                # the number of a lower limit stands outside, on the left
                x, side = (z / 1.08, "right") if z < limits[-1] else (1.08 * z, "left")
                axes.text(x, line, f"{z:.2g}", fontsize=8, va="center", ha=side)
        line += 1.25
    axes.set_xscale("log")
    axes.set(xlim=(Z[0], Z[-1]), ylim=(line - 0.4, -0.8))
    axes.set_yticks([*names], [*names.values()])
    axes.spines[["top", "right", "left"]].set_visible(False)
    axes.tick_params(which="both", color=MUTED, labelcolor=INK, labelsize=9)
    axes.tick_params(axis="y", length=0)
    axes.grid(True, axis="x", color=GRID, linewidth=0.8)
    axes.set_axisbelow(True)
    axes.set_xlabel("scaled distance Z (m/kg$^{1/3}$)", fontsize=10, color=INK)
    titled(axes, "Range of validity of each law")
    entries = (
        Patch(color=BLUE, alpha=0.75, label="valid"),
        Patch(color="#d8d8d8", label="extrapolated, marked"),
        Line2D([], [], color=VERMILLION, linewidth=2.0, label="limit"),
    )
    place: dict[str, Any] = {
        "loc": "upper center",
        "bbox_to_anchor": (0.45, -0.06),
        "ncols": 3,
    }
    axes.legend(handles=entries, frameon=False, fontsize=9, labelcolor=MUTED, **place)


def _valid(law: Law, burst: Burst) -> np.ndarray:
    path = cases.standard_path(Z, burst, MASS)
    # laws of the shock radius need a time: that of the strong point-source shock
    air = path.air_density, path.sedov_gamma
    energy = np.asarray(sedov_taylor_energy(path.slant_range, 1.0, *air))
    time = np.sqrt(energy / (TNT_SPECIFIC_ENERGY * MASS))
    path = dataclasses.replace(path, time_since_detonation=jnp.asarray(time))
    return np.broadcast_to(np.asarray(call(law.valid, path)), Z.shape)


def _clocks(axes: Axes, modes: Sequence[Mode]) -> None:
    time = 2.0 ** np.arange(0, 36)
    for (dtype, sigma), colour, mode in zip(
        SIGMAS.items(), (VERMILLION, BLUE), modes, strict=True
    ):
        steps = np.spacing(time.astype(dtype)).astype(float)
        axes.loglog(
            time, steps, color=colour, linewidth=1.8, label=np.dtype(dtype).name
        )
        axes.axhline(sigma, color=MUTED, linewidth=0.9, linestyle=(0, (4, 3)))
        words = f"sigma = {sigma:g} s"
        axes.text(2e5, sigma / 1.4, words, color=MUTED, fontsize=8, va="top")
        axes.plot(mode.boundary, sigma, "o", color=COLOURS[mode.response], zorder=4)
    for words, at in TIMES.items():
        axes.axvline(at, color="#c8c8c8", linewidth=0.9, zorder=0)
        axes.text(at, 3e3, f"{words} ", color=MUTED, fontsize=8, ha="right", va="top")
    axes.set(xlabel="time on the clock (s)", ylabel="step (s)", ylim=(1e-17, 5e3))
    axes.legend(frameon=False, fontsize=9, labelcolor=MUTED, loc="lower right")
    quiet(axes)
    titled(axes, "Clock times", "dots: refused from here")


def _shares(axes: Axes, modes: Sequence[Mode]) -> None:
    look = {"va": "center", "fontsize": 8.5, "color": INK}
    for line, mode in enumerate(modes):
        share = 100.0 * mode.boundary / mode.cases
        axes.barh(line, share, 0.36, color=COLOURS[mode.response], alpha=0.8)
        words = f"{mode.method}: {mode.failure}; jblast {mode.response}"
        # the name stands above its bar, where long ones have the whole width
        axes.text(0.0, line - 0.36, words, **look)
        axes.text(share + 1.0, line, boundary_words(mode), **look)
    axes.set_yticks([])
    axes.set(xlim=(0.0, 110.0), ylim=(len(modes) - 0.5, -0.8))
    axes.set_xticks([0, 25, 50, 75, 100])
    axes.set_xlabel("share that fails (%)")
    quiet(axes)
    axes.grid(False, axis="y")
    titled(axes, "Cases that fail")


def main() -> None:
    """Draw the kept table; with --measure, measure first."""
    parser = argparse.ArgumentParser(description="Where each method fails.")
    parser.add_argument("area", nargs="*", metavar="AREA", help=", ".join(AREAS))
    parser.add_argument("--measure", action="store_true", help="measure again")
    options = parser.parse_args()
    areas = [area.replace("-", " ") for area in options.area] or list(AREAS)
    if unknown := [area for area in areas if area not in AREAS]:
        parser.error(f"no area {unknown[0]!r}: expected {', '.join(AREAS)}")
    start_jax()
    modes, progress = read(), in_words()
    for area in areas if options.measure else ():
        progress(area)
        modes[area] = list(AREAS[area]())
        rows = [mode for name in AREAS for mode in modes.get(name, ())]
        write_text(KEPT, table_text([Mode._fields, *rows]))
    write_text(KEPT.with_suffix(".md"), page(modes))
    write_figure(figure_of(modes), KEPT.with_suffix(".png"))


if __name__ == "__main__":
    main()
