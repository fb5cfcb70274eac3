"""Ground velocity recorded by a geophone: the P wave of each charge.

Arrival, peak velocity and peak displacement are those of `sensors.record`. The laws
predict one component and do not specify which (`waves/laws/ground_motion.py`). It is
used as the vertical one, with a first motion upwards. Ground motion caused by the
passing air blast is not included.
"""

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Float, Int, Key

from jblast.scene import Scene, Sensor
from jblast.sensors.gauge import (
    Mounted,
    check_kind,
    edges_of,
    mounted,
    rate_of,
    seen_in_block,
)
from jblast.sensors.instrument import chain_block
from jblast.sensors.samples import BLOCK, Packet, first_samples, packets, sample_count
from jblast.sensors.wave_paths import ground_laws, ground_waves
from jblast.waves.pulse import GroundPulse, ground_pulse_velocity_mean

_waves = eqx.filter_jit(ground_waves)


class Geophone(NamedTuple):
    """A geophone in a scene, prepared for sampling.

    Attributes:
        gauge: Instrument and clock.
        waves: Waves in the ground, on the common clock.
    """

    gauge: Mounted
    waves: tuple[GroundPulse, ...]


def record(
    scene: Scene,
    geophone: Sensor,
    duration_s: float,
    key: Key[Array, ""],
    *,
    start_s: Float[ArrayLike, ""] = 0.0,
    laws: Mapping[str, str] | None = None,
) -> Float[Array, " sample"]:
    """Return the ground velocity recorded by a geophone [m/s], upwards.

    Pure, for jit, vmap and grad; only the duration is static.

    Args:
        scene: Charges, air, ground and sensors.
        geophone: Sensor with position, clock and instrument.
        duration_s: Length of the record [s].
        key: Random key of its noise.
        start_s: Start of the first sample on its clock [s].
        laws: By quantity; absent ones the scene's, else `DEFAULT_GROUND_LAWS`.

    Raises:
        InputError: The sensor is no geophone, or is above the ground.

    Example:
        `geophone.record(scene, scene.sensors[0], 1.0, jax.random.key(0))`
    """
    setup, state = _start(scene, geophone, key, start_s, laws)
    n = sample_count(duration_s, rate_of(geophone))
    return first_samples(_block, setup, state, n)


def stream(
    scene: Scene,
    geophone: Sensor,
    key: Key[Array, ""],
    *,
    packet_s: float | None = None,
    packets_hz: float | None = None,
    start_s: float = 0.0,
    laws: Mapping[str, str] | None = None,
) -> Iterator[Packet]:
    """Yield a geophone's record in packets, without end; otherwise as `record`."""
    setup, state = _start(scene, geophone, key, start_s, laws)
    timing = {"packet_s": packet_s, "packets_hz": packets_hz, "start_s": start_s}
    return packets(_block, setup, state, rate_of(geophone), **timing)


def _start(
    scene: Scene,
    geophone: Sensor,
    key: Key[Array, ""],
    start_s: Float[ArrayLike, ""],
    laws: Mapping[str, str] | None,
) -> tuple[Geophone, Any]:
    check_kind(geophone, "geophone")
    gauge, state = mounted(geophone, key, start_s)
    waves = _waves(scene, geophone.position_m, ground_laws(scene, laws))
    return Geophone(gauge, waves), state


def _block(
    geophone: Geophone, state: Any, index: Int[Array, ""]
) -> tuple[Any, Float[Array, " sample"]]:
    gauge = geophone.gauge
    edges = edges_of(gauge.chain.instrument.rate)
    # charges superpose: the ground is linear
    velocity = jnp.zeros(BLOCK)
    for wave in geophone.waves:
        # arrival on the block's own clock, which float32 resolves
        here = seen_in_block(wave, gauge, index)
        velocity += ground_pulse_velocity_mean(here, edges[:-1], edges[1:])
    return chain_block(gauge.chain, state, index, velocity)
