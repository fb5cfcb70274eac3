"""Kind, position, clock and instrument: common to all gauges."""

from typing import Any, NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, ArrayLike, Float, Int, Key

from jblast.errors import InputError, shown
from jblast.scene import Instrument, Sensor
from jblast.scene.sensor_kinds import SENSOR_KINDS
from jblast.sensors.arrivals import Track
from jblast.sensors.instrument import Chain, chain_start, instrument_chain
from jblast.sensors.pressure_history import AnyPulse, counted_from
from jblast.sensors.samples import BLOCK, block_start
from jblast.types import as_float_array


class Mounted(NamedTuple):
    """A gauge that is set up, all but what it measures.

    Attributes:
        chain: Its instrument.
        begin: Common clock at the first sample [s].
    """

    chain: Chain
    begin: Float[Array, ""]


def rate_of(sensor: Sensor) -> float:
    """Return the samples a second of a sensor [Hz]."""
    return (sensor.instrument or Instrument()).rate


def check_kind(sensor: Sensor, kind: str, *, track: Track | None = None) -> None:
    """Refuse a sensor of another kind, or on the wrong side of the ground.

    Args:
        sensor: The sensor.
        kind: What it should be.
        track: Where it is over time, instead of its position.

    Raises:
        InputError: It is; outside jit, as far as its height goes.
    """
    where = f"sensor {shown(sensor.name)}"
    if sensor.kind not in ("", kind):
        raise InputError(
            f"{where}: expected a sensor of kind {kind}, got {shown(sensor.kind)}"
        )
    places = sensor.position_m if track is None else track.position
    site = SENSOR_KINDS[kind].site
    if not site or isinstance(places, Tracer):
        return
    above = site == "above"
    heights = np.asarray(places)[..., 2]
    up = float(heights.min() if above else heights.max())
    if not (up >= 0 if above else up <= 0):
        raise InputError(
            f"{where}: expected a {kind} on the ground or {site} it, got {up:g} m up"
        )


def mounted(
    sensor: Sensor, key: Key[Array, ""], start_s: Float[ArrayLike, ""]
) -> tuple[Mounted, Any]:
    """Return a gauge that is set up, and the state of its instrument.

    Args:
        sensor: Its clock and its instrument.
        key: Random key of its noise.
        start_s: When the first sample begins, by the gauge's clock [s].
    """
    return _mounted(sensor, key, as_float_array(start_s))


@eqx.filter_jit
def _mounted(
    sensor: Sensor, key: Key[Array, ""], start_s: Float[Array, ""]
) -> tuple[Mounted, Any]:
    """Do it, by one program for all starts: a plain number would be another each."""
    chain = instrument_chain(sensor.instrument or Instrument(), key)
    return Mounted(chain, start_s - sensor.clock_offset_s), chain_start(chain)


def edges_of(rate: float) -> Float[Array, " edge"]:
    """Return where the samples of a block begin and end, from its start [s]."""
    return jnp.arange(BLOCK + 1, dtype=float) / rate


def seen_in_block(wave: AnyPulse, gauge: Mounted, index: Int[Array, ""]) -> AnyPulse:
    """Return a wave whose arrival, on the common clock, counts from a block's start."""
    since = block_start(index, gauge.chain.instrument.rate)
    return counted_from(wave, gauge.begin, *since)
