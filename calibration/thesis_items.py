"""Item by item: what the thesis prints, what its plugins compute, what is right.

Numbers that the plugins hold are written down here; whatever follows from them or from
a law is computed.
"""

import math

import jax
import jax.numpy as jnp

from jblast.constants import GRANITE_P_SPEED, STANDARD_PRESSURE
from jblast.waves.laws.kingery_bulmash import (
    kingery_bulmash_arrival_time,
    kingery_bulmash_duration,
    kingery_bulmash_impulse,
    kingery_bulmash_pressure,
    kingery_bulmash_reflected_impulse,
)
from jblast.waves.laws.shock_kinematics import (
    shock_kinematics_arrival_time,
    shock_kinematics_shock_speed,
)
from jblast.waves.laws.wu_hao import wu_hao_air_arrival_time, wu_hao_ground_arrival_time
from jblast.waves.propagation import (
    DECIBELS_PER_NEPER,
    sound_speed_in_air,
    spherical_spreading_loss,
    stokes_absorption,
    transmission_loss,
)
from jblast.waves.waveform import friedlander_decay, friedlander_impulse

HEADINGS = ("item", "as printed", "as coded", "as corrected")

MASS, RANGE, AIR_SPEED, ROCK_SPEED = 15.0, 20.0, 340.0, 6000.0
"""The case of table 4.1 [kg, m, m/s, m/s]."""


def items() -> tuple[tuple[str, str, str, str], ...]:
    """Return the rows of the table."""
    return (
        _microphone_arrival(),
        _pressure_arrival(),
        _attenuation(),
        _audibility(),
        _audio_rate(),
        _ground_filter(),
        _blast_place(),
        _pressure_shape(),
        _force(),
        _torque(),
        (
            "events",
            "event camera",
            "8-bit linear difference over a threshold, one event a pixel a frame, "
            "stamped at the frame, brighter = 0",
            "difference of ln intensity, each pixel at its own time between frames, "
            "brighter = 1",
        ),
        (
            "image placement",
            "range, bearing, Fibonacci view",
            "one view, stretched to the frame, rotated by roll",
            "a projection: size falls as 1/range, place follows from the bearing",
        ),
        (
            "visual detector",
            "algorithm 5",
            "24-bin histogram, indexed by raw y: out of range",
            "index the bin; detection rate and latency are not measured there",
        ),
        (
            "acoustic detector",
            "algorithm 6, 'a few milliseconds'",
            "template 1 s long; product up to the length of the reference only",
            "that is compute time, not latency; without padding the correlation wraps",
        ),
    )


def _microphone_arrival():
    ground, in_situ = (
        1e3 * float(wu_hao_ground_arrival_time(RANGE, MASS, speed))
        for speed in (ROCK_SPEED, GRANITE_P_SPEED)
    )
    air = 1e3 * float(wu_hao_air_arrival_time(RANGE, MASS, AIR_SPEED))
    shock = 1e3 * float(
        kingery_bulmash_arrival_time(RANGE, MASS, sound_speed=AIR_SPEED)
    )
    warm = float(sound_speed_in_air(293.15, STANDARD_PRESSURE, 0.0))
    return (
        "arrival, microphone",
        f"Wu-Hao, eqs. 3.3-3.4: air {air:.2f} ms, ground {ground:.2f} ms at "
        f"{RANGE:g} m, {MASS:g} kg; {AIR_SPEED:g} m/s called the sound speed at 20 C",
        "the same, and the ground wave climbs to the sensor at the mean speed of the "
        "air shock",
        f"Kingery-Bulmash {shock:.2f} ms in the same air; ground {in_situ:.2f} ms in "
        f"granite as it lies ({GRANITE_P_SPEED:g} m/s; {ROCK_SPEED:g} is an intact "
        f"core); dry air at 20 C has {warm:.1f} m/s",
    )


def _pressure_arrival():
    distance, mass, coded_speed = 26.0, 10.0, 300.0
    wu_hao = 1e3 * float(wu_hao_air_arrival_time(distance, mass, AIR_SPEED))
    tabulated, kinematic = (
        1e3 * float(law(distance, mass, sound_speed=AIR_SPEED))
        for law in (kingery_bulmash_arrival_time, shock_kinematics_arrival_time)
    )
    # the two rows of the plugin's CSV [m, s]
    slow, fast = sorted(r / t for r, t in ((8.66, 15.25e-3), (17.32, 29.37e-3)))
    return (
        "arrival, pressure",
        "the same equations",
        f"r/{coded_speed:g} m/s: {1e3 * distance / coded_speed:.1f} ms at "
        f"{distance:g} m, {mass:g} kg, where the sound comes at {wu_hao:.1f} ms; the "
        f"CSV behind the force implies {slow:.0f}-{fast:.0f} m/s: three clocks",
        f"one arrival for all: Kingery-Bulmash {tabulated:.1f} ms, shock kinematics "
        f"{kinematic:.1f} ms",
    )


def _attenuation():
    omega, density, kelvin, humidity = 500.0, 1.2, 313.0, 0.5
    frequency = omega / (2.0 * math.pi)
    alpha = float(stokes_absorption(frequency, density, AIR_SPEED, kelvin))
    near, far = 2.0 * 10.0 * math.sqrt(3.0), 1000.0  # the farthest blast; a kilometre
    left = {r: math.exp(-alpha * r) for r in (near, far)}
    losses = {
        r: float(
            transmission_loss(
                frequency,
                r,
                1.0,
                kelvin,
                STANDARD_PRESSURE,
                humidity,
                burst="free-air",
            )
        )
        for r in (near, far)
    }
    spread = float(spherical_spreading_loss(far, 1.0))
    absorbed = losses[far] - spread
    ratio = absorbed / (DECIBELS_PER_NEPER * alpha * (far - 1.0))
    return (
        "attenuation",
        "Stokes, eqs. 3.1-3.2; no spreading",
        f"{1e8 * alpha:.2f}e-8 Np/m at omega = {omega:g} rad/s: "
        f"{100 * (1 - left[far]):.3f} % lost over {far:g} m, "
        f"{100 * (1 - left[near]):.4f} % over {near:.0f} m: as loud as at the source",
        f"from 1 m to {far:g} m {losses[far]:.1f} dB: spreading {spread:.1f} dB and "
        f"ISO 9613-1 {absorbed:.2f} dB ({ratio:.0f} times Stokes; {100 * humidity:g} % "
        f"humidity); to {near:.0f} m {losses[near]:.1f} dB",
    )


def _audibility():
    # R/t_a = c_a and dR/dt = c_a: t_a goes as R^1.4, so both from the law at 1 m
    one = jnp.array(1.0)
    value, slope = jax.value_and_grad(wu_hao_air_arrival_time)(one, MASS, AIR_SPEED)
    mean, local = (float((AIR_SPEED * t) ** -2.5) for t in (value, slope))
    front = float(shock_kinematics_shock_speed(mean, MASS, sound_speed=AIR_SPEED))
    return (
        "audibility",
        "-",
        f"the air blast is dropped in silence where r/t_a < {AIR_SPEED:g} m/s: past "
        f"{mean:.1f} m for {MASS:g} kg; the front itself is slower than sound from "
        f"{local:.1f} m on",
        f"the law is marked as not valid there; by shock kinematics the front still "
        f"does {front:.0f} m/s at {mean:.1f} m",
    )


def _audio_rate():
    rate, file_rate, share = 200.0, 44.1e3, 29.0
    ground = float(wu_hao_ground_arrival_time(RANGE, MASS, ROCK_SPEED))
    duration = float(kingery_bulmash_duration(RANGE, MASS))
    return (
        "audio rate",
        f"{rate:g} Hz",
        f"files of {file_rate / 1e3:g} kHz; {share:g} % of the bomb sound's energy "
        f"lies below {rate / 2:g} Hz (measured on the file, not here)",
        f"{rate:g} Hz has a sample each {1e3 / rate:.0f} ms: the ground wave takes "
        f"{1e3 * ground:.2f} ms to get there, the positive phase {1e3 * duration:.1f} "
        f"ms to pass; {file_rate / 1e3:g} kHz has {file_rate * duration:.0f} samples "
        "in it",
    )


def _ground_filter():
    file_rate, cutoff = 44.1e3, 25.0
    samples = int(file_rate / (2.0 * cutoff)) // 2 * 2 + 1
    ahead = 1e3 * (samples // 2) / file_rate
    ground = 1e3 * float(wu_hao_ground_arrival_time(RANGE, MASS, ROCK_SPEED))
    return (
        "ground-wave filter",
        "averaging filter with cut-off",
        f"centred moving average of {samples} samples ({cutoff:g} Hz): looks "
        f"{ahead:.0f} ms ahead",
        f"not causal: it can sound {ahead - ground:.0f} ms before the detonation at "
        f"{RANGE:g} m, {MASS:g} kg; a filter of the past only, its delay named",
    )


def _blast_place():
    low, high = 10.0, 20.0
    near, far = (side * math.sqrt(3.0) for side in (low, high))
    return (
        "blast place",
        "random in the world, 5-15 kg, 10-20 m",
        f"x, y, z each {low:g}-{high:g} m from the vehicle, so {near:.1f}-{far:.1f} m "
        "away; 10-11 kg, lead 1-5 s, probability 0.15 a tick; no seed",
        "a place in the world that does not follow the vehicle, drawn with a key",
    )


def _pressure_shape():
    peak, duration, impulse = (
        float(law(RANGE, MASS))
        for law in (
            kingery_bulmash_pressure,
            kingery_bulmash_duration,
            kingery_bulmash_impulse,
        )
    )
    printed = float(friedlander_impulse(peak, duration, 1.0)) / (peak * duration)
    decay = float(friedlander_decay(peak, impulse, duration))
    return (
        "pressure in time",
        f"Friedlander, eq. 3.5 (b = 1): impulse {printed:.3f} Ps td",
        "not used: an impulse over 1 ms (below)",
        f"b from Kingery-Bulmash's own impulse: {decay:.2f} at {RANGE:g} m, "
        f"{MASS:g} kg, impulse {impulse / (peak * duration):.3f} Ps td; "
        f"td {1e3 * duration:.1f} ms",
    )


FORCE, TORQUE = (2.2116, -2.1604, 0.0196), (4.8894, -0.0262, 5.4295)
"""Of the model plugin, metres and kilograms to N s and N m s: a, n, b in the impulse
a^2 r^n Q + b."""


def _coded(fit: tuple[float, float, float], distance: float) -> float:
    """Return the impulse that the plugin hands the vehicle."""
    root, exponent, rest = fit
    return root**2 * distance**exponent * MASS + rest


def _words(fit: tuple[float, float, float]) -> str:
    root, exponent, rest = fit
    return f"impulse {root}^2 r^{exponent} Q + {rest}"


def _force():
    meant, step = 1e-3, 4e-3
    coded = _coded(FORCE, RANGE)
    given = coded / meant * step
    reflected, slope = jax.value_and_grad(kingery_bulmash_reflected_impulse)(
        jnp.array(RANGE), MASS
    )
    area = 1e4 * coded / float(reflected)
    falls = float(slope) * RANGE / float(reflected)
    return (
        "force",
        "pressure by Friedlander",
        f"{_words(FORCE)} N s: {coded:.3f} N s at {RANGE:g} m, {MASS:g} kg, as a force "
        f"over {1e3 * meant:g} ms, held for one step of {1e3 * step:g} ms: "
        f"{given:.3f} N s, {given / coded:g} times what was meant",
        f"an impulse given once, however long the step. A wall gets "
        f"{float(reflected):.0f} Pa s there (Kingery-Bulmash, reflected): the coded "
        f"one is a plate of {area:.0f} cm2. It falls as r^{falls:.2f}, not "
        f"r^{FORCE[1]:.2f}",
    )


def _torque():
    near, far = (_coded(TORQUE, r) for r in (0.5 * RANGE, RANGE))
    arm = far / _coded(FORCE, RANGE)
    return (
        "torque",
        "from the CSV",
        f"moment {_words(TORQUE)} N m s, then clipped: {near:.0f} N m s at "
        f"{0.5 * RANGE:g} m, {far:.0f} at {RANGE:g} m",
        f"an arm of {arm:.0f} m by the coded force (99.99 m in the CSV: a moment "
        "about a far point); the arm is that of the vehicle's own faces",
    )
