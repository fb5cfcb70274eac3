r"""Where does each method fail, and what does jblast do there?

    python -m calibration.stability [AREA ...]            # page and figure, as kept
    python -m calibration.stability [AREA ...] --measure  # measured again

Each method is used past its limit. There jblast marks the answer as extrapolated,
refuses with a message, or falls back to another method: every row states the limit,
the behaviour of the method alone, and the response, which is observed and not claimed.
Rows are kept in `results/stability.csv`; the page is `results/stability.md`.

Laws fail beyond their tables and ranges, clocks where the resolution of numbers exceeds
the error of a recorder, cameras behind the lens and beyond the fold of its distortion,
flights at long steps and strong blasts, picks by noise, drift and echoes.
Fits and MCMC are in `stability_fits`. Near hover a vehicle's loop depends on times only
as multiples of the step: a step longer by $s$ is the same step with motors and gains
faster by $s$. Therefore one program flies all vehicles at all steps.
"""

import argparse
import csv
import dataclasses
import importlib
import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Literal, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from scipy.optimize import root_scalar

from calibration import cases
from jblast.cli.jax_start import start_jax
from jblast.constants import (
    STANDARD_PRESSURE,
    STANDARD_SOUND_SPEED,
    TNT_SPECIFIC_ENERGY,
)
from jblast.errors import InputError, whole_number
from jblast.files import table_text, write_text
from jblast.inference.fitting.warnings import POINT_SOURCES, charge_is_no_point
from jblast.observations import observed, resolve_positions
from jblast.observations.clocks import refuse_unresolved
from jblast.progress import in_words
from jblast.registry import LAWS, Law, call
from jblast.report.colours import BLUE, GRID, INK, MUTED, VERMILLION
from jblast.report.figures import new_figure, quiet, runs, titled, write_figure
from jblast.report.numbers import capitalised, printed_number, quantity_words
from jblast.report.view import Column, Table, markdown
from jblast.scene import Camera, Charge, Scene
from jblast.scene.charge import Burst
from jblast.sensors.calculator import COMBINATIONS, calculated_laws
from jblast.sensors.camera.geometry import project, unproject
from jblast.signals import noise_spectrum
from jblast.signals.picks import pick_records
from jblast.vehicle import (
    Gains,
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
from jblast.waves.pulse import (
    friedlander_pressure,
    pulse_of,
)

RESULTS = Path(__file__).parent / "results"
KEPT = RESULTS / "stability.csv"
Response = Literal["marks", "refuses", "falls back"]
"""Response of jblast where a method fails."""
COLOURS = {"marks": VERMILLION, "refuses": INK, "falls back": "#E69F00"}
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


def verified(response: Response, seen: bool | np.bool_, what: str) -> Response:
    """Return a response that was observed, so that no table states any other.

    Raises:
        RuntimeError: The response was not observed.
    """
    if not seen:
        raise RuntimeError(f'{what}: expected the response "{response}", got another')
    return response


def crossing(
    function: Callable[[float], float], low: float, high: float, *, to: float = 1e-12
) -> float:
    """Return the zero of a function with different signs at two bounds.

    Args:
        function: Function of one number.
        low: Lower bound.
        high: Upper bound.
        to: Relative precision.
    """
    return float(root_scalar(function, bracket=(low, high), rtol=to).root)


def switching_point(
    answer: Callable[[float], bool | np.bool_], low: float, high: float
) -> float:
    """Return the point at which a condition changes, by bisection."""
    # +-0.5 gives the root finder the sign change that a truth value lacks
    found = root_scalar(
        lambda x: 0.5 - bool(answer(x)),
        bracket=(low, high),
        method="bisect",
        rtol=1e-12,
    )
    return float(found.root)


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


def boundary_at(
    limit: float, measured: np.ndarray, levels: np.ndarray, what: str
) -> float:
    """Return the level at which a rising measure reaches a limit, interpolated.

    Raises:
        RuntimeError: The measure does not pass the limit between two of the levels.
    """
    # np.interp would return an end of the levels without a warning
    if not measured[0] <= limit < measured[-1]:
        raise RuntimeError(
            f"{what}: expected {measured[0]:g} to {measured[-1]:g}, measured at "
            f"{levels[0]:g} and {levels[-1]:g}, to contain {limit:g}"
        )
    return float(np.interp(limit, measured, levels))


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
GAMMA, DENSITY = 1.4, 1.225
"""Ratio of specific heats [-] and density of standard air [kg/m3]."""


def law_failures() -> list[Mode]:
    """Measure every failure mode of a law."""
    tables = [mode for quantity in CURVES for mode in _table_limits(quantity)]
    return [_wu_hao(), *tables, *_kinney_graham(), *_point_sources(), _at_the_charge()]


def _wu_hao() -> Mode:
    def lead(distance: float) -> float:
        time = wu_hao_air_arrival_time(distance, 1.0, STANDARD_SOUND_SPEED)
        return float(distance / time) / STANDARD_SOUND_SPEED - 1.0

    mean = crossing(lead, 1.0, 100.0)
    marked = switching_point(lambda r: bool(wu_hao_air_valid(r, 1.0)), 1.0, 100.0)
    method = "air_arrival_s by wu_hao"
    return Mode(
        "laws",
        method,
        "slower than sound on average",
        mean,
        "m/kg^(1/2)",
        f"{mean * math.sqrt(MASS):.1f} m for {MASS:g} kg; at twice that "
        f"{-100 * lead(2 * mean):.0f} % slower than sound",
        verified("marks", math.isclose(marked, mean, rel_tol=1e-6), method),
        "law_valid false beyond",
    )


def _table_limits(quantity: str) -> list[Mode]:
    law, method = LAWS[quantity, "kingery_bulmash"], f"{quantity} by kingery_bulmash"
    curve = kingery_bulmash_curves(CURVES[quantity])["surface"]

    def ratio_at(z: float) -> str:
        """Return the printed polynomials over the curve as jblast evaluates it."""
        log_z: Any = np.log(z)
        with np.errstate(over="ignore"):
            ratio = float(np.exp(curve.form(log_z) - curve.exact(log_z)))
        return f"{'overflows' if math.isinf(ratio) else f'{ratio:.3g}'} at Z = {z:g}"

    def power_law(end: float) -> bool:
        """Return True if the law beyond an end has one slope and is marked invalid."""
        # three points outside the table: two equal slopes in ln make a power law
        factor = 2.0 if end > 1.0 else 0.5
        z = end * np.array([1.001 if end > 1.0 else 0.999, factor, factor**2])
        slopes = np.diff(np.log(np.asarray(law.function(z, 1.0)))) / np.diff(np.log(z))
        straight = math.isclose(slopes[0], slopes[1], rel_tol=1e-6)
        return straight and not np.any(law.valid(z, 1.0))

    message = "power law with the end slope, law_valid false"
    farther = message
    if quantity == "peak_overpressure_pa":
        high = float(law.function(jnp.asarray([LAST_Z]), 1.0)[0])
        weak = float(shock_kinematics_pressure(LAST_Z, 1.0))
        farther += (
            f": {high:.3g} Pa at Z = {LAST_Z:g}, where shock_kinematics has {weak:.3g}"
        )
    modes = []
    for failure, bounds, places, words in (
        ("table ends near the charge", (INNER_Z, 1.0), (INNER_Z,), message),
        ("table ends far out", (1.0, LAST_Z), (OUTER_Z, LAST_Z), farther),
    ):
        end = switching_point(lambda z: bool(law.valid(z, 1.0)), *bounds)
        ratios = ", ".join(ratio_at(z) for z in places)
        modes.append(
            Mode(
                "laws",
                method,
                failure,
                end,
                "m/kg^(1/3)",
                f"polynomial over power law: {ratios}",
                verified("marks", power_law(end), method),
                words,
            )
        )
    return modes


def _kinney_graham() -> list[Mode]:
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
    method = "positive_duration_s by kinney_graham"
    law = LAWS["positive_duration_s", "kinney_graham"]
    valid = [
        bool(law.valid(z, 1.0, burst="free-air"))
        for z in (0.99 * near, best, 1.01 * far)
    ]
    response = verified("marks", valid == [False, True, False], method)
    of = "of kingery_bulmash"
    return [
        Mode(
            "laws",
            method,
            "too short near the charge",
            near,
            "m/kg^(1/3)",
            f"{100 * ratio(worst):.0f} % {of} at Z = {worst:.2g}, "
            f"{100 * ratio(2.0):.0f} % at 2; {100 * ratio(best):.0f} % at best "
            f"(Z = {best:.0f})",
            response,
            f"law_valid false: {law.range}",
        ),
        Mode(
            "laws",
            method,
            "too short far out",
            far,
            "m/kg^(1/3)",
            f"{100 * ratio(40.0):.0f} % {of} at Z = 40",
            response,
            "law_valid false",
        ),
    ]


def _point_sources() -> list[Mode]:
    """Measure laws of point sources for 1 kg; they scale."""

    def is_reported(law: str) -> bool:
        chemical = charge_is_no_point([law], Charge(mass_kg=1.0))
        nuclear = charge_is_no_point([law], Charge(mass_kg=1.0, explosive="nuclear"))
        return law in POINT_SOURCES and bool(chemical) and not nuclear

    def sedov_error(z: float) -> float:
        exact = float(point_source_pressure(z, 1.0)) + STANDARD_PRESSURE
        return float(sedov_taylor_shock_pressure(z, 1.0, GAMMA)) / exact - 1.0

    law = LAWS["shock_radius_m", "sedov_taylor"]

    def sedov_valid(z: float) -> bool:
        energy = float(sedov_taylor_energy(z, 1.0, DENSITY, GAMMA))
        time = math.sqrt(energy / TNT_SPECIFIC_ENERGY)
        return bool(law.valid(time, 1.0, DENSITY, GAMMA, STANDARD_PRESSURE))

    def share(z: float) -> float:
        time = kingery_bulmash_arrival_time(z, 1.0, burst="free-air")
        return float(sedov_taylor_energy(z, time, DENSITY, GAMMA)) / TNT_SPECIFIC_ENERGY

    def energy_error(z: float) -> float:
        """Return the error of 4.184 MJ/kg as the energy with the peak of TNT."""
        peak = float(kingery_bulmash_pressure(z, 1.0, burst="free-air"))
        mass = crossing(lambda m: float(point_source_pressure(z, m)) - peak, 1e-3, 1e3)
        return 1.0 / mass - 1.0

    weak = crossing(lambda z: sedov_error(z) + 0.1, 0.4, 1.0)
    strength = float(point_source_pressure(weak, 1.0)) / STANDARD_PRESSURE
    end = switching_point(sedov_valid, 0.4, 1.0)
    time = float(point_source_arrival_time(end, 1.0))
    radius = float(sedov_taylor_shock_radius(time, 1.0, DENSITY, GAMMA))
    # 4.184 MJ/kg is the right energy at one range only; farther out it is too little
    boundary = crossing(lambda z: energy_error(z) + 0.3, 2.5, 5.0)
    off = np.array([energy_error(z) for z in np.geomspace(0.3, boundary, 40)])
    by_sedov, by_exact = (
        "shock_radius_m by sedov_taylor",
        "peak_overpressure_pa by point_source",
    )
    warning = 'a warning, unless explosive = "nuclear"'
    return [
        Mode(
            "laws",
            by_sedov,
            "the shock is no longer strong",
            weak,
            "m/kg^(1/3)",
            f"pressure 10 % too low at {strength:.0f} ambient pressures, "
            f"{-100 * sedov_error(1.0):.0f} % at Z = 1",
            verified("marks", end < weak, by_sedov),
            f"law_valid false from Z = {end:.2f} on; there the pressure is "
            f"{100 * sedov_error(end):+.0f} % off, the radius "
            f"{100 * (radius / end - 1):+.1f} %",
        ),
        Mode(
            "laws",
            by_sedov,
            "a charge of TNT is no point",
            end,
            "m/kg^(1/3)",
            "wherever its shock is strong: radius and time give "
            f"{100 * share(0.2):.0f} % of the energy at Z = 0.2, "
            f"{100 * share(0.4):.0f} % at 0.4, {100 * share(end):.0f} % at {end:.2f}",
            verified("marks", is_reported("sedov_taylor"), by_sedov),
            warning,
        ),
        Mode(
            "laws",
            by_exact,
            "a charge of TNT is no point",
            boundary,
            "m/kg^(1/3)",
            f"inside, {TNT_SPECIFIC_ENERGY / 1e6:.3f} MJ/kg differs by "
            f"{100 * off.min():+.0f} to {100 * off.max():+.0f} % from the energy with "
            f"the peak of kingery_bulmash; {100 * energy_error(10.0):+.0f} % at Z = 10",
            verified("marks", is_reported("point_source"), by_exact),
            warning,
        ),
    ]


def _at_the_charge() -> Mode:
    laws = [law for law in calculated_laws() if "slant_range" in law.arguments()]
    path = jax.tree.map(jnp.asarray, cases.standard_path(np.ones(1), "surface"))

    def values(distance):
        ranges = distance[None]
        row = dataclasses.replace(path, slant_range=ranges, ground_range=ranges)
        return jnp.stack([jnp.sum(call(law.function, row)) for law in laws])

    # jvp gives value and slope in one pass, for all laws in one program
    zero = jnp.zeros(())
    both = jax.jit(lambda x: jax.jvp(values, (x,), (jnp.ones(()),)))(zero)
    bad = int(np.sum(~np.isfinite(both).all(axis=0)))
    pressure = LAWS["peak_overpressure_pa", "kingery_bulmash"].function
    peak = ["a"], ["peak_overpressure_pa"], [1e4], [1e3]
    log = observed(*peak, position=np.zeros((1, 3)))
    attempts = lambda: pressure(0.0, 1.0), lambda: resolve_positions(log, Scene())
    return Mode(
        "laws",
        "laws of the slant range",
        "no blast at distance 0",
        0.0,
        "m",
        f"inside jit {bad} of {len(laws)} laws have no finite value with a finite "
        "slope there",
        verified("refuses", all(map(refusal, attempts)), "distance 0"),
        "outside jit a law raises; fit, bound and simulate refuse a sensor at the "
        "position of the charge",
    )


# Wave forms and clocks
def wave_form_failures() -> list[Mode]:
    """Measure the failure modes of Friedlander's pulse."""
    method = "Friedlander's pulse"
    late = float(friedlander_pressure(10.0, 1.0, 1.0, -0.5))
    # half of this fills a triangle: more needs a negative decay
    pulse = pulse_of(0.0, 1.0, 0.6, 1.0, 0.0, 0.3, 0.6)
    ended = float(pulse.decay) < 0.0 and float(pulse.pressure(50.0)) == 0.0
    # the pressure is largest at t/t_d = 1 + 1/b, which is behind the front for b < -1
    largest = float(friedlander_pressure(0.5, 1.0, 1.0, -2.0))
    holds = COMBINATIONS["friedlander_decay"].holds
    marked = not holds(-1.0 - 1e-9) and bool(holds(-1.0 + 1e-9))
    fraction = float(impulse_fraction(jnp.array(-1.0)))
    return [
        Mode(
            "wave forms",
            method,
            "decay not positive: the tail grows without end",
            0.0,
            "= b and below",
            f"b = -0.5: {late:.0f} times the peak ten durations after arrival",
            verified("falls back", ended, method),
            "a wave of `pulse_of` has the negative phase in place of the tail",
        ),
        Mode(
            "wave forms",
            method,
            "pressure rises behind the front",
            -1.0,
            "= b and below",
            f"impulse above {fraction:.3f} Ps td; b = -2: {largest:.2f} times the "
            "stated peak",
            verified("marks", marked, method),
            "the decay is returned with valid false: this pulse has a higher peak",
        ),
    ]


TIMES = {"60 s": 60.0, "1 h": 3600.0, "Unix time": 1.7e9}
"""Clocks that count from a start-up, from an hour ago and from 1970 [s]."""
SIGMAS = {np.float32: 1e-3, np.float64: 1e-6}
"""Standard errors of the arrivals of a plain and of the best recorder [s]."""


def arrival_at(time: float, sigma: float):
    """Return a log of one arrival with its standard error [s]."""
    place = np.array([[30.0, 0.0, 0.0]])
    return observed(
        ["a"], ["air_arrival_s"], [time], [sigma], position=place, source="one arrival"
    )


def clock_failures() -> list[Mode]:
    """Measure the failure modes of clocks in single and in double precision."""
    modes = []
    for dtype, sigma in SIGMAS.items():
        # the spacing doubles at powers of two, so no other times need a test
        boundary = 1.0
        while float(np.spacing(dtype(boundary))) <= sigma:
            boundary *= 2.0
        name = f"clock times in {np.dtype(dtype).name}"
        spacings = ", ".join(
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
        modes.append(
            Mode(
                "clocks",
                name,
                f"steps of the clock exceed sigma = {sigma:g} s",
                boundary,
                "s on the clock",
                f"steps of {spacings}; a travel time of {travel:.4f} s at Unix time is "
                f"read as {float(dtype(start + travel)) - start:.4f} s",
                verified("refuses", bool(after) and not before, name),
                "fit and batch_of refuse such a row; every command runs in float64",
            )
        )
    return modes


# Cameras
def camera_failures() -> list[Mode]:
    """Measure the failure modes of lens formulas, for a view of over 90 degrees."""

    def camera(k1: float) -> Camera:
        return Camera(
            position=jnp.zeros(3),
            quaternion=jnp.array([-np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)]),
            focal=jnp.full(2, 200.0),
            center=jnp.array([319.5, 239.5]),
            width=640,
            height=480,
            distortion=jnp.array([k1, 0.0, 0.0, 0.0, 0.0]),
        )

    plain, k1 = camera(0.0), -0.3  # usual for a wide lens
    bent = camera(k1)
    ahead, behind = (project(plain, jnp.array([1.0, y, 0.5])).seen for y in (5.0, -5.0))
    column, row = (200.0 * x / -5.0 + c for x, c in ((1.0, 319.5), (-0.5, 239.5)))
    fold = math.sqrt(-1.0 / (3.0 * k1))  # 1 + 3 k1 r^2 = 0
    out, top = 1.4 * fold, fold * (1.0 + k1 * fold**2)
    beyond, inside = (
        project(bent, jnp.array([x, 1.0, 0.0])).seen for x in (out, 0.99 * fold)
    )
    past = bent.center + jnp.array([200.0 * 1.01 * top, 0.0])
    refused = bool(refusal(lambda: unproject(bent, past)))
    return [
        Mode(
            "cameras",
            "pinhole projection x/z",
            "a point behind the camera has a pixel",
            0.0,
            "m ahead and less",
            f"5 m behind: pixel ({column:.0f}, {row:.0f}) of 640 x 480, upside down",
            verified("marks", bool(ahead) and not bool(behind), "behind the camera"),
            "seen false, and a finite pixel, so that gradients stay finite",
        ),
        Mode(
            "cameras",
            f"lens distortion, k1 = {k1:g}",
            "the formula folds over: two directions have one pixel",
            float(np.degrees(np.arctan(fold))),
            "degrees off the axis",
            f"{np.degrees(np.arctan(out)):.0f} degrees off the axis are projected to "
            f"x = {out * (1.0 + k1 * out**2):.2f}, inside the {top:.2f} of the fold",
            verified(
                "marks", bool(inside) and not bool(beyond) and refused, "the fold"
            ),
            "seen false; unproject refuses a pixel past the fold",
        ),
    ]


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
START, HOVER_STEP_S, HOVER_STEPS = 1e-6, 1e-3, 6000
"""Initial body rate [rad/s], so small that the loop is linear; step and its number: a
mode 1 % past its limit grows visibly between 1,500 and 6,000 steps."""
EARLY, LATE = slice(15, 30), slice(45, 61)
"""Early and late rows, one per hundred steps, that show growth or decay."""


def flight_failures() -> list[Mode]:
    """Measure every failure mode of a flight."""
    return [*_step_limits(), _quaternion(), _lost(), _near(), *_charges()]


def hovering(vehicle: Vehicle, body_rate=(0.0, 0.0, 0.0)) -> State:
    """Return the state of a level vehicle at rest with a body rate [rad/s]."""
    speed = jnp.sqrt(vehicle.mass_kg * 9.81 / 4 / vehicle.thrust_coefficient)
    level, still = jnp.array([0.0, 0.0, 0.0, 1.0]), jnp.zeros(3)
    turn = jnp.asarray(body_rate)
    return State(jnp.asarray(HOME), still, level, turn, jnp.full(4, speed))


def stacked(trees: Sequence[Any]) -> Any:
    """Return trees of one structure as one tree, with a leading axis of rows."""
    first = jax.tree.structure(trees[0])
    parts = zip(*map(jax.tree.leaves, trees), strict=True)
    return jax.tree.unflatten(first, [jnp.stack(part) for part in parts])


def _step_limits() -> list[Mode]:
    limits, vehicles, holds = [], [], []
    for name in NAMES:
        vehicle, gains = named(name), named_gains(name)
        limits.append(step_limit(float(vehicle.motor_lag_s), gains))
        for share in SHARES:
            times = jnp.asarray(share * limits[-1] / HOVER_STEP_S)
            bare = eqx.tree_at(
                lambda v: v.motor_lag_s, named(name), vehicle.motor_lag_s / times
            )
            vehicles.append(eqx.tree_at(lambda v: v.body, bare, None))
            square = times * times
            faster = Gains(
                position=square * gains.position,
                velocity=times * gains.velocity,
                attitude=square * gains.attitude,
                body_rate=times * gains.body_rate,
                integral=square * times * gains.integral,
                integral_limit=gains.integral_limit,
            )
            holds.append(PositionHold(HOME, faster))
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
    modes = []
    for name, limit, grows, last in zip(NAMES, limits, up, late, strict=True):

        def attempt(step: float, name=name) -> str:
            hold = PositionHold(HOME, named_gains(name))
            options = {"duration_s": step, "step_s": step, "control": hold}
            vehicle = named(name)
            return refusal(lambda: simulate(vehicle, hovering(vehicle), **options))

        method = f"{name}, position controller, RK4"
        first = first_failure(grows[:-1], method)
        end = "lost" if np.isinf(last[first + 1]) else f"{last[first + 1]:.1g} rad/s"
        refused = not attempt(0.999 * limit) and bool(attempt(1.001 * limit))
        modes.append(
            Mode(
                "flights",
                method,
                "a step too long: a body rate of 1e-6 rad/s grows",
                1e3 * float(limit * SHARES[first]),
                "ms",
                f"{1e3 * limit * SHARES[first + 1]:.3g} ms: {end} after "
                f"{HOVER_STEPS:,} steps",
                verified("refuses", SHARES[first] > 0.99 and refused, method),
                f"refused above {1e3 * limit:.4g} ms, the limit by the eigenvalues of "
                "motors and loop",
            )
        )
    return modes


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
    messages = [attempt(length) for length in (0.0, single)]
    return Mode(
        "flights",
        "quaternion scaled to length 1, float32",
        "its square is zero",
        single,
        "long and shorter",
        f"length 0: {nan} of 4 numbers are NaN, and the flight stays NaN; in float64 "
        f"from {double:.0e}",
        verified("refuses", all("length 1, got" in m for m in messages), "quaternion"),
        f"{messages[0]}; {messages[1].partition(', ')[2]}",
    )


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
        np.array_equal(np.asarray(a)[::2], np.asarray(b)[::2])
        for a, b in (
            (calm.position_m, both.position_m),
            (calm.quaternion, both.quaternion),
        )
    )
    first = first_failure(lost, "a batch with ever faster vehicles")
    seen = alike and lost[first::2].all() and not lost[::2].any()
    return Mode(
        "flights",
        "a batch of 100, every other vehicle faster than the one before",
        "quadratic drag, too stiff for a step of 0.5 ms: it diverges",
        float(SPEEDS[first]),
        "m/s",
        f"{int(lost.sum())} of 50 end in NaN",
        verified("marks", seen, "a batch"),
        "those are reported as lost, with NaN rows; the flights of the rest are "
        "bit-identical to those without them",
    )


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
        lambda r: bool(load.in_range(jnp.array([r, 0.0, 0.0]))[0]), 0.1, 1.0
    )
    seen = np.isfinite(sizes).all() and not valid[:3].any() and valid[4:].all()
    return Mode(
        "flights",
        "blast load of 1 kg on the ground",
        "nearer than the range of the laws",
        begins,
        "m from the charge",
        f"0.01 m: {sizes[1]:.2g} N s, the value at Z = 0.07; {sizes[0]:.2g} at the "
        "charge, without a direction",
        verified("marks", seen, "near"),
        "in_range is false there; the load stays finite",
    )


def _charges() -> list[Mode]:
    # one batch of all vehicles and charges, so that one program flies them
    vehicles, holds, loads = [], [], []
    for name in NAMES:
        for mass in CHARGES:
            charge = Charge(mass_kg=mass, position_m=(5.0, 0.0, 5.0), burst="free-air")
            # names are static: different ones could not be stacked
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
    shape = len(NAMES), CHARGES.size
    alive = ~np.asarray(found.crashed).reshape(shape)
    moved = np.asarray(found.peak_deviation_m).reshape(shape)
    modes = []
    for name, flies, peak in zip(NAMES, alive, moved, strict=True):
        first = int(np.argmin(flies))
        modes.append(
            Mode(
                "flights",
                f"{name}, position controller, 5 m from a charge",
                "it turns over or touches the ground",
                float(CHARGES[first]),
                "kg of TNT",
                f"{CHARGES[first - 1]:.2g} kg moves it {peak[first - 1]:.2g} m; it "
                f"flies on after {int(flies[first:].sum())} of "
                f"{CHARGES.size - first - 1} larger charges",
                verified("marks", first > 0 and not flies[first], name),
                "reported as crashed in the metrics of the flight",
            )
        )
    return modes


# Detectors and picks
OUTLIER_SD, FAILED_SHARE, PICK_LOGS = 4.0, 0.05, 5
"""Error of a failed pick [sd]; accepted share (one of 30 is 3 %); shots of six."""
CLEAR, WANDER, ECHO = 100.0, 0.1, 0.3
"""Peak over noise in the rows on other effects; amplitude of the baseline and peak of
the echo, as shares of the peak."""
MERGED = (0.02, 0.01)
"""Delays [durations] within about two rise times. Such an echo makes a step and a ramp,
which is also the form of one pulse with a slow rise: it sets no boundary."""
TWO_OF_30 = 0.07
"""Accepted unmarked share for echoes: chance gives 2 of 30 with 45 % at 5 %."""


def detector_failures() -> list[Mode]:
    """Measure the failure mode of a detector of sound."""
    message = refusal(lambda: noise_spectrum(np.zeros(2**15), cases.RATE))
    return [
        Mode(
            "detectors",
            "noise measured in digital silence",
            "it is 0, and every ratio to it is infinite",
            1.0,
            "of the recording",
            "0 over 0: NaN at each sample",
            verified("refuses", "digital silence" in message, "silence"),
            message,
        )
    ]


def pick_shares(recorders: Sequence[cases.Recorder]) -> tuple[np.ndarray, np.ndarray]:
    """Return the share of failed picks, and of unmarked outliers, by recorder."""
    rng = np.random.default_rng(3)
    truths = [cases.readings(rng, scatter=True) for _ in range(PICK_LOGS)]
    records = []
    for recorder in recorders:
        # common random numbers: shares differ by the recorder alone
        drawn = np.random.default_rng(4)
        records += [r for one in truths for r in cases.recorded(drawn, one, recorder)]
    failed, unmarked = [], []
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
        sd = np.sqrt(np.diag(pick.covariance))
        far = bool(np.any(np.abs(error) > OUTLIER_SD * sd))
        failed.append(far or not pick.found)
        unmarked.append(far and one.quality == "good")
    shape = len(recorders), -1
    return tuple(np.reshape(each, shape).mean(axis=1) for each in (failed, unmarked))


def pick_failures() -> list[Mode]:
    """Measure every failure mode of picks of pressure records."""
    snrs = (1000.0, 100.0, 30.0, 10.0, 7.0, 5.0, 4.0, 3.0, 2.0)
    periods, delays = (20.0, 10.0, 7.0, 4.0, 2.0), (0.7, 0.4, 0.1, 0.05, *MERGED)
    echoes = [
        cases.Recorder(snr=CLEAR, echo=d, echo_size=ECHO, echo_rise=4.0) for d in delays
    ]
    echoed = pick_shares(echoes)
    merged = echoed[1][-len(MERGED) :].max()
    modes = []
    for method, levels, shares, unit_words, words, accepted, message in (
        (
            "pick, coloured noise (correlation 0.7 of successive samples)",
            snrs,
            pick_shares([cases.Recorder(snr=snr, colour=0.7) for snr in snrs]),
            "peak over noise, and less",
            "{:g}",
            FAILED_SHARE,
            "",
        ),
        (
            f"pick, baseline that oscillates by {WANDER:.0%} of the peak",
            periods,
            pick_shares(
                [
                    cases.Recorder(snr=CLEAR, wander=WANDER, wander_period=period)
                    for period in periods
                ]
            ),
            "durations a period, and less",
            "{:g} durations",
            FAILED_SHARE,
            "",
        ),
        (
            f"pick, an echo of {ECHO:g} within the positive phase",
            delays[: -len(MERGED)],
            tuple(share[: -len(MERGED)] for share in echoed),
            "durations behind the front, and less",
            "{:g} durations behind",
            TWO_OF_30,
            f"at {MERGED[0]:g} durations and less an echo counts as part of the front, "
            f"up to {merged:.0%} unmarked outliers; ",
        ),
    ):
        failed, unmarked = shares
        first = first_failure(failed > FAILED_SHARE, method)
        worst, silent = int(np.argmax(failed)), int(np.argmax(unmarked))
        modes.append(
            Mode(
                "records",
                method,
                f"over {FAILED_SHARE:.0%} of picks are missing, or off by "
                f"{OUTLIER_SD:g} of their sd",
                levels[first],
                unit_words,
                f"{failed[worst]:.0%} at {words.format(levels[worst])}",
                verified("marks", bool(unmarked.max() <= accepted), method),
                f"{message}outliers of good quality: {unmarked[silent]:.0%} at most, "
                f"at {words.format(levels[silent])}",
            )
        )
    return modes


_HERE, _FITS = "calibration.stability", "calibration.stability_fits"
AREAS = {
    "laws": (_HERE, "law_failures"),
    "wave forms": (_HERE, "wave_form_failures"),
    "clocks": (_HERE, "clock_failures"),
    "fits": (_FITS, "fit_failures"),
    "walks": (_FITS, "walk_failures"),
    "cameras": (_HERE, "camera_failures"),
    "flights": (_HERE, "flight_failures"),
    "detectors": (_HERE, "detector_failures"),
    "records": (_HERE, "pick_failures"),
}
"""Module and function that measures the failure modes of each area."""


# Page and figure
def read() -> dict[str, list[Mode]]:
    """Return the kept failure modes by area."""
    kept: dict[str, list[Mode]] = {}
    with KEPT.open(newline="") as file:
        for row in csv.DictReader(file):
            mode = Mode(**{**row, "boundary": float(row["boundary"])})
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
        "to another method.",
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
    row, places, names = 0.0, [], []
    for quantity in DRAWN:
        axes.text(
            *(0.0, row),
            f"  {capitalised(quantity_words(quantity))}",
            transform=axes.get_yaxis_transform(),
            fontsize=9.5,
            fontweight="bold",
            color=INK,
            va="center",
        )
        row += 1.0
        for law in (law for law in LAWS.values() if law.quantity == quantity):
            # a law counts as valid if it is so for at least one kind of burst
            bursts: tuple[Burst, ...] = ("surface", "free-air")
            valid = np.any([_valid(law, burst) for burst in bursts], axis=0)
            for start, stop, good in runs(valid):
                width, low = Z[stop - 1] - Z[start], Z[start]
                look = (BLUE, 0.75, 0.56) if good else ("#d8d8d8", 1.0, 0.17)
                color, alpha, height = look
                axes.barh(row, width, height, left=low, color=color, alpha=alpha)
            limits = sorted(
                mode.boundary * UNITS[mode.unit]
                for mode in modes
                if mode.method == f"{quantity} by {law.name}" and mode.unit in UNITS
            )
            for z in limits:
                axes.plot([z, z], [row - 0.42, row + 0.42], color=VERMILLION, lw=2)
                lower = z < limits[-1]  # its number stands outside, on the left
                place = (z / 1.08, row) if lower else (1.08 * z, row)
                side = "right" if lower else "left"
                axes.text(*place, f"{z:.2g}", fontsize=8, va="center", ha=side)
            places.append(row)
            names.append(law.name)
            row += 1.0
        row += 0.25
    axes.set_xscale("log")
    axes.set(xlim=(Z[0], Z[-1]), ylim=(row - 0.4, -0.8))
    axes.set_yticks(places, names)
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
    place = {"loc": "upper center", "bbox_to_anchor": (0.45, -0.06), "ncols": 3}
    axes.legend(handles=entries, frameon=False, fontsize=9, labelcolor=MUTED, **place)


def _valid(law: Law, burst: Burst) -> np.ndarray:
    path = cases.standard_path(Z, burst, MASS)
    # laws of the shock radius need a time: that of the strong point-source shock
    air = path.air_density, path.sedov_gamma
    energy = np.asarray(sedov_taylor_energy(path.slant_range, 1.0, *air))
    time = np.sqrt(energy / (TNT_SPECIFIC_ENERGY * MASS))
    path = dataclasses.replace(path, time_since_detonation=time)
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
    for row, mode in enumerate(modes):
        share = 100.0 * mode.boundary / mode.cases
        axes.barh(row, share, 0.36, color=COLOURS[mode.response], alpha=0.8)
        words = f"{mode.method}: {mode.failure}; jblast {mode.response}"
        # the name stands above its bar, where long ones have the whole width
        for x, y, text in (
            (0.0, row - 0.36, words),
            (share + 1.0, row, boundary_words(mode)),
        ):
            axes.text(x, y, text, va="center", fontsize=8.5, color=INK)
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
        module, function = AREAS[area]
        modes[area] = getattr(importlib.import_module(module), function)()
        modes = {name: modes[name] for name in AREAS if name in modes}
        rows = [mode for found in modes.values() for mode in found]
        write_text(KEPT, table_text([Mode._fields, *rows]))
    write_text(KEPT.with_suffix(".md"), page(modes))
    write_figure(figure_of(modes), KEPT.with_suffix(".png"))


if __name__ == "__main__":
    main()
