"""Failure modes of laws, clocks and derivatives.

Laws of arrival, duration and absorption are measured by themselves. The printed
polynomials of Kingery and Bulmash fail at their joins, at their ends and beyond; laws
of a point source fail at weak shocks and for a charge of TNT. Derivatives fail at the
arrival of a sharp front and at distance zero, clocks where the resolution of float32 or
float64 exceeds the error of a recorder.
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
    finite_rise_pressure,
    iso_9613_absorption,
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
    stokes_absorption,
    transmission_loss,
    wu_hao_air_arrival_time,
)
from jblast.waves.curves import BLEND_WIDTH, LogCurve, Segment
from jblast.waves.laws.kingery_bulmash import kingery_bulmash_curve
from jblast.waves.laws.kinney_graham import kinney_graham_duration_valid
from jblast.waves.laws.wu_hao import wu_hao_air_valid
from jblast.waves.propagation import DECIBELS_PER_NEPER

DURATION, DECAY = 10e-3, 1.5
"""Of the pulse [s], [-]; its peak is 1."""
RATE = 1e5
"""Samples a second of its record [Hz]."""
MISPLACED = 1.3335e-3
"""By how much the arrival is taken too late [s]; it lies between two samples."""
MOST_SAMPLES = 20
"""In the longest rise that is tried."""
UNFELT = 0.05
"""A slope off by more than this is called wrong [-]."""
SIGMA = 1e-3
"""Of a recorder's arrivals [s]."""
FINE = 1e-6
"""Of the best recorder's [s]."""
# Clocks that count from a start-up, from an hour ago and from 1970: float32 resolves 4
# us, 0.2 ms and 128 s.
TIMES = {"60 s": 60.0, "1 h": 3600.0, "Unix time": 1.7e9}
MASS = 15.0
"""Charge of the examples [kg]: the thesis' own."""
SHORT = 0.3
"""A duration off by more than this is called wrong [-]."""
THESIS_FREQUENCY = 500.0 / (2.0 * math.pi)
"""Frequency of the thesis' blast [Hz]: 500 rad/s."""
# The standard atmosphere at sea level, half saturated.
AIR = {"temperature": 288.15, "pressure": 101325.0, "relative_humidity": 0.5}
GAMMA = 1.4
DENSITY = 1.225
"""Of standard air [kg/m3]."""
OFF = 0.1
"""A pressure off by more than this is called wrong [-]."""
# Energies of sources are stated in MJ.
MEGAJOULE = 1e6
CURVES = {
    "peak_overpressure_pa": "incident_pressure",
    "positive_impulse_pa_s": "incident_impulse",
    "positive_duration_s": "positive_phase_duration",
    "air_arrival_s": "arrival_time",
}
"""Curve of the table by the quantity it gives."""
NEAR, FAR, FARTHEST = 0.01, 100.0, 1e3
"""Scaled distances beyond the ends at which it is looked [m/kg^(1/3)]."""


def gradient_failures() -> list[FailureMode]:
    """Measure every failure mode of a derivative."""
    return [_front(), _misfit(), _distance(), _laws_at_zero()]


def pulse(
    time: Float[Array, "..."], rise_time: Float[Array, ""] | None = None
) -> Float[Array, "..."]:
    """Return the pulse, sharp or with a rise [s]."""
    if rise_time is None:
        return modified_friedlander_pressure(time, 1.0, DURATION, DECAY)
    return finite_rise_pressure(time, 1.0, DURATION, DECAY, rise_time)


@jax.jit
def misfit_slopes(
    rise_time: Float[Array, ""] | None = None,
) -> tuple[Float[Array, ""], Float[Array, ""]]:
    """Return d(misfit)/d(arrival) by JAX and by differences over many samples [1/s].

    The misfit is the mean square over a record whose true arrival is `MISPLACED`
    earlier.
    """
    time = jnp.arange(0.0, 0.05, 1.0 / RATE)
    record = pulse(time - 0.02, rise_time)

    def misfit(arrival):
        return jnp.mean((pulse(time - arrival, rise_time) - record) ** 2)

    arrival, step = 0.02 + MISPLACED, 20.0 / RATE
    difference = (misfit(arrival + step) - misfit(arrival - step)) / (2.0 * step)
    return jax.grad(misfit)(arrival), difference


def slope_felt(samples: int) -> float:
    """Return how much of the misfit's slope JAX sees [-].

    Args:
        samples: Of the record in the rise of the front; 0 for a sharp one.
    """
    felt, true = misfit_slopes(jnp.asarray(samples / RATE) if samples else None)
    return float(felt / true)


def _front() -> FailureMode:
    slope = jax.grad(lambda t: pulse(t))
    before, at, after = (float(slope(t)) for t in (-1e-9, 0.0, 1e-9))
    rise = jnp.asarray(1e-4)
    soft = [float(jax.grad(lambda t: pulse(t, rise))(t)) for t in (-1e-9, 0.0)]
    step = 1e-6
    secant = float(pulse(jnp.asarray(step)) - pulse(jnp.asarray(-step))) / (2 * step)
    inside = before == 0.0 and np.isclose(at, after, rtol=1e-5) and soft == [0.0, 0.0]
    return FailureMode(
        area="gradients",
        method="sharp front, slope in time",
        failure="no derivative at the arrival",
        boundary=0.0,
        unit="s after arrival",
        beyond=f"{before:g} Ps/s before, {at:.0f} at it and after; differences over "
        f"{2e6 * step:g} us: {secant:+.0f}",
        response=verified("holds", bool(inside), "slope at the arrival"),
        message="pressure and slope at the arrival are those behind the front, finite; "
        "finite_rise_pressure has one slope from both sides",
    )


def _misfit() -> FailureMode:
    sharp, soft = slope_felt(0), slope_felt(MOST_SAMPLES)
    samples = np.arange(1, MOST_SAMPLES + 1)
    off = np.array([abs(slope_felt(int(n)) - 1.0) for n in samples])
    return FailureMode(
        area="gradients",
        method="sharp front, misfit of a record",
        failure="moving the arrival over a sample is not felt",
        boundary=float(samples[off > UNFELT].max()),
        unit="samples of rise and fewer",
        beyond=f"sharp: d(misfit)/d(arrival) is {100 * sharp:.0f} % of what it is",
        response=verified("holds", abs(soft - 1.0) < UNFELT, "misfit of a record"),
        message=f"finite_rise_pressure: {100 * soft:.0f} % with {MOST_SAMPLES} samples "
        "in the rise",
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
        beyond="the root of the sum of squares has NaN for slope, and so all it enters",
        response=verified("holds", defined, "slant range at 0"),
        message="slant_range gives 0",
    )


def _laws_at_zero() -> FailureMode:
    bad = laws_without_slope()
    refused = 0
    at_zero = np.zeros((1, 3))
    peak = ["a"], ["peak_overpressure_pa"], [1e4], [1e3]
    log = observed(*peak, position=at_zero)
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
        message="outside jit a law raises; fit, bound and simulate refuse a sensor "
        "that stands on the charge",
    )


def laws_without_slope() -> list[str]:
    """Name the laws whose value or slope inside jit is not finite at distance 0."""
    path = scene_path(Scene(charge=Charge(mass_kg=1.0)))

    def values(distance):
        way = with_rows(path, distance[None], jnp.ones(1))
        return jnp.stack([jnp.sum(call(law.function, way)) for law in _laws_of_range()])

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
    """Measure them for single and for double precision."""
    return [
        _failure(np.float32, SIGMA, "float32"),
        _failure(np.float64, FINE, "float64"),
    ]


def coarse_from(dtype: type[np.floating[Any]], sigma: float) -> float:
    """Return the time from which neighbouring numbers are further apart than sigma.

    Args:
        dtype: Of the numbers.
        sigma: [s].

    Returns:
        A power of two [s].
    """
    exponent = 0
    while float(np.spacing(dtype(2.0**exponent))) <= sigma:
        exponent += 1
    return 2.0**exponent


def _failure(dtype: type[np.floating[Any]], sigma: float, name: str) -> FailureMode:
    boundary = coarse_from(dtype, sigma)
    spacings = ", ".join(
        f"{float(np.spacing(dtype(time))):.3g} s at {words}"
        for words, time in TIMES.items()
    )
    # on a clock that runs since 1970
    start, way = TIMES["Unix time"], 0.1234567
    arrival = float(dtype(start + way)) - start
    before = _is_refused(math.nextafter(boundary, 0.0) / 1.01, sigma, dtype)
    after = _is_refused(boundary, sigma, dtype)
    return FailureMode(
        area="clocks",
        method=f"clock times in {name}",
        failure=f"steps of the clock exceed sigma = {sigma:g} s",
        boundary=boundary,
        unit="s on the clock",
        beyond=f"steps of {spacings}; a way of {way:.4f} s at Unix time is read as "
        f"{arrival:.4f} s",
        response=verified("refuses", after and not before, f"clock times in {name}"),
        message="fit and batch_of refuse such a row; every command runs in float64",
    )


def _is_refused(time: float, sigma: float, dtype: type[np.floating[Any]]) -> bool:
    log = arrival_at(time, sigma)
    try:
        refuse_unresolved(log, dtype)
    except InputError:
        return True
    return False


def arrival_at(time: float, sigma: float) -> Observations:
    """Return a log of one arrival [s]."""
    place = np.array([[30.0, 0.0, 0.0]])
    fields = {"position": place, "source": "one arrival"}
    return observed(["a"], ["air_arrival_s"], [time], [sigma], **fields)


def law_failures() -> list[FailureMode]:
    """Measure every failure mode of a law."""
    return [
        *wu_hao_failures(),
        *kingery_bulmash_failures(),
        *kinney_graham_failures(),
        *point_source_failures(),
        *stokes_failures(),
    ]


def wu_hao_failures() -> list[FailureMode]:
    """Find where Wu's and Hao's air shock falls behind sound, on average and locally.

    Boundaries are of a charge of 1 kg; they grow as the root of the mass.
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
    off = wu_hao_air_arrival_time(
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
            message="law_valid false from there on",
        ),
        FailureMode(
            area="laws",
            method=method,
            failure="front slower than sound where it is",
            boundary=local,
            unit="m/kg^(1/2)",
            beyond=f"{local * math.sqrt(MASS):.1f} m for {MASS:g} kg; "
            f"{-100 * local_lead(mean):.0f} % slower where the average falls behind; "
            f"the arrival up to then {100 * (float(off.min()) - 1):+.0f} to "
            f"{100 * (float(off.max()) - 1):+.0f} % off shock_kinematics",
            response=verified("holds", avoided, method),
            message=f"no shock speed by it: {', '.join(speeds)} give one",
        ),
    ]


def kinney_graham_failures() -> list[FailureMode]:
    """Find where Kinney's and Graham's duration leaves Kingery's and Bulmash's."""

    def ratio(z):
        there = kingery_bulmash_duration(z, 1.0, burst="free-air")
        return float(kinney_graham_duration(z, 1.0) / there)

    def too_short(z):
        return ratio(z) - (1.0 - SHORT)

    places = np.geomspace(0.15, 40.0, 200)
    nearest = places[np.argmax([ratio(z) for z in places])]
    worst = places[np.argmin([ratio(z) for z in places])]
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


def stokes_failures() -> list[FailureMode]:
    """Find where Stokes' absorption alone leaves what sound really loses."""

    def stokes(distance, frequency=THESIS_FREQUENCY):
        alpha = stokes_absorption(
            frequency, DENSITY, STANDARD_SOUND_SPEED, AIR["temperature"]
        )
        return DECIBELS_PER_NEPER * float(alpha) * (distance - 1.0)

    def whole(distance):
        loss = transmission_loss(
            THESIS_FREQUENCY, distance, 1.0, **AIR, burst="free-air"
        )
        return float(loss)

    def too_small(frequency):
        alpha = stokes_absorption(
            frequency, DENSITY, STANDARD_SOUND_SPEED, AIR["temperature"]
        )
        return float(iso_9613_absorption(frequency, **AIR) / alpha)

    distance = crossing(lambda r: whole(r) - stokes(r) - 3.0, 1.0, 10.0)
    ten = crossing(lambda f: too_small(f) - 10.0, 100.0, 1e5)
    method = "stokes_absorption"
    return [
        FailureMode(
            area="laws",
            method=method,
            failure="no spreading: as loud far as near",
            boundary=distance,
            unit="times the range where it was heard",
            beyond=f"3 dB too loud there; at 1 km it takes {stokes(1e3):.4f} dB "
            f"({THESIS_FREQUENCY:.0f} Hz), nature {whole(1e3):.0f} dB",
            response=verified("holds", whole(1e3) > 59.0 + stokes(1e3), method),
            message="transmission_loss spreads, and absorbs by ISO 9613-1",
        ),
        FailureMode(
            area="laws",
            method=method,
            failure="no relaxation: ten times too small",
            boundary=ten,
            unit="Hz and below",
            beyond=f"ISO 9613-1 takes {too_small(THESIS_FREQUENCY):.0f} times as much "
            f"at {THESIS_FREQUENCY:.0f} Hz, {too_small(1e3):.0f} times at 1 kHz",
            response=verified("holds", whole(2e3) - whole(1e3) > 6.02, method),
            message="transmission_loss absorbs by ISO 9613-1",
        ),
    ]


def point_source_failures() -> list[FailureMode]:
    """Measure them; a mass of 1 kg stands for all, by scaling."""
    return [_weak_shock(), _radius_of_tnt(), _pressure_of_tnt()]


def _weak_shock() -> FailureMode:
    """Find where Sedov's and Taylor's pressure leaves that of the exact solution."""

    def off(z):
        exact = float(point_source_pressure(z, 1.0)) + STANDARD_PRESSURE
        return float(sedov_taylor_shock_pressure(z, 1.0, GAMMA)) / exact - 1.0

    z = crossing(lambda z: off(z) + OFF, 0.4, 1.0)
    strength = float(point_source_pressure(z, 1.0)) / STANDARD_PRESSURE
    marked = switching_point(_sedov_valid, 0.4, 1.0)
    time = float(point_source_arrival_time(marked, 1.0))
    radius = float(sedov_taylor_shock_radius(time, 1.0, DENSITY, GAMMA))
    method = "shock_radius_m by sedov_taylor"
    return FailureMode(
        area="laws",
        method=method,
        failure="the shock is not strong any more",
        boundary=z,
        unit="m/kg^(1/3)",
        beyond=f"pressure {100 * OFF:g} % too low at {strength:.0f} ambient pressures, "
        f"{-100 * off(1.0):.0f} % at Z = 1",
        response=verified("marks", marked < z, method),
        message=f"law_valid false from Z = {marked:.2f} on; there the pressure is "
        f"{100 * off(marked):+.0f} % off, the radius "
        f"{100 * (radius / marked - 1):+.1f} %",
    )


def _sedov_valid(z: float) -> bool:
    """Return whether the law holds when its own shock has come that far."""
    energy_of_one = float(sedov_taylor_energy(z, 1.0, DENSITY, GAMMA))
    time = math.sqrt(energy_of_one / TNT_SPECIFIC_ENERGY)
    law = LAWS["shock_radius_m", "sedov_taylor"]
    return bool(law.valid(time, 1.0, DENSITY, GAMMA, STANDARD_PRESSURE))


def _radius_of_tnt() -> FailureMode:
    """Read the energy of TNT from radius and time, by the law of a point source."""

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
        beyond="wherever its shock is strong: of the energy radius and time give "
        f"{100 * share(0.2):.0f} % at Z = 0.2, {100 * share(0.4):.0f} % at 0.4, "
        f"{100 * share(end):.0f} % at {end:.2f}",
        response=verified("marks", _is_told("sedov_taylor"), method),
        message='a warning, unless explosive = "nuclear"',
    )


def energy_error(z: float) -> float:
    """Return by how much 4.184 MJ/kg are off, as a point source that gives TNT's peak.

    Args:
        z: Scaled distance in free air [m/kg^(1/3)].
    """
    peak = float(kingery_bulmash_pressure(z, 1.0, burst="free-air"))
    mass = crossing(lambda m: float(point_source_pressure(z, m)) - peak, 1e-3, 1e3)
    return 1.0 / mass - 1.0


def _pressure_of_tnt() -> FailureMode:
    """Find where a point source of the energy of TNT leaves Kingery and Bulmash."""
    # 4.184 MJ/kg are enough at one place alone; farther out it takes more
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
        beyond=f"inside, {TNT_SPECIFIC_ENERGY / MEGAJOULE:.3f} MJ/kg are "
        f"{100 * errors.min():+.0f} to {100 * errors.max():+.0f} % off the energy that "
        f"makes the peak of kingery_bulmash; {100 * energy_error(10.0):+.0f} % "
        "at Z = 10",
        response=verified("marks", _is_told("point_source"), method),
        message='a warning, unless explosive = "nuclear"',
    )


def _is_told(law: str) -> bool:
    findings = charge_is_no_point([law], Charge(mass_kg=1.0))
    nuclear = charge_is_no_point([law], Charge(mass_kg=1.0, explosive="nuclear"))
    return law in POINT_SOURCES and bool(findings) and not nuclear


def kingery_bulmash_failures() -> list[FailureMode]:
    """Measure the joins of both bursts, and the ends of the surface's curves."""
    bursts: tuple[Burst, ...] = ("surface", "free-air")
    joins = [
        mode
        for quantity in CURVES
        for burst in bursts
        for mode in _joins(quantity, burst)
    ]
    return [*joins, *(mode for quantity in CURVES for mode in _ends(quantity))]


def printed_value(curve: LogCurve, z: float) -> float:
    """Return what the printed polynomials give, beyond the table too.

    On a join it is the later one; past the ends the first and the last.
    """
    segment = curve.segments[0]
    for later in curve.segments[1:]:
        if z >= later.z_min:
            segment = later
    with np.errstate(over="ignore"):
        return float(np.exp(segment.log_value(np.float64(math.log(z)))))


def kept_value(curve: LogCurve, z: float) -> float:
    """Return what jblast makes of the curve."""
    return float(jnp.exp(curve.log_value(jnp.asarray(math.log(z)))))


def _joins(quantity: str, burst: Burst) -> list[FailureMode]:
    curve = kingery_bulmash_curve(CURVES[quantity], burst)
    method = f"{quantity} by kingery_bulmash"
    return [
        _join(method, burst, curve, before, after)
        for before, after in zip(curve.segments, curve.segments[1:], strict=False)
    ]


def _join(method, burst, curve, before: Segment, after: Segment) -> FailureMode:
    join = after.z_min
    at = math.log(join)
    jump = math.expm1(after.log_value(at) - before.log_value(at))
    half = math.sqrt(1.0 + BLEND_WIDTH)
    around = np.geomspace(join / half**2, join * half**2, 2001)
    kept = np.array(curve.log_value(jnp.log(around)))
    printed = np.log([printed_value(curve, z) for z in around])
    left = np.expm1(np.abs(kept - printed)).max()
    step = np.abs(np.diff(kept)).max()
    smooth = step < 0.2 * abs(jump) and abs(kept[0] - printed[0]) < 1e-12
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
        f"{100 * left:.2f} % from the print",
    )


def _ends(quantity: str) -> list[FailureMode]:
    law = LAWS[quantity, "kingery_bulmash"]
    curve = kingery_bulmash_curve(CURVES[quantity], "surface")
    method = f"{quantity} by kingery_bulmash"

    def valid(z):
        return bool(law.valid(z, 1.0))

    near, far = switching_point(valid, NEAR, 1.0), switching_point(valid, 1.0, FARTHEST)
    high = law.function(jnp.asarray([FAR, FARTHEST]), 1.0)
    goes_on = bool(jnp.all(jnp.isfinite(high) & (high > 0))) and _is_power_law(law, far)
    said = "power law with the end slope, law_valid false"
    if quantity == "peak_overpressure_pa":
        weak = float(shock_kinematics_pressure(FARTHEST, 1.0))
        said += (
            f": {float(high[1]):.3g} Pa at Z = {FARTHEST:g}, where shock_kinematics "
            f"has {weak:.3g}"
        )

    def lie(z):
        ratio = printed_value(curve, z) / kept_value(curve, z)
        return f"{'overflows' if math.isinf(ratio) else f'{ratio:.3g}'} at Z = {z:g}"

    return [
        FailureMode(
            area="laws",
            method=method,
            failure="table ends near the charge",
            boundary=near,
            unit="m/kg^(1/3)",
            beyond=f"polynomial over power law: {lie(NEAR)}",
            response=verified("marks", _is_power_law(law, near), method),
            message="power law with the end slope, law_valid false",
        ),
        FailureMode(
            area="laws",
            method=method,
            failure="table ends far out",
            boundary=far,
            unit="m/kg^(1/3)",
            beyond=f"polynomial over power law: {lie(FAR)}, {lie(FARTHEST)}",
            response=verified("marks", goes_on, method),
            message=said,
        ),
    ]


def _is_power_law(law, end: float) -> bool:
    """Whether a law beyond an end of its table has one slope, and is not valid."""
    out = 2.0 if end > 1.0 else 0.5
    z = end * np.array([1.001 if out > 1.0 else 0.999, out, out**2])
    value = np.log(np.asarray(law.function(z, 1.0)))
    slopes = np.diff(value) / np.diff(np.log(z))
    straight = math.isclose(slopes[0], slopes[1], rel_tol=1e-6)
    return straight and not np.any(law.valid(z, 1.0))
