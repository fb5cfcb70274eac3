"""Failure modes of laws, clocks and derivatives.

The printed polynomials of Kingery and Bulmash fail at their joins and beyond their
table. Laws of a point source fail at weak shocks and for a charge of TNT. Derivatives
fail at the arrival of a sharp front and at distance zero. Clocks fail where the
resolution of float32 or float64 exceeds the error of a recorder.
"""

import math
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jblast.constants import (
    STANDARD_PRESSURE,
    STANDARD_SOUND_SPEED,
    TNT_SPECIFIC_ENERGY,
)
from jblast.errors import InputError
from jblast.inference.fitting.warnings import POINT_SOURCES, charge_is_no_point
from jblast.observations import Observations, observed, resolve_positions
from jblast.observations.clocks import refuse_unresolved
from jblast.registry import LAWS, call
from jblast.scene import Charge, Scene
from jblast.scene.charge import Burst
from jblast.sensors.calculator import calculated_laws, scene_path, with_rows
from jblast.verification.stability.failure import (
    FailureMode,
    crossing,
    switching_point,
    verified,
)
from jblast.waves import (
    kingery_bulmash_arrival_time,
    kingery_bulmash_duration,
    kingery_bulmash_pressure,
    kinney_graham_duration,
    modified_friedlander_pressure,
    point_source_arrival_time,
    point_source_pressure,
    sedov_taylor_energy,
    sedov_taylor_shock_pressure,
    sedov_taylor_shock_radius,
    shock_kinematics_arrival_time,
    shock_kinematics_pressure,
    slant_range,
    wu_hao_air_arrival_time,
)
from jblast.waves.curves import BLEND_WIDTH, LogCurve, Segment
from jblast.waves.laws.kingery_bulmash import kingery_bulmash_curve
from jblast.waves.laws.kinney_graham import kinney_graham_duration_valid
from jblast.waves.laws.wu_hao import wu_hao_air_valid

# A pulse of some kg of TNT at a few tens of metres; the peak is 1, units scale out.
DURATION, DECAY = 10e-3, 1.5
"""Positive phase [s] and decay coefficient [-] of the test pulse."""
SIGMA = 1e-3
"""Standard error of the arrivals of a plain recorder [s]."""
FINE_SIGMA = 1e-6
"""Standard error of the arrivals of the best recorder, a sample at 1 MHz [s]."""
# Clocks that count from a start-up, from an hour ago and from 1970: float32 resolves 4
# us, 0.2 ms and 128 s.
TIMES = {"60 s": 60.0, "1 h": 3600.0, "Unix time": 1.7e9}
MASS = 15.0
"""Charge of the examples [kg]: that of the thesis."""
# The impulse follows the duration: a duration 30 % short is an impulse 30 % low.
DURATION_ERROR = 0.3
"""Largest accepted relative error of a duration [-]."""
THESIS_FREQUENCY = 500.0 / (2.0 * math.pi)
"""Frequency of the blast in the thesis [Hz]: 500 rad/s."""
# The standard atmosphere at sea level, half saturated.
AIR = {"temperature": 288.15, "pressure": 101325.0, "relative_humidity": 0.5}
GAMMA = 1.4
"""Ratio of specific heats of cold air [-]."""
DENSITY = 1.225
"""Density of standard air [kg/m3]."""
# The pressure of a strong shock goes as the mass: 10 % in one is 10 % in the other.
PRESSURE_ERROR = 0.1
"""Largest accepted relative error of a pressure [-]."""
# Energies of sources are stated in MJ.
MEGAJOULE = 1e6
CURVES = {
    "peak_overpressure_pa": "incident_pressure",
    "positive_impulse_pa_s": "incident_impulse",
    "positive_duration_s": "positive_phase_duration",
    "air_arrival_s": "arrival_time",
}
"""Curve of the Kingery-Bulmash table by its quantity."""
# The table covers about 0.07 to 40 m/kg^(1/3).
INNER_Z, OUTER_Z, LAST_Z = 0.01, 100.0, 1e3
"""Scaled distances of the tests beyond the table [m/kg^(1/3)]."""


def gradient_failures() -> list[FailureMode]:
    """Measure every failure mode of a derivative."""
    return [_front(), _distance(), _laws_at_zero()]


def pulse(time: Float[Array, "..."]) -> Float[Array, "..."]:
    """Return the sharp pulse with unit peak."""
    return modified_friedlander_pressure(time, 1.0, DURATION, DECAY)


def _front() -> FailureMode:
    before, at, after = (float(jax.grad(pulse)(t)) for t in (-1e-9, 0.0, 1e-9))
    step = 1e-6
    secant = float(pulse(jnp.asarray(step)) - pulse(jnp.asarray(-step))) / (2 * step)
    inside = before == 0.0 and np.isclose(at, after, rtol=1e-5)
    return FailureMode(
        area="gradients",
        method="sharp front, slope in time",
        failure="no derivative at the arrival",
        boundary=0.0,
        unit="s after arrival",
        beyond=f"{before:g} Ps/s before, {at:.0f} at it and after; differences over "
        f"{2e6 * step:g} us: {secant:+.0f}",
        response=verified("holds", bool(inside), "slope at the arrival"),
        message="pressure and slope at the arrival are those behind the front, finite",
    )


def _distance() -> FailureMode:
    origin = jnp.zeros(3)
    naive = jax.grad(jnp.linalg.norm)(origin)
    ours = jax.grad(slant_range)(origin, jnp.zeros(3))
    defined = bool(jnp.isnan(naive).all()) and bool((ours == 0.0).all())
    return FailureMode(
        area="gradients",
        method="slant range, slope in place",
        failure="no direction at distance 0",
        boundary=0.0,
        unit="m",
        beyond="the slope of the root of the sum of squares is NaN, and so is every "
        "slope that contains it",
        response=verified("holds", defined, "slant range at 0"),
        message="slant_range gives 0",
    )


def _laws_at_zero() -> FailureMode:
    bad = laws_without_slope()
    refused = 0
    peak = ["a"], ["peak_overpressure_pa"], [1e4], [1e3]
    log = observed(*peak, position=np.zeros((1, 3)))
    pressure = LAWS["peak_overpressure_pa", "kingery_bulmash"].function
    for refuse in (lambda: pressure(0.0, 1.0), lambda: resolve_positions(log, Scene())):
        try:
            refuse()
        except (InputError, ValueError):
            refused += 1
    return FailureMode(
        area="gradients",
        method="laws of the slant range",
        failure="no blast at distance 0",
        boundary=0.0,
        unit="m",
        beyond=f"inside jit {len(bad)} of {len(_laws_of_range())} laws have no finite "
        "value with a finite slope there",
        response=verified("refuses", refused == 2, "distance 0"),
        message="outside jit a law raises; fit, bound and simulate refuse a sensor at "
        "the position of the charge",
    )


def laws_without_slope() -> list[str]:
    """Return the laws whose value or slope inside jit is not finite at distance 0."""
    path = scene_path(Scene(charge=Charge(mass_kg=1.0)))

    def values(distance):
        row = with_rows(path, distance[None], jnp.ones(1))
        return jnp.stack([jnp.sum(call(law.function, row)) for law in _laws_of_range()])

    # jvp gives value and slope in one pass, for all laws in one program
    zero = jnp.zeros(())
    both = jax.jit(lambda x: jax.jvp(values, (x,), (jnp.ones(()),)))(zero)
    finite = np.isfinite(both).all(axis=0)
    return [
        f"{law.quantity} by {law.name}"
        for law, good in zip(_laws_of_range(), finite, strict=True)
        if not good
    ]


def _laws_of_range():
    return [law for law in calculated_laws() if "slant_range" in law.arguments()]


def clock_failures() -> list[FailureMode]:
    """Measure the failure modes of clocks in single and in double precision."""
    return [
        _clock_failure(np.float32, SIGMA, "float32"),
        _clock_failure(np.float64, FINE_SIGMA, "float64"),
    ]


def coarse_from(dtype: type[np.floating[Any]], sigma: float) -> float:
    """Return the time from which the spacing of numbers exceeds sigma [s].

    Args:
        dtype: Type of the numbers.
        sigma: Standard error of a time [s].

    Returns:
        A power of two [s].
    """
    # the spacing doubles at powers of two, so no other times need a test
    exponent = 0
    while float(np.spacing(dtype(2.0**exponent))) <= sigma:
        exponent += 1
    return 2.0**exponent


def _clock_failure(
    dtype: type[np.floating[Any]], sigma: float, name: str
) -> FailureMode:
    boundary = coarse_from(dtype, sigma)
    spacings = ", ".join(
        f"{float(np.spacing(dtype(time))):.3g} s at {words}"
        for words, time in TIMES.items()
    )
    start, travel = TIMES["Unix time"], 0.1234567
    arrival = float(dtype(start + travel)) - start

    def is_refused(time: float) -> bool:
        try:
            refuse_unresolved(arrival_at(time, sigma), dtype)
        except InputError:
            return True
        return False

    before = is_refused(math.nextafter(boundary, 0.0) / 1.01)
    after = is_refused(boundary)
    return FailureMode(
        area="clocks",
        method=f"clock times in {name}",
        failure=f"steps of the clock exceed sigma = {sigma:g} s",
        boundary=boundary,
        unit="s on the clock",
        beyond=f"steps of {spacings}; a travel time of {travel:.4f} s at Unix time is "
        f"read as {arrival:.4f} s",
        response=verified("refuses", after and not before, f"clock times in {name}"),
        message="fit and batch_of refuse such a row; every command runs in float64",
    )


def arrival_at(time: float, sigma: float) -> Observations:
    """Return a log of one arrival with its standard error [s]."""
    return observed(
        ["a"],
        ["air_arrival_s"],
        [time],
        [sigma],
        position=np.array([[30.0, 0.0, 0.0]]),
        source="one arrival",
    )


def law_failures() -> list[FailureMode]:
    """Measure every failure mode of a law."""
    return [
        *wu_hao_failures(),
        *kingery_bulmash_failures(),
        *kinney_graham_failures(),
        *point_source_failures(),
    ]


def wu_hao_failures() -> list[FailureMode]:
    """Find the ranges at which the air shock of Wu and Hao is slower than sound.

    The first mode compares the average speed, the second the local one. The boundaries
    are those of 1 kg; they grow as the root of the mass.
    """

    def mean_lead(distance, mass=1.0):
        time = wu_hao_air_arrival_time(distance, mass, STANDARD_SOUND_SPEED)
        return float(distance / time) / STANDARD_SOUND_SPEED - 1.0

    def local_lead(distance, mass=1.0):
        slowness = jax.grad(wu_hao_air_arrival_time)(
            distance, mass, STANDARD_SOUND_SPEED
        )
        return 1.0 / float(slowness) / STANDARD_SOUND_SPEED - 1.0

    mean, local = (crossing(lead, 1.0, 100.0) for lead in (mean_lead, local_lead))
    marked = switching_point(lambda r: bool(wu_hao_air_valid(r, 1.0)), 1.0, 100.0)
    between = np.geomspace(local, mean, 50) * math.sqrt(MASS)
    ratio = wu_hao_air_arrival_time(
        between, MASS, STANDARD_SOUND_SPEED
    ) / shock_kinematics_arrival_time(between, MASS)
    speeds = [name for quantity, name in LAWS if quantity == "shock_speed_m_s"]
    avoided = bool(speeds) and "wu_hao" not in speeds
    method = "air_arrival_s by wu_hao"
    return [
        FailureMode(
            area="laws",
            method=method,
            failure="slower than sound on average",
            boundary=mean,
            unit="m/kg^(1/2)",
            beyond=f"{mean * math.sqrt(MASS):.1f} m for {MASS:g} kg; at twice that "
            f"{-100 * mean_lead(2 * mean):.0f} % slower than sound",
            response=verified(
                "marks", math.isclose(marked, mean, rel_tol=1e-6), method
            ),
            message="law_valid false beyond",
        ),
        FailureMode(
            area="laws",
            method=method,
            failure="front locally slower than sound",
            boundary=local,
            unit="m/kg^(1/2)",
            beyond=f"{local * math.sqrt(MASS):.1f} m for {MASS:g} kg; "
            f"{-100 * local_lead(mean):.0f} % slower at the first boundary; the "
            f"arrival up to there differs by {100 * (float(ratio.min()) - 1):+.0f} to "
            f"{100 * (float(ratio.max()) - 1):+.0f} % from shock_kinematics",
            response=verified("holds", avoided, method),
            message=f"wu_hao gives no shock speed: use {', '.join(speeds)}",
        ),
    ]


def kinney_graham_failures() -> list[FailureMode]:
    """Find the range in which the duration of Kinney-Graham is that of Kingery-Bulmash.

    "That of" means `DURATION_ERROR`, in free air.
    """

    def ratio(z):
        reference = kingery_bulmash_duration(z, 1.0, burst="free-air")
        return float(kinney_graham_duration(z, 1.0) / reference)

    def too_short(z):
        return ratio(z) - (1.0 - DURATION_ERROR)

    grid = np.geomspace(0.15, 40.0, 200)
    ratios = [ratio(z) for z in grid]
    nearest, worst = grid[np.argmax(ratios)], grid[np.argmin(ratios)]
    near = crossing(too_short, 1.5, nearest)
    far = crossing(too_short, nearest, 40.0)
    method = "positive_duration_s by kinney_graham"
    registered = LAWS["positive_duration_s", "kinney_graham"]
    marked = not any(
        bool(kinney_graham_duration_valid(z, 1.0)) for z in (0.99 * near, 1.01 * far)
    )
    holds = bool(kinney_graham_duration_valid(nearest, 1.0))
    of = "of kingery_bulmash"
    return [
        FailureMode(
            area="laws",
            method=method,
            failure="too short near the charge",
            boundary=near,
            unit="m/kg^(1/3)",
            beyond=f"{100 * ratio(worst):.0f} % {of} at Z = {worst:.2g}, "
            f"{100 * ratio(2.0):.0f} % at 2; {100 * ratio(nearest):.0f} % at best "
            f"(Z = {nearest:.0f})",
            response=verified("marks", marked and holds, method),
            message=f"law_valid false: {registered.range}",
        ),
        FailureMode(
            area="laws",
            method=method,
            failure="too short far out",
            boundary=far,
            unit="m/kg^(1/3)",
            beyond=f"{100 * ratio(40.0):.0f} % {of} at Z = 40",
            response=verified("marks", marked and holds, method),
            message="law_valid false",
        ),
    ]


def point_source_failures() -> list[FailureMode]:
    """Measure the failure modes of point sources, for 1 kg; the laws scale."""
    return [_weak_shock(), _radius_of_tnt(), _pressure_of_tnt()]


def _weak_shock() -> FailureMode:
    """Find the range at which the pressure of Sedov and Taylor is too low."""

    def error(z):
        exact = float(point_source_pressure(z, 1.0)) + STANDARD_PRESSURE
        return float(sedov_taylor_shock_pressure(z, 1.0, GAMMA)) / exact - 1.0

    z = crossing(lambda z: error(z) + PRESSURE_ERROR, 0.4, 1.0)
    strength = float(point_source_pressure(z, 1.0)) / STANDARD_PRESSURE
    marked = switching_point(_sedov_valid, 0.4, 1.0)
    time = float(point_source_arrival_time(marked, 1.0))
    radius = float(sedov_taylor_shock_radius(time, 1.0, DENSITY, GAMMA))
    method = "shock_radius_m by sedov_taylor"
    return FailureMode(
        area="laws",
        method=method,
        failure="the shock is no longer strong",
        boundary=z,
        unit="m/kg^(1/3)",
        beyond=f"pressure {100 * PRESSURE_ERROR:g} % too low at {strength:.0f} ambient "
        f"pressures, {-100 * error(1.0):.0f} % at Z = 1",
        response=verified("marks", marked < z, method),
        message=f"law_valid false from Z = {marked:.2f} on; there the pressure is "
        f"{100 * error(marked):+.0f} % off, the radius "
        f"{100 * (radius / marked - 1):+.1f} %",
    )


def _sedov_valid(z: float) -> bool:
    """Return True if the law is valid when its own shock reaches the radius."""
    energy_of_one = float(sedov_taylor_energy(z, 1.0, DENSITY, GAMMA))
    time = math.sqrt(energy_of_one / TNT_SPECIFIC_ENERGY)
    law = LAWS["shock_radius_m", "sedov_taylor"]
    return bool(law.valid(time, 1.0, DENSITY, GAMMA, STANDARD_PRESSURE))


def _radius_of_tnt() -> FailureMode:
    """Compute the energy of TNT from radius and time by the law of a point source."""

    def share(z):
        time = kingery_bulmash_arrival_time(z, 1.0, burst="free-air")
        energy = sedov_taylor_energy(z, time, DENSITY, GAMMA)
        return float(energy) / TNT_SPECIFIC_ENERGY

    end = switching_point(_sedov_valid, 0.4, 1.0)
    method = "shock_radius_m by sedov_taylor"
    return FailureMode(
        area="laws",
        method=method,
        failure="a charge of TNT is no point",
        boundary=end,
        unit="m/kg^(1/3)",
        beyond="wherever its shock is strong: radius and time give "
        f"{100 * share(0.2):.0f} % of the energy at Z = 0.2, {100 * share(0.4):.0f} % "
        f"at 0.4, {100 * share(end):.0f} % at {end:.2f}",
        response=verified("marks", _is_reported("sedov_taylor"), method),
        message='a warning, unless explosive = "nuclear"',
    )


def energy_error(z: float) -> float:
    """Return the relative error of 4.184 MJ/kg as the energy of a point source.

    The true energy is that of the point source with the peak overpressure of TNT.

    Args:
        z: Scaled distance in free air [m/kg^(1/3)].
    """
    peak = float(kingery_bulmash_pressure(z, 1.0, burst="free-air"))
    mass = crossing(lambda m: float(point_source_pressure(z, m)) - peak, 1e-3, 1e3)
    return 1.0 / mass - 1.0


def _pressure_of_tnt() -> FailureMode:
    """Find the range at which a point source with the energy of TNT is too weak."""
    # 4.184 MJ/kg is the right energy at one range only; farther out it is too little
    boundary = crossing(lambda z: energy_error(z) + 0.3, 2.5, 5.0)
    inside = np.geomspace(0.3, boundary, 40)
    errors = np.array([energy_error(z) for z in inside])
    method = "peak_overpressure_pa by point_source"
    return FailureMode(
        area="laws",
        method=method,
        failure="a charge of TNT is no point",
        boundary=boundary,
        unit="m/kg^(1/3)",
        beyond=f"inside, {TNT_SPECIFIC_ENERGY / MEGAJOULE:.3f} MJ/kg differs by "
        f"{100 * errors.min():+.0f} to {100 * errors.max():+.0f} % from the energy "
        f"with the peak of kingery_bulmash; {100 * energy_error(10.0):+.0f} % at "
        "Z = 10",
        response=verified("marks", _is_reported("point_source"), method),
        message='a warning, unless explosive = "nuclear"',
    )


def _is_reported(law: str) -> bool:
    findings = charge_is_no_point([law], Charge(mass_kg=1.0))
    nuclear = charge_is_no_point([law], Charge(mass_kg=1.0, explosive="nuclear"))
    return law in POINT_SOURCES and bool(findings) and not nuclear


def kingery_bulmash_failures() -> list[FailureMode]:
    """Measure the joins of both bursts, and the table limits of the surface burst."""
    bursts: tuple[Burst, ...] = ("surface", "free-air")
    joins = []
    for quantity in CURVES:
        for burst in bursts:
            curve = kingery_bulmash_curve(CURVES[quantity], burst)
            method = f"{quantity} by kingery_bulmash"
            joins += [
                _join(method, burst, curve, before, after)
                for before, after in zip(
                    curve.segments, curve.segments[1:], strict=False
                )
            ]
    return [*joins, *(mode for quantity in CURVES for mode in _table_limits(quantity))]


def printed_value(curve: LogCurve, z: float) -> float:
    """Return the value of the printed polynomials, extrapolated beyond the table.

    A join belongs to the later polynomial.
    """
    segment = curve.segments[0]
    for later in curve.segments[1:]:
        if z >= later.z_min:
            segment = later
    with np.errstate(over="ignore"):
        return float(np.exp(segment.log_value(np.float64(math.log(z)))))


def blended_value(curve: LogCurve, z: float) -> float:
    """Return the value of the curve as jblast evaluates it."""
    return float(jnp.exp(curve.log_value(jnp.asarray(math.log(z)))))


def _join(method, burst, curve, before: Segment, after: Segment) -> FailureMode:
    join = after.z_min
    at = math.log(join)
    jump = math.expm1(after.log_value(at) - before.log_value(at))
    half = math.sqrt(1.0 + BLEND_WIDTH)
    around = np.geomspace(join / half**2, join * half**2, 2001)
    blended = np.array(curve.log_value(jnp.log(around)))
    printed = np.log([printed_value(curve, z) for z in around])
    difference = np.expm1(np.abs(blended - printed)).max()
    step = np.abs(np.diff(blended)).max()
    # on a grid of 2,001 points no step may be near the jump, and the blend must end
    smooth = step < 0.2 * abs(jump) and abs(blended[0] - printed[0]) < 1e-12
    return FailureMode(
        area="laws",
        method=method,
        failure=f"printed curve jumps ({burst})",
        boundary=join,
        unit="m/kg^(1/3)",
        beyond=f"value by {100 * jump:+.2f} %, slope d ln y/d ln Z from "
        f"{before.log_slope(at):.2f} to {after.log_slope(at):.2f}",
        response=verified("holds", bool(smooth), f"{method}, Z = {join:g}"),
        message=f"blended over {100 * BLEND_WIDTH:g} % in Z: no jump, at most "
        f"{100 * difference:.2f} % from the printed curve",
    )


def _table_limits(quantity: str) -> list[FailureMode]:
    law = LAWS[quantity, "kingery_bulmash"]
    curve = kingery_bulmash_curve(CURVES[quantity], "surface")
    method = f"{quantity} by kingery_bulmash"

    def valid(z):
        return bool(law.valid(z, 1.0))

    near = switching_point(valid, INNER_Z, 1.0)
    far = switching_point(valid, 1.0, LAST_Z)
    high = law.function(jnp.asarray([OUTER_Z, LAST_Z]), 1.0)
    positive = bool(jnp.all(jnp.isfinite(high) & (high > 0)))
    message = "power law with the end slope, law_valid false"
    if quantity == "peak_overpressure_pa":
        weak = float(shock_kinematics_pressure(LAST_Z, 1.0))
        message += (
            f": {float(high[1]):.3g} Pa at Z = {LAST_Z:g}, where shock_kinematics "
            f"has {weak:.3g}"
        )

    def ratio_at(z):
        ratio = printed_value(curve, z) / blended_value(curve, z)
        return f"{'overflows' if math.isinf(ratio) else f'{ratio:.3g}'} at Z = {z:g}"

    return [
        FailureMode(
            area="laws",
            method=method,
            failure="table ends near the charge",
            boundary=near,
            unit="m/kg^(1/3)",
            beyond=f"polynomial over power law: {ratio_at(INNER_Z)}",
            response=verified("marks", _is_power_law(law, near), method),
            message="power law with the end slope, law_valid false",
        ),
        FailureMode(
            area="laws",
            method=method,
            failure="table ends far out",
            boundary=far,
            unit="m/kg^(1/3)",
            beyond=f"polynomial over power law: {ratio_at(OUTER_Z)}, "
            f"{ratio_at(LAST_Z)}",
            response=verified("marks", positive and _is_power_law(law, far), method),
            message=message,
        ),
    ]


def _is_power_law(law, end: float) -> bool:
    """Return True if a law beyond its table has one slope and is marked invalid.

    Args:
        law: The law.
        end: Limit of the table [m/kg^(1/3)].
    """
    # three points outside the table: two equal slopes in ln make a power law
    factor = 2.0 if end > 1.0 else 0.5
    z = end * np.array([1.001 if factor > 1.0 else 0.999, factor, factor**2])
    value = np.log(np.asarray(law.function(z, 1.0)))
    slopes = np.diff(value) / np.diff(np.log(z))
    straight = math.isclose(slopes[0], slopes[1], rel_tol=1e-6)
    return straight and not np.any(law.valid(z, 1.0))
