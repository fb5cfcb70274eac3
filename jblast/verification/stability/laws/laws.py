"""Where laws of arrival, duration and absorption break: measured on the laws alone."""

import math

import jax
import numpy as np

from jblast.constants import STANDARD_SOUND_SPEED
from jblast.registry import LAWS
from jblast.verification.stability.failure import FailureMode, verified
from jblast.verification.stability.laws.kingery_bulmash import kingery_bulmash_failures
from jblast.verification.stability.laws.point_sources import point_source_failures
from jblast.verification.stability.threshold import crossing, switching_point
from jblast.waves import (
    iso_9613_absorption,
    kingery_bulmash_duration,
    kinney_graham_duration,
    shock_kinematics_arrival_time,
    stokes_absorption,
    transmission_loss,
    wu_hao_air_arrival_time,
)
from jblast.waves.laws.kinney_graham import kinney_graham_duration_valid
from jblast.waves.laws.wu_hao import wu_hao_air_valid
from jblast.waves.propagation import DECIBELS_PER_NEPER

MASS = 15.0
"""Charge of the examples [kg]: the thesis' own."""
SHORT = 0.3
"""A duration off by more than this is called wrong [-]."""
THESIS_FREQUENCY = 500.0 / (2.0 * math.pi)
"""Frequency of the thesis' blast [Hz]: 500 rad/s."""
AIR = {"temperature": 288.15, "pressure": 101325.0, "relative_humidity": 0.5}
DENSITY = 1.225
"""Of that air [kg/m3]."""


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
