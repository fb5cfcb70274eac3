"""Overpressure recorded by a pressure gauge, side-on.

The gauge does not disturb the wave, and records the wave of `sensors.record`. The
instrument's corners set the band.
"""

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Float, Int, Key

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
    first_samples,
    packets,
    sample_count,
)
from jblast.waves.pulse import Pulse, pulse_mean


class PressureGauge(NamedTuple):
    """A pressure gauge in a scene, prepared for sampling.

    Attributes:
        gauge: Instrument and clock.
        waves: Waves in the air, on the common clock.
    """

    gauge: Mounted
    waves: tuple[Pulse, ...]


def record(
    scene: Scene,
    gauge: Sensor,
    duration_s: float,
    key: Key[Array, ""],
    *,
    start_s: Float[ArrayLike, ""] = 0.0,
    laws: Mapping[str, str] | None = None,
    track: Track | None = None,
) -> Float[Array, " sample"]:
    """Return the overpressure recorded by a gauge [Pa].

    Pure, for jit, vmap and grad; only the duration is static.

    Args:
        scene: Charges, air, ground and sensors.
        gauge: Sensor with position, clock and instrument.
        duration_s: Length of the record [s].
        key: Random key of its noise.
        start_s: Start of the first sample on its clock [s].
        laws: By quantity; absent ones as for `arrivals.heard`.
        track: Positions over time on the common clock, instead of its position.

    Raises:
        InputError: The sensor is no pressure gauge, is underground, or is at a charge.

    Example:
        `pressure_gauge.record(scene, scene.sensors[0], 0.1, jax.random.key(0))`
    """
    setup, state = _start(scene, gauge, key, start_s, laws, track)
    n = sample_count(duration_s, rate_of(gauge))
    return first_samples(_block, setup, state, n)


def stream(
    scene: Scene,
    gauge: Sensor,
    key: Key[Array, ""],
    *,
    packet_s: float | None = None,
    packets_hz: float | None = None,
    start_s: float = 0.0,
    laws: Mapping[str, str] | None = None,
    track: Track | None = None,
) -> Iterator[Packet]:
    """Yield a gauge's record in packets, without end; otherwise as `record`."""
    setup, state = _start(scene, gauge, key, start_s, laws, track)
    timing = {"packet_s": packet_s, "packets_hz": packets_hz, "start_s": start_s}
    return packets(_block, setup, state, rate_of(gauge), **timing)


def _start(
    scene: Scene,
    sensor: Sensor,
    key: Key[Array, ""],
    start_s: Float[ArrayLike, ""],
    laws: Mapping[str, str] | None,
    track: Track | None,
) -> tuple[PressureGauge, Any]:
    check_kind(sensor, "pressure", track=track)
    gauge, state = mounted(sensor, key, start_s)
    place = sensor.position_m if track is None else track
    waves = tuple(wave.pulse for wave in heard(scene, place, laws))
    return PressureGauge(gauge, waves), state


def _block(
    setup: PressureGauge, state: Any, index: Int[Array, ""]
) -> tuple[Any, Float[Array, " sample"]]:
    gauge = setup.gauge
    edges = edges_of(gauge.chain.instrument.rate)
    pressure = jnp.zeros(BLOCK)
    for wave in setup.waves:
        here = seen_in_block(wave, gauge, index)
        pressure += pulse_mean(here, edges[:-1], edges[1:])
    return chain_block(gauge.chain, state, index, pressure)
