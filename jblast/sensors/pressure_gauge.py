r"""Overpressure recorded by a pressure gauge, side-on or face-on.

Side-on, the gauge does not disturb the wave, and records the wave of `sensors.record`.
Face-on, it is a large rigid wall: the pressure of each moment is reflected as Rankine
and Hugoniot reflect a front,

$$p_r = 2 p\,\frac{7 P_0 + 4 p}{7 P_0 + p}$$

which is exact at the front. Behind it, flow round the edge of a finite wall would
reduce the pressure. The instrument's corners set the band; the zero may drift.
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
    block_start,
    first_samples,
    packets,
    sample_count,
)
from jblast.types import as_float_array
from jblast.waves.propagation import ambient
from jblast.waves.pulse import Pulse, pulse_mean
from jblast.waves.shock import normally_reflected_pressure


class PressureGauge(NamedTuple):
    """A pressure gauge in a scene, prepared for sampling.

    Attributes:
        gauge: Instrument and clock.
        waves: Waves in the air, on the common clock.
        ambient_pressure: $P_0$ for reflection [Pa]; None for side-on.
        drift: Drift of its zero, from the first sample on [Pa/s].
    """

    gauge: Mounted
    waves: tuple[Pulse, ...]
    ambient_pressure: Float[Array, ""] | None
    drift: Float[Array, ""]


def record(
    scene: Scene,
    gauge: Sensor,
    duration_s: float,
    key: Key[Array, ""],
    *,
    start_s: Float[ArrayLike, ""] = 0.0,
    laws: Mapping[str, str] | None = None,
    mounting: str = "side-on",
    drift: Float[ArrayLike, ""] = 0.0,
    track: Track | None = None,
) -> Float[Array, " sample"]:
    """Return the overpressure recorded by a gauge [Pa].

    Pure, for jit, vmap and grad; only duration and mounting are static.

    Args:
        scene: Charges, air, ground and sensors.
        gauge: Sensor with position, clock and instrument.
        duration_s: Length of the record [s].
        key: Random key of its noise.
        start_s: Start of the first sample on its clock [s].
        laws: By quantity; absent ones as for `arrivals.heard`.
        mounting: "side-on" or "face-on".
        drift: Drift of its zero [Pa/s].
        track: Positions over time on the common clock, instead of its position.

    Raises:
        InputError: The sensor is no pressure gauge, is underground, or is at a charge.
        ValueError: The mounting is unknown.

    Example:
        `pressure_gauge.record(scene, scene.sensors[0], 0.1, jax.random.key(0))`
    """
    setup, state = _start(scene, gauge, key, start_s, laws, mounting, drift, track)
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
    mounting: str = "side-on",
    drift: float = 0.0,
    track: Track | None = None,
) -> Iterator[Packet]:
    """Yield a gauge's record in packets, without end; otherwise as `record`."""
    setup, state = _start(scene, gauge, key, start_s, laws, mounting, drift, track)
    timing = {"packet_s": packet_s, "packets_hz": packets_hz, "start_s": start_s}
    return packets(_block, setup, state, rate_of(gauge), **timing)


def _start(
    scene: Scene,
    sensor: Sensor,
    key: Key[Array, ""],
    start_s: Float[ArrayLike, ""],
    laws: Mapping[str, str] | None,
    mounting: str,
    drift: Float[ArrayLike, ""],
    track: Track | None,
) -> tuple[PressureGauge, Any]:
    check_kind(sensor, "pressure", track=track)
    if mounting not in ("side-on", "face-on"):
        raise ValueError(f"mounting: expected side-on or face-on, got {mounting!r}")
    gauge, state = mounted(sensor, key, start_s)
    place = sensor.position_m if track is None else track
    waves = tuple(wave.pulse for wave in heard(scene, place, laws))
    # only the reflection depends on the ambient pressure
    pressure = None if mounting == "side-on" else ambient(scene.air)[1]
    return PressureGauge(gauge, waves, pressure, as_float_array(drift)), state


def _block(
    setup: PressureGauge, state: Any, index: Int[Array, ""]
) -> tuple[Any, Float[Array, " sample"]]:
    gauge, still = setup.gauge, setup.ambient_pressure
    rate = gauge.chain.instrument.rate
    edges = edges_of(rate)
    pressure = jnp.zeros(BLOCK)
    for wave in setup.waves:
        p = pulse_mean(seen_in_block(wave, gauge, index), edges[:-1], edges[1:])
        if still is not None:
            # on the mean of a sample, which for a ramp within it is off to second order
            p = normally_reflected_pressure(p, still)
        pressure += p
    # whole seconds first: float32 resolves the sum of small times, not of a long clock
    whole, rest = block_start(index, rate)
    pressure += setup.drift * (whole + (rest + edges[:-1] + 0.5 / rate))
    return chain_block(gauge.chain, state, index, pressure)
