"""What one blast does to the air at an entity, sampled: stretches, not silence.

Samples are those of `sensors.microphone.record` and `sensors.pressure_gauge.record` for
an instrument that adds nothing, at the same instants. Between the waves of a blast, and
where less than `SILENCE_PA` is left of them, nothing is kept.
"""

import math
from types import ModuleType

import jax
import numpy as np

from jblast.scene import Instrument, Scene, Sensor
from jblast.sensors import Heard, Track, heard, microphone, pressure_gauge
from jblast.sensors.signal.blocks import BLOCK
from jblast.waves.propagation.absorption_filter import TAIL_S
from jblast.waves.waveform.ground_pulse import GroundPulse
from jblast.world.server.payload import Record

SILENCE_PA = 1e-9
"""What is quieter at either end of a stretch is left out: 86 dB below what is heard."""
GROUND_LASTS = 50.0
"""Time constants of a pulse in the ground until it is over, u^2 exp(-u) = 5e-19."""
RECORDERS: dict[str, ModuleType] = {"pressure": pressure_gauge, "sound": microphone}
KINDS = {"pressure": "pressure", "sound": "microphone"}


def records_of(
    scene: Scene,
    place: np.ndarray | Track,
    sense: str,
    rate_hz: float,
    laws: dict[str, str],
) -> tuple[Record, ...]:
    """Return what one blast makes of pressure at a place, in order of time.

    Args:
        scene: Of this one blast.
        place: East, north, up [m], or where that is over time.
        sense: "pressure", or "sound", which hears the ground and what air absorbs, too.
        rate_hz: Samples a second.
        laws: By quantity.
    """
    track = place if isinstance(place, Track) else None
    start = place.position[0] if isinstance(place, Track) else place
    sensor = Sensor(
        "", np.asarray(start), kind=KINDS[sense], instrument=Instrument(rate=rate_hz)
    )
    waves = heard(scene, place, laws, ground=sense == "sound")
    tail = TAIL_S if sense == "sound" else 0.0
    found = []
    for first, last in _stretches(waves, rate_hz, tail):
        size = BLOCK * 2 ** math.ceil(math.log2(max((last - first) / BLOCK, 1.0)))
        samples = RECORDERS[sense].record(
            scene,
            sensor,
            size / rate_hz,
            jax.random.key(0),
            start_s=first / rate_hz,
            laws=laws,
            track=track,
        )
        found.append(_heard_part(first, rate_hz, np.asarray(samples)[: last - first]))
    return tuple(record for record in found if record.samples.size)


def _stretches(
    waves: tuple[Heard, ...], rate_hz: float, tail_s: float
) -> list[tuple[int, int]]:
    """Return first samples, and those after the last, that waves come in."""
    spans = sorted(
        (arrival, arrival + lasts + tail_s)
        for arrival, lasts in (_span(wave) for wave in waves)
        if math.isfinite(arrival)
    )
    found: list[tuple[int, int]] = []
    for begin, end in spans:
        first, last = math.floor(begin * rate_hz), math.ceil(end * rate_hz) + 1
        if found and first <= found[-1][1]:
            found[-1] = found[-1][0], max(found[-1][1], last)
        else:
            found.append((first, last))
    return found


def _span(wave: Heard) -> tuple[float, float]:
    """Return when a wave comes, and how long it lasts [s]."""
    pulse = wave.pulse
    if isinstance(pulse, GroundPulse):
        if not float(pulse.amplitude) > 0:
            return math.inf, 0.0
        return float(pulse.arrival_time), GROUND_LASTS * float(pulse.time_constant)
    return float(pulse.arrival_time), float(pulse.duration + pulse.suction_duration)


def _heard_part(first: int, rate_hz: float, samples: np.ndarray) -> Record:
    """Leave out what is silent at either end."""
    loud = np.flatnonzero(np.abs(samples) >= SILENCE_PA)
    if not loud.size:
        return Record(first, rate_hz, samples[:0])
    begin, end = int(loud[0]), int(loud[-1]) + 1
    return Record(first + begin, rate_hz, samples[begin:end].copy())
