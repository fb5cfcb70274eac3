"""Samples of every kind of sensor that writes some, whole or packet by packet."""

from collections.abc import Iterator
from types import ModuleType

import jax
import numpy as np
from jaxtyping import ArrayLike, Float

from jblast.errors import InputError, argument, shown
from jblast.scene import Sensor
from jblast.sensors import microphone
from jblast.sensors.gauge import anemometer, geophone, pressure_gauge
from jblast.sensors.listening.plan import Listening, instrument_of, samples_of

RECORDERS: dict[str, ModuleType] = {
    "microphone": microphone,
    "pressure": pressure_gauge,
    "anemometer": anemometer,
    "geophone": geophone,
}
"""What records the sensors of a kind: each has `record` and `stream`."""


def packets(
    listening: Listening, sensor: Sensor, packets_hz: float | None = None
) -> Iterator[Float[np.ndarray, "sample component"]]:
    """Yield a sensor's samples, in Pa or m/s, as many as its record has.

    Args:
        listening: What is to be recorded.
        sensor: One of its sensors.
        packets_hz: Packets a second; None: all samples at once.

    Raises:
        InputError: A packet would hold no sample.
    """
    rate_hz, left = instrument_of(sensor).rate, samples_of(listening, sensor)
    if packets_hz is not None and packets_hz > rate_hz:
        raise InputError(
            f"{argument('packets')}: expected at most {rate_hz:g} packets a second, "
            f"the samples of sensor {sensor.name!r}, got {packets_hz:g}"
        )
    recorder = RECORDERS[sensor.kind]
    number = [other.name for other in listening.sensors].index(sensor.name)
    key = jax.random.fold_in(listening.key, number)
    scene, laws = listening.heard_by(sensor)
    carried = {}  # those that can ride along take a track
    if sensor.name in listening.tracks:
        carried = {"track": listening.tracks[sensor.name]}
    try:
        if packets_hz is None:
            samples = recorder.record(
                scene, sensor, listening.seconds, key, laws=laws, **carried
            )
            yield _by_component(samples)
            return
        stream = recorder.stream(
            scene, sensor, key, packets_hz=packets_hz, laws=laws, **carried
        )
    except InputError as error:
        if shown(sensor.name) in str(error):
            raise
        raise InputError(f"sensor {sensor.name!r}: {error}") from None
    for packet in stream:
        samples = _by_component(packet.samples)[:left]
        yield samples
        left -= len(samples)
        if left <= 0:
            return


def _by_component(samples: ArrayLike) -> Float[np.ndarray, "sample component"]:
    """Return samples with a column for each component: pressure has one, wind three."""
    samples = np.asarray(samples)
    return samples[:, None] if samples.ndim == 1 else samples
