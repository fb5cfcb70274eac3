r"""Failure modes of flights: steps, controllers, kernels, pulses.

The limit at which a position controller becomes unstable is measured against the stated
limit. Near hover the loop depends on times only as multiples of the step: a step longer
by $s$ is the same step with motors and gains faster by $s$, $\tau_m/s$, $s^2 k_p$,
$s k_d$, $s^2 k_R$, $s k_\omega$. Therefore one program flies all vehicles at all steps.

The other failure modes are a blast too close for the laws or too strong for a vehicle,
a step longer than the pulse, and derivatives by a Warp kernel whose loop overwrites its
state.
"""

import dataclasses
import functools
from typing import Any, NamedTuple, no_type_check

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import warp as wp
from jaxtyping import Bool, Float

import jblast.vehicle.warp  # noqa: F401 - which keeps Warp quiet
from jblast.constants import FLIGHT_GRAVITY
from jblast.errors import InputError
from jblast.scene import Charge, Scene
from jblast.vehicle import (
    Each,
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
from jblast.vehicle.rollout import timetable
from jblast.vehicle.state import unit
from jblast.verification.stability.failure import (
    FailureMode,
    boundary_at,
    crossing,
    first_failure,
    verified,
)

# A flight of an hour then loses 4e-6 of its energy.
DRIFT = 1e-9
"""Largest accepted relative change of the energy of a free tumble [1/s]."""
# From a slow turn to 50 turns a second, far above what gyroscopes of vehicles measure
# [rad/s].
RATES = np.geomspace(1.0, 300.0, 12)
STEP = 5e-4
"""Default step of a flight [s]."""
# After an hour a clock in float32 resolves 0.24 ms, half of the usual step [s].
HOUR = 3600.0
# Absurd speeds: quadratic drag is stiff at a step of 0.5 ms only far above real ones.
SPEEDS = np.geomspace(1e4, 1e7, 100)
"""Initial speeds of the stiff flights [m/s]."""
LOOPS = (1, 2, 3, 5, 10, 20, 40)
"""Numbers of steps of the loop whose adjoint is tested."""
# Far above the rounding of float64, far below what an optimiser would notice.
GRADIENT_ERROR = 1e-3
"""Largest accepted relative error of a derivative."""
# From twenty times the usual step to so short a one that rounding in float32 outweighs
# the error of the integrator [s].
STEPS = np.array([1e-2, 2e-3, 5e-4, 1e-4, 2e-5])
# A fall of 31 m; 1 mm is below the error of any position sensor of a small vehicle.
FALL_S, ALLOWED_M = 2.5, 1e-3
"""Duration of the fall [s], and largest accepted error of its end [m]."""
# The literal in `grow` must be the same: a kernel reads no Python constants.
EULER_STEP = 0.02
"""Step of the loop in `grow` [-]."""
RATIOS = np.geomspace(0.03, 100.0, 15)
"""Ratios of the step to the positive phase."""
PHASES = (np.arange(8) + 0.5) / 8
"""Arrivals of the front within a step, as shares of the step."""
# Of the order of the scatter of the impulse laws; a smaller loss is hidden by it.
LOST_IMPULSE = 0.1
"""Largest accepted relative error of the impulse."""
# Six times finer than the shortest step under test.
FINE = 200
"""Steps to a positive phase of the reference impulse."""
# The negative phase is over after a few positive ones.
AFTER = 20.0
"""End of the wave [positive phases after the arrival]."""
# Above the 8 x 702 steps at the shortest ratio and the 4,200 of the reference.
SIZE = 6144
"""Steps of one call, always as many, so that one program serves all."""
# So short that the pressure is constant, so long that no digits are lost.
INSTANT = 1e-4
"""Duration over which a sampled force is averaged [positive phases]."""
NEAR_DISTANCES = np.array([0.0, 0.01, 0.1, 0.2, 0.5, 1.0, 2.0])
"""Distances from a charge of 1 kg [m]."""
CHARGES = np.geomspace(1.0, 1000.0, 31)
"""Masses of TNT at 5 m from the vehicle [kg]."""
NAMES = tuple(PARAMETERS)
# Only the ratio to the limit matters: gains and motor lag are scaled instead.
CONTROLLER_STEP = 1e-3
"""Step of the flights at the stability limit [s]."""
# Steps of 1 % about the limit, coarser beyond, where the growth is fast.
SHARES = np.append(np.linspace(0.9, 1.1, 21), np.arange(1.15, 2.01, 0.05))
"""Steps, as shares of the stated limit."""
# So small that the loop is linear, far above the rounding of float64.
START = 1e-6
"""Order of the initial body rate [rad/s]."""
# A mode 1 % past its limit grows visibly between 1,500 and 6,000 steps.
CONTROLLER_STEPS = 6000
"""Steps of each flight at the stability limit."""
EARLY, LATE = slice(15, 30), slice(45, 61)
"""Early and late stored rows, one per hundred steps, that show growth or decay."""
HOME = (0.0, 0.0, 5.0)
"""Target position [m]: above the ground, so that no small motion touches it."""


def flight_failures() -> list[FailureMode]:
    """Measure every failure mode."""
    return [
        *_limit_failures(),
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


def tumble_drift() -> Float[np.ndarray, " rate"]:
    """Return the relative energy change of a free tumble in 1 s, by `RATES`."""
    vehicle = named("hummingbird")  # its three moments of inertia differ
    # neither drag nor rotors, so that the energy of the exact motion is constant
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
    flown = simulate(bare, starts, duration_s=1.0, step_s=STEP, store_every=40)
    w = np.asarray(flown.body_rate_rad_s)
    energy = np.einsum("...i,ij,...j", w, np.asarray(bare.inertia_kg_m2), w)
    return np.abs(energy / energy[:, :1] - 1).max(axis=1)


def _tumble() -> FailureMode:
    ours = tumble_drift()
    logs = np.log(DRIFT), np.log(ours), np.log(RATES)
    at = float(np.exp(boundary_at(*logs, "free tumble, RK4")))
    ten = float(np.interp(10.0, RATES, ours))
    return FailureMode(
        area="flights",
        method="free tumble, RK4, steps of 0.5 ms",
        failure=f"the energy drifts by more than {DRIFT:g} a second",
        boundary=at,
        unit="rad/s",
        beyond=f"{RATES[-1]:g} rad/s: {ours[-1]:.1g} a second",
        response=verified("holds", ten < DRIFT, "free tumble"),
        message=f"RK4: {ten:.1g} a second at 10 rad/s",
    )


def clock_errors(until_s: float = HOUR) -> tuple[Float[np.ndarray, " step"], float]:
    """Return the error of a summed float32 clock at each step, and jblast's largest.

    Args:
        until_s: Duration of the flight [s].
    """
    exact = (np.arange(round(until_s / STEP)) + 1) * STEP
    summed = np.cumsum(np.full(exact.size, STEP, np.float32), dtype=np.float32)
    ours = timetable(until_s, STEP, STEP, np.dtype(np.float32)).start
    late = np.abs(np.asarray(ours, float)[1:] - exact[:-1])
    return np.abs(summed - exact), float(late.max())


def _clock() -> FailureMode:
    summed, ours = clock_errors()
    begins = STEP * (1 + first_failure(summed > STEP / 2, "clock in float32"))
    coarse = float(2.0 ** np.ceil(np.log2(STEP / np.finfo(np.float32).eps)))
    return FailureMode(
        area="flights",
        method="clock of a flight in float32",
        failure="sums of steps of 0.5 ms are off by half a step",
        boundary=begins,
        unit="s of flight",
        beyond=f"after an hour {summed[-1]:.2g} s off",
        response=verified("holds", ours <= STEP / 2, "clock"),
        message="step numbers are multiplied in float64 and rounded last: at most "
        f"{1e3 * ours:.1g} ms off within an hour; from {coarse:,.0f} s on float32 does "
        "not resolve a step",
    )


def shortest_quaternion(dtype: type = np.float32) -> float:
    """Return the length at which a quaternion can no longer be scaled to 1."""
    powers = np.arange(0, 320)
    lengths = np.array([float(f"1e-{n}") for n in powers]).astype(dtype)
    zero = jnp.zeros(lengths.size, dtype)
    scaled = np.asarray(jax.vmap(unit)((zero, zero, zero, jnp.asarray(lengths)))[3])
    first = first_failure(np.abs(scaled - 1) > 1e-3, "quaternion scaled to length 1")
    return float(f"1e-{powers[first]}")


def _quaternion() -> FailureMode:
    turned = np.asarray(unit(tuple(jnp.zeros(4))))
    shortest = {t.__name__: shortest_quaternion(t) for t in (np.float32, np.float64)}
    messages = [_refusal(length) for length in (0.0, shortest["float32"])]
    refused = all("length 1, got" in message for message in messages)
    return FailureMode(
        area="flights",
        method="quaternion scaled to length 1, float32",
        failure="its square is zero",
        boundary=shortest["float32"],
        unit="long and shorter",
        beyond=f"length 0: {np.isnan(turned).sum()} of 4 numbers are NaN, and the "
        f"flight stays NaN; in float64 from {shortest['float64']:.0e}",
        response=verified("refuses", refused, "zero quaternion"),
        message=f"{messages[0]}; {messages[1].partition(', ')[2]}",
    )


def _refusal(length: float) -> str:
    """Return the message on a quaternion of a length in float32, "" if accepted."""
    level = hovering(named("crazyflie"))
    try:
        short = np.array([0.0, 0.0, 0.0, length], np.float32)
        dataclasses.replace(level, quaternion=short)
    except InputError as error:
        return str(error)
    return ""


def lost_speeds() -> tuple[Bool[np.ndarray, " speed"], bool]:
    """Return True where a flight diverges, and True if the rest is bit-identical."""
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
    first = first_failure(lost, "a batch with ever faster vehicles")
    seen = alike and lost[first::2].all() and not lost[::2].any()
    return FailureMode(
        area="flights",
        method="a batch of 100, every other vehicle faster than the one before",
        failure="quadratic drag, too stiff for a step of 0.5 ms: it diverges",
        boundary=float(SPEEDS[first]),
        unit="m/s",
        beyond=f"{int(lost.sum())} of 50 end in NaN",
        response=verified("marks", seen, "a batch"),
        message="those are reported as lost, with NaN rows; the flights of the rest "
        "are bit-identical to those without them",
    )


def adjoint_failure() -> FailureMode:
    """Measure the number of steps at which the adjoint of a loop is wrong."""
    errors = np.array(
        [abs(slope_by_tape(1.0, n) / slope_of_steps(1.0, n) - 1) for n in LOOPS]
    )
    first = first_failure(errors > GRADIENT_ERROR, "adjoint of a loop")
    message = _kernel_refusal()
    return FailureMode(
        area="flights",
        method="Warp, adjoint of a loop that overwrites its state",
        failure=f"the derivative is off by more than {GRADIENT_ERROR:.1%}, without a "
        "warning",
        boundary=float(LOOPS[first]),
        unit="steps",
        beyond=f"{LOOPS[-1]} steps: off by {errors[-1]:.0%}",
        response=verified("refuses", "no derivatives" in message, "gradient by Warp"),
        message=f"{message}; those of JAX store or recompute every state",
    )


def _kernel_refusal() -> str:
    """Return the message on a derivative through the kernel."""
    vehicle = named("crazyflie")
    level = hovering(vehicle)

    def end(speed):
        start = dataclasses.replace(level, velocity_m_s=speed * jnp.ones(3))
        return simulate(
            vehicle, start, duration_s=1e-3, backend="warp:cpu"
        ).position_m.sum()

    try:
        jax.grad(end)(1.0)
    except InputError as error:
        return str(error)
    return ""


def falls() -> tuple[Float[np.ndarray, " step"], Float[np.ndarray, " step"]]:
    """Return the float32 error of a fall of 2.5 s, by `STEPS` [m].

    The first array is for plain sums of the exact increments of each step, the second
    for the kernel, with rotors at rest and without drag.
    """
    vehicle = eqx.tree_at(
        lambda v: (v.frame_drag, v.translational_lift),
        named("hummingbird"),
        (jnp.zeros(3), jnp.zeros(())),
    )
    level = hovering(vehicle)
    start = dataclasses.replace(
        level,
        position_m=level.position_m.astype(jnp.float32),
        velocity_m_s=level.velocity_m_s.astype(jnp.float32),
        quaternion=level.quaternion.astype(jnp.float32),
        body_rate_rad_s=level.body_rate_rad_s.astype(jnp.float32),
        rotor_speed_rad_s=jnp.zeros(4, jnp.float32),
    )
    up = float(start.position_m[2])
    exact = up - FLIGHT_GRAVITY * FALL_S**2 / 2
    plain, ours = [], []
    for step in STEPS:
        x, v = np.float32(up), np.float32(0.0)
        h, g = np.float32(step), np.float32(FLIGHT_GRAVITY)
        for _ in range(round(FALL_S / float(step))):
            # exact in real numbers, so that only rounding is left
            x = x + h * (v - g * h / np.float32(2))
            v = v - g * h
        plain.append(abs(float(x) - exact))
        flown = simulate(
            vehicle,
            start,
            duration_s=FALL_S,
            step_s=float(step),
            store_every=10**6,
            backend="warp:cpu",
        )
        ours.append(abs(float(flown.position_m[-1, 2]) - exact))
    return np.array(plain), np.array(ours)


def sum_failure() -> FailureMode:
    """Measure the step below which plain float32 sums lose a flight to rounding."""
    # shorter steps have a smaller truncation error, but more roundings to sum
    plain, ours = falls()
    first = first_failure(plain > ALLOWED_M, "fall in float32")
    kept = bool((ours < ALLOWED_M).all())
    return FailureMode(
        area="flights",
        method="flight in float32, plain sums",
        failure=f"a fall of {FALL_S:g} s ends more than 1 mm off",
        boundary=1e3 * float(STEPS[first]),
        unit="ms and shorter steps",
        beyond=f"{1e6 * STEPS[-1]:g} us: {1e3 * plain[-1]:.2g} mm",
        response=verified("holds", kept, "sums in float32"),
        message="compensated sums carry the rounding error over: "
        f"{1e3 * ours.max():.1g} mm at most, steps of 20 us to 10 ms",
    )


@wp.kernel
@no_type_check
def grow(start: wp.array[wp.float64], steps: int, end: wp.array[wp.float64]):
    """Advance x' = x^2 by Euler's method, in a register."""
    x = start[0]
    for _ in range(steps):
        x = x + wp.float64(0.02) * x * x
    end[0] = x


def slope_by_tape(x: float, steps: int) -> float:
    """Return the derivative of the end by the start from Warp's tape."""
    start = wp.array([x], dtype=wp.float64, device="cpu", requires_grad=True)
    end = wp.zeros(1, dtype=wp.float64, device="cpu", requires_grad=True)
    with wp.Tape() as tape:
        wp.launch(grow, dim=1, inputs=[start, steps], outputs=[end], device="cpu")
    tape.backward(grads={end: wp.ones(1, dtype=wp.float64, device="cpu")})
    assert start.grad is not None
    return float(start.grad.numpy()[0])


def slope_of_steps(x: float, steps: int) -> float:
    """Return the same derivative as the product of the derivatives of the steps."""
    slope = 1.0
    for _ in range(steps):
        slope *= 1 + 2 * EULER_STEP * x
        x += EULER_STEP * x * x
    return slope


@functools.cache
def impulse_errors() -> tuple[
    Float[np.ndarray, " ratio"],
    Float[np.ndarray, " ratio"],
    Float[np.ndarray, " ratio"],
]:
    """Return ratios of step to positive phase, and errors of the whole impulse.

    The first error is that of a force sampled by RK4, at both ends and in the middle of
    a step. The second is that of the impulse of the load. Each is the largest over
    `PHASES`. The vehicle stays 7 m from 1 kg of TNT and has drag loads only.
    """
    load = blast_load(
        Scene(charge=Charge(mass_kg=1.0, position_m=(5.0, 0.0, 0.0))),
        front=False,
        rotors=False,
    )
    # so heavy that it stays in place, and every step sees the same wave
    heavy = eqx.tree_at(lambda v: v.mass_kg, named("crazyflie"), jnp.asarray(1e9))
    state = hovering(heavy)
    wave = load.wave_of(load.blasts[0], state.position_m)
    arrival = float(load.arrival_time_s(state.position_m)[0])
    phase = float(wave.duration_s)
    given = jax.jit(jax.vmap(lambda a, b: load.impulse(a, b, state, heavy)[0]))

    def impulses(starts: np.ndarray, length: float) -> Float[np.ndarray, "..."]:
        # one size for all, so that it is compiled once; the padding, before the blast,
        # has no impulse
        filled = np.full(SIZE, -1.0)
        filled[: starts.size] = starts.ravel()
        ends = jnp.asarray(filled + length)
        found = np.asarray(given(jnp.asarray(filled), ends))[: starts.size]
        return found.reshape(*starts.shape, 3)

    fine = arrival + phase * np.arange(-1.0, AFTER, 1 / FINE)
    truth = impulses(fine, phase / FINE).sum(axis=0)
    bare, ours = [], []
    for ratio in RATIOS:
        step = ratio * phase
        count = int(np.ceil((AFTER + 1) / ratio)) + 2
        starts = arrival + step * (np.arange(count) - 1 - PHASES[:, None])
        begin, middle, end = (
            impulses(starts + along * step, INSTANT * phase) / (INSTANT * phase)
            for along in (0.0, 0.5, 1.0)
        )
        sampled = step / 6 * (begin + 4 * middle + end)
        for errors, parts in ((bare, sampled), (ours, impulses(starts, step))):
            off = np.linalg.norm(parts.sum(axis=1) - truth, axis=1)
            errors.append(off.max() / np.linalg.norm(truth))
    return RATIOS, np.array(bare), np.array(ours)


def pulse_failure() -> FailureMode:
    """Measure the step at which a sampled force loses a tenth of the impulse."""
    ratio, bare, ours = impulse_errors()
    begins = float(ratio[first_failure(bare > LOST_IMPULSE, "pulse as a force")])
    ten = int(np.argmin(abs(ratio - 10.0)))
    return FailureMode(
        area="flights",
        method="blast pulse as a force, RK4",
        failure=f"{LOST_IMPULSE:.0%} of its impulse is lost or added between stages",
        boundary=begins,
        unit="positive phases, the step",
        beyond=f"a step of {ratio[ten]:.0f} positive phases: wrong by {bare[ten]:.0%}",
        response=verified("holds", ours.max() < 1e-3, "pulses"),
        message="each step receives its share of the impulse: wrong by "
        f"{ours.max():.1g} at most, steps of {ratio[0]:g} to {ratio[-1]:g} phases",
    )


def near_impulses() -> tuple[Float[np.ndarray, " place"], Bool[np.ndarray, " place"]]:
    """Return impulses of 1 kg of TNT on a Crazyflie [N s], and True if in range."""
    load = blast_load(Scene(charge=Charge(mass_kg=1.0)))
    level = hovering(named("crazyflie"))

    def given(distance):
        position = jnp.array([1.0, 0.0, 0.0]) * distance
        state = dataclasses.replace(level, position_m=position)
        push, _ = load.impulse(jnp.zeros(()), jnp.ones(()), state, named("crazyflie"))
        return jnp.linalg.norm(push), load.in_range(position)[0]

    sizes, in_range = jax.jit(jax.vmap(given))(jnp.asarray(NEAR_DISTANCES))
    return np.asarray(sizes), np.asarray(in_range)


def near_failure() -> FailureMode:
    """Measure the distance below which a load is outside the range of the laws."""
    sizes, in_range = near_impulses()
    load = blast_load(Scene(charge=Charge(mass_kg=1.0)))

    def inside(distance: float) -> float:
        position = jnp.array([distance, 0.0, 0.0])
        return float(load.in_range(position)[0]) - 0.5

    begins = crossing(inside, 0.1, 1.0)
    finite = bool(np.isfinite(sizes).all())
    return FailureMode(
        area="flights",
        method="blast load of 1 kg on the ground",
        failure="nearer than the range of the laws",
        boundary=begins,
        unit="m from the charge",
        beyond=f"{NEAR_DISTANCES[1]:g} m: {sizes[1]:.2g} N s, the value at Z = 0.07; "
        f"{sizes[0]:.2g} at the charge, without a direction",
        response=verified(
            "marks", finite and not in_range[:3].any() and in_range[4:].all(), "near"
        ),
        message="in_range is false there; the load stays finite",
    )


def fly_on() -> tuple[
    Bool[np.ndarray, "vehicle charge"], Float[np.ndarray, "vehicle charge"]
]:
    """Return True where a controlled vehicle flies on, and its peak deviation [m].

    The vehicles hover 5 m above the ground and 5 m from each of `CHARGES` in the air. A
    vehicle that touches the ground or turns over has crashed.
    """
    # one batch of all vehicles and charges, so that one program flies them
    vehicles, holds, loads = [], [], []
    for name in NAMES:
        for mass in CHARGES:
            charge = Charge(mass_kg=mass, position_m=(5.0, 0.0, 5.0), burst="free-air")
            # names are static: different ones could not be stacked
            vehicles.append(dataclasses.replace(named(name), name=""))
            holds.append(PositionHold(HOME, named_gains(name)))
            loads.append(blast_load(Scene(charge=charge)))
    flown = simulate(
        stacked(vehicles),
        stacked([hovering(vehicle) for vehicle in vehicles]),
        duration_s=2.0,
        step_s=1e-3,
        control=Each(stacked(holds)),
        loads=(Each(stacked(loads)),),
        ground_up_m=0.0,
        store_every=10,
    )
    metrics = flight_metrics(
        flown, jnp.asarray(HOME), blast_time_s=0.0, ground_up_m=0.0
    )
    shape = len(NAMES), CHARGES.size
    alive = ~np.asarray(metrics.crashed).reshape(shape)
    return alive, np.asarray(metrics.peak_deviation_m).reshape(shape)


def charge_failures() -> list[FailureMode]:
    """Measure the smallest charge after which each controlled vehicle crashes."""
    modes = []
    for name, alive, peak in zip(NAMES, *fly_on(), strict=True):
        first = int(np.argmin(alive))
        modes.append(
            FailureMode(
                area="flights",
                method=f"{name}, position controller, 5 m from a charge",
                failure="it turns over or touches the ground",
                boundary=float(CHARGES[first]),
                unit="kg of TNT",
                beyond=f"{CHARGES[first - 1]:.2g} kg moves it {peak[first - 1]:.2g} m; "
                f"it flies on after {int(alive[first:].sum())} of "
                f"{CHARGES.size - first - 1} larger charges",
                response=verified("marks", first > 0 and not alive[first], name),
                message="reported as crashed in the metrics of the flight",
            )
        )
    return modes


class Swings(NamedTuple):
    """Growth of small body rates near hover.

    Attributes:
        limit_s: Stated limits of the step.
        early: Largest body rate over the rows `EARLY`, at each share [rad/s].
        late: Largest body rate over the rows `LATE`; infinite where a flight is lost.
    """

    limit_s: Float[np.ndarray, " vehicle"]
    early: Float[np.ndarray, "vehicle share"]
    late: Float[np.ndarray, "vehicle share"]

    def up(self) -> Bool[np.ndarray, "vehicle share"]:
        """Return True where the rate grows; a decayed rate is rounding alone."""
        grows = (self.late > self.early) & (self.late > 1e-3 * START)
        return grows | (self.late > 1e3 * START)


def hovering(vehicle: Vehicle, body_rate=(0.0, 0.0, 0.0)) -> State:
    """Return the state of a level vehicle at rest with a body rate [rad/s]."""
    speed = jnp.sqrt(vehicle.mass_kg * 9.81 / 4 / vehicle.thrust_coefficient)
    level = jnp.array([0.0, 0.0, 0.0, 1.0])
    still, turn = jnp.zeros(3), jnp.asarray(body_rate)
    return State(jnp.asarray(HOME), still, level, turn, jnp.full(4, speed))


def swings() -> Swings:
    """Fly every named vehicle at every share of its limit, controlled at each step."""
    limits, vehicles, holds = [], [], []
    for name in NAMES:
        vehicle, gains = named(name), named_gains(name)
        limits.append(step_limit(float(vehicle.motor_lag_s), gains))
        for share in SHARES:
            times = jnp.asarray(share * limits[-1] / CONTROLLER_STEP)
            # a step longer by s is the same step with motors and gains faster by s:
            # a gain in 1/s^n grows by s^n, and all flights share one compiled step
            lag = vehicle.motor_lag_s / times
            bare = eqx.tree_at(lambda v: v.motor_lag_s, named(name), lag)
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
            duration_s=CONTROLLER_STEPS * CONTROLLER_STEP,
            step_s=CONTROLLER_STEP,
            control=Each(holds),
            store_every=100,
        )
        return jnp.linalg.norm(flown.body_rate_rad_s, axis=-1)

    spin = np.asarray(rates(stacked(vehicles), stacked(starts), stacked(holds)))
    # a lost flight has grown without bound
    spin = np.where(np.isfinite(spin), spin, np.inf)
    early, late = (
        spin[:, rows].max(axis=1).reshape(len(NAMES), SHARES.size)
        for rows in (EARLY, LATE)
    )
    return Swings(np.array(limits), early, late)


def _limit_failures() -> list[FailureMode]:
    found, modes = swings(), []
    for name, limit, up, late in zip(
        NAMES, found.limit_s, found.up(), found.late, strict=True
    ):
        first = first_failure(up[:-1], f"{name}, position controller, RK4")
        last = "lost" if np.isinf(late[first + 1]) else f"{late[first + 1]:.1g} rad/s"
        reached = SHARES[first] > 0.99 and up[first:].any()
        reached = reached and _refused(name, limit)
        modes.append(
            FailureMode(
                area="flights",
                method=f"{name}, position controller, RK4",
                failure="a step too long: a body rate of 1e-6 rad/s grows",
                boundary=1e3 * float(limit * SHARES[first]),
                unit="ms",
                beyond=f"{1e3 * limit * SHARES[first + 1]:.3g} ms: {last} after "
                f"{CONTROLLER_STEPS:,} steps",
                response=verified("refuses", reached, name),
                message=f"refused above {1e3 * limit:.4g} ms, the limit by the "
                "eigenvalues of motors and loop",
            )
        )
    return modes


def _refused(name: str, limit: float) -> bool:
    """Return True if a step 0.1 % above a limit is refused and one below is not."""
    vehicle, hold = named(name), PositionHold(HOME, named_gains(name))

    def flies(step: float) -> bool:
        try:
            simulate(
                vehicle,
                hovering(vehicle),
                duration_s=step,
                step_s=step,
                control=hold,
            )
        except InputError:
            return False
        return True

    return flies(0.999 * limit) and not flies(1.001 * limit)


def stacked(trees: list) -> Any:
    """Return trees of one structure as one tree, with a leading axis of rows."""
    first = jax.tree.structure(trees[0])
    leaves = [
        jnp.stack(part) for part in zip(*map(jax.tree.leaves, trees), strict=True)
    ]
    return jax.tree.unflatten(first, leaves)
