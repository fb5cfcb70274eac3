"""Records and streams of a sensor that is a function of scene, sensor and times.

The simplest recorder of a kind of sensor (`scene.sensor_kinds`): the function gives the
signal without errors, and the sensor's instrument gives band, noise, full scale and
bits, as for the sensors of the package. Records and streams are the same blocks, so
they are equal sample for sample.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Float, Int, Key

from jblast.errors import InputError, shown
from jblast.scene import Scene, Sensor
from jblast.sensors.arrivals import Track
from jblast.sensors.gauge import Mounted, check_kind, edges_of, mounted, rate_of
from jblast.sensors.instrument import chain_block
from jblast.sensors.samples import (
    BLOCK,
    Packet,
    block_start,
    first_samples,
    packets,
    sample_count,
)

Signal = Callable[[Scene, Sensor, Float[Array, " time"]], Float[Array, "time ..."]]
"""(scene, sensor, times on the common clock [s]) -> signal without errors, a row for
each time and a column for each component if there are several; pure."""


class SampledRecorder(NamedTuple):
    """Recorder of a kind of sensor, see `scene.sensor_kinds.Recorder`."""

    record: Callable[..., Float[Array, "sample ..."]]
    stream: Callable[..., Iterator[Packet]]


class _Component(eqx.Module):
    """One component of a sensor in a scene, set up to be sampled."""

    gauge: Mounted
    scene: Scene
    sensor: Sensor
    signal: Signal = eqx.field(static=True)
    number: int = eqx.field(static=True)


def sampled_by(signal: Signal) -> SampledRecorder:
    """Return the recorder of a signal.

    The sensor is at rest: its kind states why it is `unmounted`. A sample is the signal
    in the middle of its interval. Times are single numbers: in single precision those
    of a record of many seconds no longer resolve microseconds.

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
        rate, size = rate_of(sensor), {"packet_s": packet_s, "packets_hz": packets_hz}
        streams = [
            packets(_block, one, state, rate, start_s=start_s, **size)
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
    """Return the components and the states of their instruments."""
    if track is not None:
        raise InputError(
            f"sensor {shown(sensor.name)}: expected a sensor at rest, got one on a "
            f"vehicle, where a {sensor.kind} has one position only"
        )
    check_kind(sensor, sensor.kind)
    # the signal finds the names of all laws in the scene
    scene = replace(scene, law=tuple((dict(scene.law) | dict(laws or {})).items()))
    shape = eqx.filter_eval_shape(signal, scene, sensor, jnp.zeros(BLOCK)).shape
    count = shape[1] if len(shape) > 1 else 1
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
    middle = (one.gauge.begin + whole) + (rest + 0.5 * (edges[:-1] + edges[1:]))
    samples = one.signal(one.scene, one.sensor, middle)
    if samples.ndim > 1:
        samples = samples[:, one.number]
    return chain_block(one.gauge.chain, state, index, samples)
