r"""Wind recorded by an anemometer: that of the scene, and that of passing blasts.

Behind a front the air moves as in `vehicle/loads/blast_wave.py`: with $x = p/P_0$ at
each moment, away from the charge (or its image below the ground),

$$u = \frac{5 c_0}{7}\frac{x}{\sqrt{1 + 6x/7}} + \frac{1}{\rho_0 R} \int_0^t p\,dt$$

The first term is Rankine's and Hugoniot's, so the peak is the law `blast_wind_m_s` for
the record's peak overpressure. The second is the afterflow of a spherical wave. The
pressure is that of the record at the position, except for its suction. That lasts here
until the impulse of the whole wave is zero, as for spherical sound, so that the wind
ends. Winds of several waves add.

A moving anemometer measures the velocity of the air relative to itself, towards east,
north and up as a fixed one: its own velocity is subtracted. A sample has the mean
velocity over its duration, the difference of two positions. The wind of a wave has the
direction and the strength at the position where the sensor meets it; there the phase
advances at another pace (`Heard.pace`), by which the integral over the sensor's clock
is multiplied. The downwash of a vehicle's rotors is not included.
"""

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Float, Int, Key

from jblast.errors import InputError, shown
from jblast.scene import Scene, Sensor
from jblast.sensors.arrivals import Track, heard
from jblast.sensors.gauge import (
    Mounted,
    check_kind,
    edges_of,
    mounted,
    rate_of,
    seen_in_block,
)
from jblast.sensors.instrument import chain_block
from jblast.sensors.samples import (
    BLOCK,
    Packet,
    block_start,
    first_samples,
    packets,
    sample_count,
)
from jblast.sensors.wave_paths import Heard
from jblast.types import as_float_array
from jblast.waves.propagation import air_density, ambient, sound_speed_of
from jblast.waves.pulse import Pulse, pulse_mean
from jblast.waves.shock import plane_wave_wind


class Gust(NamedTuple):
    """Wind of one wave, along one axis.

    Attributes:
        pulse: Its pressure, on the common clock; its whole impulse is zero.
        afterflow: Direction cosine times pace over density and distance [m2/kg].
        sound_speed: Direction cosine times $c_0$ [m/s].
        ambient_pressure: $P_0$ [Pa].
    """

    pulse: Pulse
    afterflow: Float[Array, ""]
    sound_speed: Float[Array, ""]
    ambient_pressure: Float[Array, ""]


class Axis(NamedTuple):
    """One axis of an anemometer in a scene, prepared for sampling.

    Attributes:
        gauge: Instrument and clock.
        gusts: Wind of every wave.
        wind: Wind of the scene [m/s].
        moved: Times on the common clock [s] and coordinates [m] of the knots of a
            moving sensor; None for a fixed one.
    """

    gauge: Mounted
    gusts: tuple[Gust, ...]
    wind: Float[Array, ""]
    moved: tuple[Float[Array, " knot"], Float[Array, " knot"]] | None


def record(
    scene: Scene,
    anemometer: Sensor,
    duration_s: float,
    key: Key[Array, ""],
    *,
    start_s: Float[ArrayLike, ""] = 0.0,
    laws: Mapping[str, str] | None = None,
    track: Track | None = None,
) -> Float[Array, "sample 3"]:
    """Return the wind recorded by an anemometer towards east, north and up [m/s].

    Each axis has its own instrument chain. Pure, for jit, vmap and grad; only the
    duration is static.

    Args:
        scene: Charges, air, ground and sensors.
        anemometer: Sensor with position, clock and instrument.
        duration_s: Length of the record [s].
        key: Random key of its noise.
        start_s: Start of the first sample on its clock [s].
        laws: By quantity; absent ones as for `arrivals.heard`.
        track: Positions over time on the common clock, instead of its position.

    Raises:
        InputError: The sensor is no anemometer, is underground, or is at a charge, or a
            charge has a range instead of a position.

    Example:
        `anemometer.record(scene, scene.sensors[0], 0.1, jax.random.key(0))`
    """
    n = sample_count(duration_s, rate_of(anemometer))
    axes, states = _start(scene, anemometer, key, start_s, laws, track)
    columns = [
        first_samples(_block, axis, state, n)
        for axis, state in zip(axes, states, strict=True)
    ]
    return jnp.stack(columns, axis=1)


def stream(
    scene: Scene,
    anemometer: Sensor,
    key: Key[Array, ""],
    *,
    packet_s: float | None = None,
    packets_hz: float | None = None,
    start_s: float = 0.0,
    laws: Mapping[str, str] | None = None,
    track: Track | None = None,
) -> Iterator[Packet]:
    """Yield an anemometer's record in packets, without end; otherwise as `record`."""
    axes, states = _start(scene, anemometer, key, start_s, laws, track)
    timing = {"packet_s": packet_s, "packets_hz": packets_hz, "start_s": start_s}
    streams = [
        packets(_block, axis, state, rate_of(anemometer), **timing)
        for axis, state in zip(axes, states, strict=True)
    ]
    return (
        parts[0]._replace(samples=np.stack([part.samples for part in parts], axis=1))
        for parts in zip(*streams, strict=True)
    )


def _start(
    scene: Scene,
    anemometer: Sensor,
    key: Key[Array, ""],
    start_s: Float[ArrayLike, ""],
    laws: Mapping[str, str] | None,
    track: Track | None,
) -> tuple[list[Axis], list[Any]]:
    check_kind(anemometer, "anemometer", track=track)
    if any(charge.range_m is not None for charge in scene.charges):
        raise InputError(
            f"sensor {shown(anemometer.name)}: expected charges with a position, which "
            "defines the direction of the wind, got one with a range only"
        )
    place = as_float_array(anemometer.position_m) if track is None else track
    waves = heard(scene, place, laws)
    gusts = _gusts(scene, place, waves)
    moved = (
        [None] * 3
        if track is None
        else [(track.time, track.position[:, axis]) for axis in range(3)]
    )
    air = scene.air
    # the scene's wind is horizontal
    winds = (air.wind_east, air.wind_north, jnp.zeros_like(air.wind_east))
    gauges = [mounted(anemometer, one, start_s) for one in jax.random.split(key, 3)]
    axes = [
        Axis(gauge, of_axis, wind, knots)
        for (gauge, _), of_axis, wind, knots in zip(
            gauges, gusts, winds, moved, strict=True
        )
    ]
    return axes, [state for _, state in gauges]


@eqx.filter_jit
def _gusts(
    scene: Scene, place: Float[Array, "3"] | Track, waves: tuple[Heard, ...]
) -> tuple[tuple[Gust, ...], ...]:
    """Return the wind of every wave, by axis.

    Suction lasts until the wave's impulse is zero: the mean of its shape is 9/16 of its
    peak, hence the factor 16/9.
    """
    temperature, pressure = ambient(scene.air)
    density = air_density(temperature, pressure, scene.air.relative_humidity)
    axes: list[tuple[Gust, ...]] = [(), (), ()]
    for wave in waves:
        charge = scene.charges[wave.shot]
        # the reflected wave comes from the image below the ground
        up = charge.up if wave.kind == "air" else -charge.up
        source = jnp.stack([charge.east, charge.north, up])
        pulse = wave.pulse
        position = place.at(pulse.arrival_time) if isinstance(place, Track) else place
        away = (position - source) / wave.distance
        still = pulse._replace(arrival_time=jnp.zeros_like(pulse.arrival_time))
        impulse = pulse.duration * pulse_mean(still, 0.0, pulse.duration)
        silent = pulse.suction == 0.0  # an absent wave has no suction to divide by
        lasting = 16.0 / 9.0 * impulse / jnp.where(silent, 1.0, pulse.suction)
        pulse = pulse._replace(
            suction_duration=jnp.where(silent, pulse.suction_duration, lasting)
        )
        for axis in range(3):
            share = away[axis]
            gust = Gust(
                pulse,
                share * wave.pace / (density * wave.distance),
                share * sound_speed_of(scene.air),
                pressure,
            )
            axes[axis] = (*axes[axis], gust)
    return tuple(axes)


def _block(
    axis: Axis, state: Any, index: Int[Array, ""]
) -> tuple[Any, Float[Array, " sample"]]:
    gauge = axis.gauge
    rate = gauge.chain.instrument.rate
    edges = edges_of(rate)
    wind = jnp.broadcast_to(axis.wind, (BLOCK,))
    if axis.moved is not None:
        knots, places = axis.moved
        # subtracted one by one, so that float32 resolves times within the block
        for shift in (gauge.begin, *block_start(index, rate)):
            knots = knots - shift
        wind = wind - rate * jnp.diff(jnp.interp(edges, knots, places))
    for gust in axis.gusts:
        pulse = seen_in_block(gust.pulse, gauge, index)
        x = pulse_mean(pulse, edges[:-1], edges[1:]) / gust.ambient_pressure
        # from a sample's mean pressure, not its mean wind: they differ at fronts only
        plane = plane_wave_wind(x, gust.sound_speed)
        middle = 0.5 * (edges[:-1] + edges[1:]) - pulse.arrival_time
        still = pulse._replace(arrival_time=jnp.zeros_like(pulse.arrival_time))
        # mean over an empty interval would be 0 / 0 before the arrival
        passed = jnp.where(middle > 0, middle, 1.0)
        mean = pulse_mean(still, jnp.zeros_like(passed), passed)
        wind = wind + plane + gust.afterflow * jnp.where(middle > 0, passed * mean, 0.0)
    return chain_block(gauge.chain, state, index, wind)
