"""Where the flight of a vehicle breaks: tumbles, clocks, starts; and its blasts."""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float

from jblast.errors import InputError
from jblast.vehicle import named, simulate
from jblast.vehicle.rollout import timetable
from jblast.vehicle.state import unit
from jblast.verification.stability.failure import FailureMode, verified
from jblast.verification.stability.flights.blasts import charge_failures, near_failure
from jblast.verification.stability.flights.hold_limits import (
    hold_failures,
    hovering,
    stacked,
)
from jblast.verification.stability.flights.pulses import pulse_failure
from jblast.verification.stability.flights.warp_kernels import (
    adjoint_failure,
    sum_failure,
)

DRIFT = 1e-9
"""Of the energy, relative, that a second of free tumble may lose."""
RATES = np.geomspace(1.0, 300.0, 12)
STEP = 5e-4
HOUR = 3600.0
SPEEDS = np.geomspace(1e4, 1e7, 100)
"""Starts that may be too fast for the step [m/s]."""


def flight_failures() -> list[FailureMode]:
    """Measure every failure mode."""
    return [
        *hold_failures(),
        pulse_failure(),
        _tumble(),
        _clock(),
        _quaternion(),
        _lost(),
        near_failure(),
        *charge_failures(),
        adjoint_failure(),
        sum_failure(),
    ]


def tumble_drift(integrator: str) -> Float[np.ndarray, " rate"]:
    """Return the share of its energy that a free tumble at `RATES` loses a second.

    Args:
        integrator: "rk4" or "euler".
    """
    vehicle = named("hummingbird")  # its three moments of inertia differ
    bare = eqx.tree_at(
        lambda v: (v.frame_drag, v.translational_lift),
        vehicle,
        (jnp.zeros(3), jnp.zeros(())),
    )
    about = np.array([1.0, 0.5, 0.3]) / np.linalg.norm([1.0, 0.5, 0.3])
    starts = stacked(
        [
            eqx.tree_at(lambda s: s.rotor_speed_rad_s, start, jnp.zeros(4))
            for start in (hovering(bare, rate * about) for rate in RATES)
        ]
    )
    flown = simulate(
        bare, starts, duration_s=1.0, step_s=STEP, integrator=integrator, store_every=40
    )
    w = np.asarray(flown.body_rate_rad_s)
    energy = np.einsum("...i,ij,...j", w, np.asarray(bare.inertia_kg_m2), w)
    return np.abs(energy / energy[:, :1] - 1).max(axis=1)


def _tumble() -> FailureMode:
    euler, ours = tumble_drift("euler"), tumble_drift("rk4")
    at = float(np.exp(np.interp(np.log(DRIFT), np.log(ours), np.log(RATES))))
    ten = [float(np.interp(10.0, RATES, drift)) for drift in (euler, ours)]
    return FailureMode(
        area="flights",
        method="free tumble, RK4, steps of 0.5 ms",
        failure=f"the energy drifts by more than {DRIFT:g} a second",
        boundary=at,
        unit="rad/s",
        beyond=f"{RATES[-1]:g} rad/s: {ours[-1]:.1g} a second; semi-implicit Euler "
        f"drifts by {ten[0]:.1g} at 10 rad/s",
        response=verified("holds", ten[1] < DRIFT, "free tumble"),
        message=f"RK4, the default: {ten[1]:.1g} a second at 10 rad/s",
    )


def clock_errors(until_s: float = HOUR) -> tuple[Float[np.ndarray, " step"], float]:
    """Return errors of a clock summed in float32 at each step, and our largest.

    Args:
        until_s: So long do the clocks run [s].
    """
    exact = (np.arange(round(until_s / STEP)) + 1) * STEP
    summed = np.cumsum(np.full(exact.size, STEP, np.float32), dtype=np.float32)
    ours = timetable(until_s, STEP, STEP, np.dtype(np.float32)).start
    late = np.abs(np.asarray(ours, float)[1:] - exact[:-1])
    return np.abs(summed - exact), float(late.max())


def _clock() -> FailureMode:
    summed, ours = clock_errors()
    begins = STEP * (1 + int(np.argmax(summed > STEP / 2)))
    coarse = float(2.0 ** np.ceil(np.log2(STEP / np.finfo(np.float32).eps)))
    return FailureMode(
        area="flights",
        method="clock of a flight in float32",
        failure="sums of steps of 0.5 ms are off by half a step",
        boundary=begins,
        unit="s of flight",
        beyond=f"after an hour {summed[-1]:.2g} s off",
        response=verified("holds", ours <= STEP / 2, "clock"),
        message="times are counted, n steps, in float64 and rounded last: at most "
        f"{1e3 * ours:.1g} ms off within an hour; from {coarse:,.0f} s on steps are "
        "not told apart",
    )


def shortest_quaternion(dtype: type = np.float32) -> float:
    """Return the length at which a quaternion can no longer be scaled to 1."""
    powers = np.arange(0, 320)
    lengths = np.array([float(f"1e-{n}") for n in powers]).astype(dtype)
    zero = jnp.zeros(lengths.size, dtype)
    scaled = np.asarray(jax.vmap(unit)((zero, zero, zero, jnp.asarray(lengths)))[3])
    return float(f"1e-{powers[np.argmax(np.abs(scaled - 1) > 1e-3)]}")


def _quaternion() -> FailureMode:
    turned = np.asarray(unit(tuple(jnp.zeros(4))))
    shortest = {t.__name__: shortest_quaternion(t) for t in (np.float32, np.float64)}
    said = [_refusal(length) for length in (0.0, shortest["float32"])]
    refused = all("length 1, got" in words for words in said)
    return FailureMode(
        area="flights",
        method="quaternion scaled to length 1, float32",
        failure="its square is zero",
        boundary=shortest["float32"],
        unit="long and shorter",
        beyond=f"length 0: {np.isnan(turned).sum()} of 4 numbers are NaN, and so the "
        f"flight for ever; in float64 from {shortest['float64']:.0e}",
        response=verified("refuses", refused, "zero quaternion"),
        message=f"{said[0]}; {said[1].partition(', ')[2]}",
    )


def _refusal(length: float) -> str:
    """Return what is said of a quaternion of a length in float32, "" if nothing."""
    level = hovering(named("crazyflie"))
    try:
        short = np.array([0.0, 0.0, 0.0, length], np.float32)
        dataclasses.replace(level, quaternion=short)
    except InputError as error:
        return str(error)
    return ""


def lost_speeds() -> tuple[Bool[np.ndarray, " speed"], bool]:
    """Return which starts diverge, and whether the rest fly on bit for bit."""
    vehicle = named("hummingbird")
    level = hovering(vehicle)

    def fly(speeds: Float[np.ndarray, " speed"]):
        starts = [
            dataclasses.replace(level, velocity_m_s=jnp.array([speed, 0.0, 0.0]))
            for speed in speeds
        ]
        return simulate(vehicle, stacked(starts), duration_s=0.05, store_every=10)

    slow = np.linspace(0.0, 10.0, SPEEDS.size)
    mixed = np.where(np.arange(SPEEDS.size) % 2, SPEEDS, slow)
    calm, both = fly(slow), fly(mixed)
    alike = all(
        np.array_equal(np.asarray(a)[::2], np.asarray(b)[::2])
        for a, b in (
            (calm.position_m, both.position_m),
            (calm.quaternion, both.quaternion),
        )
    )
    return np.asarray(both.lost), alike


def _lost() -> FailureMode:
    lost, alike = lost_speeds()
    first = int(np.argmax(lost))
    seen = alike and lost[first::2].all() and not lost[::2].any()
    return FailureMode(
        area="flights",
        method="a batch of 100, one vehicle of two ever faster",
        failure="drag by the square, too stiff for a step of 0.5 ms: it diverges",
        boundary=float(SPEEDS[first]),
        unit="m/s",
        beyond=f"{int(lost.sum())} of 50 end in NaN",
        response=verified("marks", seen, "a batch"),
        message="those are named as lost, rows NaN; the others fly on as without them, "
        "bit for bit",
    )
