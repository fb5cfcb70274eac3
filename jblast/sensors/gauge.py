"""Common parts of sampling instruments, and the recorder of a plain signal.

Kind, position, clock and instrument are prepared here for all kinds. `sampled_by`
makes the recorder of a sensor that is a function of scene, sensor and times
(`scene.sensor_kinds`). The function defines the signal without errors, and the
instrument adds band, noise, full scale and bits. Records and streams consist of the
same blocks, so they are equal sample for sample.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, ArrayLike, Float, Int, Key

from jblast.errors import InputError, shown
from jblast.scene import Instrument, Scene, Sensor
from jblast.scene.sensor_kinds import SENSOR_KINDS
from jblast.sensors.arrivals import AnyPulse, Track, counted_from
from jblast.sensors.instrument import Chain, chain_block, chain_start, instrument_chain
from jblast.sensors.samples import (
    BLOCK,
    Packet,
    block_start,
    first_samples,
    packets,
    sample_count,
)
from jblast.types import as_float_array

Signal = Callable[[Scene, Sensor, Float[Array, " time"]], Float[Array, "time ..."]]
"""(scene, sensor, times on the common clock [s]) -> signal without errors, a row per
time and a column per component if there are several; pure."""


class Mounted(NamedTuple):
    """Instrument and clock of a gauge, prepared for sampling.

    Attributes:
        chain: Signal chain of its instrument.
        begin: Common clock at the first sample [s].
    """

    chain: Chain
    begin: Float[Array, ""]


def rate_of(sensor: Sensor) -> float:
    """Return the sampling rate of a sensor [Hz]."""
    return (sensor.instrument or Instrument()).rate


def check_kind(sensor: Sensor, kind: str, *, track: Track | None = None) -> None:
    """Reject a sensor of another kind, or on the wrong side of the ground.

    Args:
        sensor: The sensor.
        kind: Expected kind.
        track: Positions over time, instead of its position.

    Raises:
        InputError: The kind or the site is wrong; the site is checked outside jit only.
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
    # NaN heights are rejected by the negated comparison below
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
    """Return a prepared gauge, and the initial state of its instrument.

    Args:
        sensor: Sensor with clock and instrument.
        key: Random key of its noise.
        start_s: Start of the first sample on the gauge's clock [s].
    """
    return _mounted(sensor, key, as_float_array(start_s))


@eqx.filter_jit
def _mounted(
    sensor: Sensor, key: Key[Array, ""], start_s: Float[Array, ""]
) -> tuple[Mounted, Any]:
    """Prepare a gauge; the start is an array, so that all starts share one program."""
    chain = instrument_chain(sensor.instrument or Instrument(), key)
    return Mounted(chain, start_s - sensor.clock_offset_s), chain_start(chain)


def edges_of(rate: float) -> Float[Array, " edge"]:
    """Return the bounds of a block's samples, from its start [s]."""
    return jnp.arange(BLOCK + 1, dtype=float) / rate


def seen_in_block(wave: AnyPulse, gauge: Mounted, index: Int[Array, ""]) -> AnyPulse:
    """Return a wave whose arrival is counted from a block's start."""
    since = block_start(index, gauge.chain.instrument.rate)
    return counted_from(wave, gauge.begin, *since)


class SampledRecorder(NamedTuple):
    """Recorder of a kind of sensor; see `scene.sensor_kinds.Recorder`."""

    record: Callable[..., Float[Array, "sample ..."]]
    stream: Callable[..., Iterator[Packet]]


class _Component(eqx.Module):
    """One component of a sensor in a scene, prepared for sampling."""

    gauge: Mounted
    scene: Scene
    sensor: Sensor
    signal: Signal = eqx.field(static=True)
    number: int = eqx.field(static=True)


def sampled_by(signal: Signal) -> SampledRecorder:
    """Return the recorder of a signal.

    The sensor is fixed: its kind states why it is `unmounted`. A sample is the signal
    in the middle of its interval. Times are single numbers: in single precision those
    of a record of many seconds do not resolve microseconds.

    Args:
        signal: Function of scene, sensor and times.

    Example:
        `SensorKind(name="lamp", recorder=sampled_by(brightness), ...)`
    """

    def record(
        scene: Scene,
        sensor: Sensor,
        duration_s: float,
        key: Key[Array, ""],
        *,
        start_s: Float[ArrayLike, ""] = 0.0,
        laws: Mapping[str, str] | None = None,
        track: Track | None = None,
    ) -> Float[Array, "sample ..."]:
        n = sample_count(duration_s, rate_of(sensor))
        parts = _start(signal, scene, sensor, key, start_s, laws, track)
        columns = [first_samples(_block, one, state, n) for one, state in parts]
        return columns[0] if len(columns) == 1 else jnp.stack(columns, axis=1)

    def stream(
        scene: Scene,
        sensor: Sensor,
        key: Key[Array, ""],
        *,
        packet_s: float | None = None,
        packets_hz: float | None = None,
        start_s: float = 0.0,
        laws: Mapping[str, str] | None = None,
        track: Track | None = None,
    ) -> Iterator[Packet]:
        timing: dict[str, Any] = {"packet_s": packet_s, "packets_hz": packets_hz}
        streams = [
            packets(_block, one, state, rate_of(sensor), start_s=start_s, **timing)
            for one, state in _start(signal, scene, sensor, key, start_s, laws, track)
        ]
        if len(streams) == 1:
            return streams[0]
        return (
            parts[0]._replace(samples=np.stack([p.samples for p in parts], axis=1))
            for parts in zip(*streams, strict=True)
        )

    return SampledRecorder(record, stream)


def _start(
    signal: Signal,
    scene: Scene,
    sensor: Sensor,
    key: Key[Array, ""],
    start_s: Float[ArrayLike, ""],
    laws: Mapping[str, str] | None,
    track: Track | None,
) -> list[tuple[_Component, Any]]:
    """Return the components and the initial states of their instruments."""
    if track is not None:
        raise InputError(
            f"sensor {shown(sensor.name)}: expected a fixed sensor, got one on a "
            f"vehicle; a {sensor.kind} has one position only"
        )
    check_kind(sensor, sensor.kind)
    # the signal reads the names of all laws from the scene
    scene = replace(scene, law=tuple((dict(scene.law) | dict(laws or {})).items()))
    # the number of components is known without evaluating the signal
    shape = eqx.filter_eval_shape(signal, scene, sensor, jnp.zeros(BLOCK)).shape
    count = shape[1] if len(shape) > 1 else 1
    # independent noise of the components
    keys = [key] if count == 1 else jax.random.split(key, count)
    parts = []
    for number, one in enumerate(keys):
        gauge, state = mounted(sensor, one, start_s)
        parts.append((_Component(gauge, scene, sensor, signal, number), state))
    return parts


def _block(
    one: _Component, state: Any, index: Int[Array, ""]
) -> tuple[Any, Float[Array, " sample"]]:
    rate = one.gauge.chain.instrument.rate
    edges = edges_of(rate)
    whole, rest = block_start(index, rate)
    # large and small parts are added separately, which float32 resolves better
    middle = (one.gauge.begin + whole) + (rest + 0.5 * (edges[:-1] + edges[1:]))
    samples = one.signal(one.scene, one.sensor, middle)
    if samples.ndim > 1:
        samples = samples[:, one.number]
    return chain_block(one.gauge.chain, state, index, samples)
