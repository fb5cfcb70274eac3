"""The recorder of all sensors that sample: sources, instrument and blocks.

A record consists of the first samples of consecutive blocks of `BLOCK` samples. A
stream is the same blocks without end, cut into packets of another size. A block follows
from the state after the last one and its index, and random numbers depend only on a key
and the index, so record and stream are equal, sample for sample.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction
from itertools import count
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jax.core import Tracer
from jaxtyping import Array, ArrayLike, Float, Int, Key

from jblast.errors import InputError, argument, require, shown
from jblast.lazy import resolved
from jblast.scene import Instrument, Scene, Sensor
from jblast.scene.sensor_kinds import SENSOR_KINDS
from jblast.sensors.instrument import Chain, instrument_chain
from jblast.sensors.noise import BLOCK
from jblast.sensors.waves_met import Track
from jblast.types import as_numbers
from jblast.waves.pulse import AnyPulse, counted_from

LARGEST_RATE = 2**31 // BLOCK
"""Largest whole rate [Hz] at which the start of a block is exact in 32-bit integers."""


class Block(NamedTuple):
    """Clock of one block.

    Times within it count from its start, so that single precision resolves them.

    Attributes:
        number: Number of the block, from 0.
        begin: Common clock at the first sample of the record [s].
        rate: Samples per second [Hz].
    """

    number: Int[Array, ""]
    begin: Float[Array, ""]
    rate: float

    @property
    def edges(self) -> Float[Array, " edge"]:
        """Bounds of the samples, from the start of the block [s]."""
        return jnp.arange(BLOCK + 1, dtype=float) / self.rate

    @property
    def middle(self) -> Float[Array, " sample"]:
        """Middle of each sample, from the start of the block [s]."""
        return self.edges[:-1] + 0.5 / self.rate

    @property
    def times(self) -> Float[Array, " sample"]:
        """Middle of each sample on the common clock [s]."""
        whole, rest = block_start(self.number, self.rate)
        # large and small parts are added separately, which float32 resolves better
        return (self.begin + whole) + (rest + self.middle)

    def here(self, pulse: AnyPulse) -> AnyPulse:
        """Return a pulse whose arrival is counted from the start of the block."""
        return counted_from(pulse, self.begin, *block_start(self.number, self.rate))

    def since(self, track: Any) -> Float[Array, " knot"]:
        """Return the times of a track's knots from the start of the block [s]."""
        time = track.time - self.begin
        for part in block_start(self.number, self.rate):
            time = time - part
        return time


def block_start(
    index: Int[ArrayLike, ""], rate: float
) -> tuple[Float[Array, ""], Float[Array, ""]]:
    """Return the start of a block since the first one [s]: whole seconds and remainder.

    Two numbers, because after minutes single precision no longer resolves one sample.
    Subtract the first from a time, then the second.
    """
    index = jnp.asarray(index)
    # the general case: one rounded product, whose error does not accumulate
    if rate != int(rate) or rate > LARGEST_RATE:
        start = index.astype(float) * (BLOCK / rate)
        whole = jnp.floor(start)
        return whole, start - whole
    whole_rate = int(rate)
    # `rate` blocks last exactly BLOCK seconds, so the index is reduced modulo the rate
    cycle, place = index // whole_rate, (index % whole_rate).astype(jnp.uint32)
    sample = place * np.uint32(BLOCK)
    second, left = sample // np.uint32(whole_rate), sample % np.uint32(whole_rate)
    whole = cycle.astype(float) * BLOCK + second.astype(float)
    return whole, left.astype(float) / whole_rate


class Source(eqx.Module):
    """One summand of a signal, prepared for blocks."""

    def start(self) -> Any:
        """Return the state before the first block; None if it has none."""
        return None

    def span(self, rate: float) -> tuple[float, float]:
        """Return begin and end on the common clock [s]; it is zero outside."""
        return -math.inf, math.inf

    def block(self, state: Any, block: Block) -> tuple[Any, Float[Array, "sample ..."]]:
        """Return the next state, and the samples of a block.

        Args:
            state: State after the last block.
            block: Clock of the block.
        """
        raise NotImplementedError


class Recorder(eqx.Module):
    """A sensor in a scene, prepared for sampling.

    Attributes:
        sources: Summands of its signal.
        chains: Instrument of each component.
        begin: Common clock at the first sample [s].
        rate: Samples per second [Hz].
    """

    sources: tuple[Source, ...]
    chains: tuple[Chain, ...]
    begin: Float[Array, ""]
    rate: float = eqx.field(static=True)

    def samples(self, duration_s: float) -> Float[Array, "sample ..."]:
        """Return the record of a duration, in the unit of the sensor's kind.

        Pure, for jit, vmap and grad; only the duration is static.

        Args:
            duration_s: Length of the record [s].

        Raises:
            InputError: The duration is negative or not finite.
        """
        expected = "a finite time of 0 s or more"
        is_time = 0 <= duration_s < math.inf
        require(is_time, "duration_s", expected, f"{duration_s:g} s")
        n = round(duration_s * self.rate)
        _, made = _blocks(self, self._start(), jnp.arange(-(-n // BLOCK)))
        return self._shaped(made)[:n]

    def packets(self, packets_hz: float) -> Iterator[Float[np.ndarray, "sample ..."]]:
        """Return the record in packets, without end, in constant memory.

        If a packet's duration is no whole number of samples, its size varies by one:
        packet k starts with the first sample at or after k durations.

        Args:
            packets_hz: Packets per second [Hz].

        Raises:
            InputError: A packet would have no sample.
        """
        require(
            0 < packets_hz <= self.rate,
            argument("packets"),
            f"at most {self.rate:g} packets per second, one for each sample",
            f"{packets_hz:g}",
        )
        # fractions as they are written: sums of a float step would drift over hours
        return self._cut(Fraction(repr(self.rate)) / Fraction(repr(float(packets_hz))))

    def _cut(self, size: Fraction) -> Iterator[Float[np.ndarray, "sample ..."]]:
        """Yield packets of a size; a block is made when it is needed."""
        of_sources, of_chains = self._start()
        states, begin, lasts = list(of_sources), float(self.begin), BLOCK / self.rate
        spans = [source.span(self.rate) for source in self.sources]
        numbers, waiting, first = count(), self._shaped(np.zeros((0, 1))), 0
        for packet in count(1):
            last = math.ceil(packet * size)
            parts = [waiting]
            while sum(map(len, parts)) < last - first:
                number = next(numbers)
                start, stop = begin + number * lasts, begin + (number + 1) * lasts
                # Of a minute with eight blasts, a wave sounds in a hundredth. With all
                # waves in each block a microphone takes eight times as long.
                some = [n for n, (a, b) in enumerate(spans) if a < stop and b > start]
                own = tuple(self.sources[n] for n in some)
                awake = eqx.tree_at(lambda one: one.sources, self, own)
                state = tuple(states[n] for n in some), of_chains
                (after, of_chains), made = _blocks(awake, state, jnp.array([number]))
                for n, one in zip(some, after, strict=True):
                    states[n] = one
                parts.append(np.asarray(self._shaped(made)))
            waiting = np.concatenate(parts)
            yield waiting[: last - first]
            waiting, first = waiting[last - first :], last

    def _start(self) -> tuple[Any, Any]:
        """Return the states of sources and instruments before the first block."""
        return (
            tuple(source.start() for source in self.sources),
            tuple(chain.start() for chain in self.chains),
        )

    def _shaped(self, blocks: ArrayLike) -> Any:
        """Return samples of blocks in a row; one column for each of several."""
        several = len(self.chains)
        return jnp.reshape(blocks, (-1,) if several == 1 else (-1, several))


@eqx.filter_jit
def _blocks(
    recorder: Recorder, state: Any, indices: Int[Array, " block"]
) -> tuple[Any, Float[Array, "block sample component"]]:
    """Record some blocks; compiled once for each number of blocks."""
    return lax.scan(lambda state, index: _block(recorder, state, index), state, indices)


def _block(
    recorder: Recorder, state: Any, index: Int[Array, ""]
) -> tuple[Any, Float[Array, "sample component"]]:
    """Return the next state and the recorded samples of a block."""
    block = Block(index, recorder.begin, recorder.rate)
    total = jnp.zeros((BLOCK, len(recorder.chains)))
    of_sources, of_chains, columns = [], [], []
    for source, own in zip(recorder.sources, state[0], strict=True):
        own, part = source.block(own, block)
        of_sources.append(own)
        total = total + jnp.reshape(part, (BLOCK, -1))
    # the instrument is last: filter, noise and limits act on the total signal
    parts = zip(recorder.chains, state[1], total.T, strict=True)
    for chain, own, signal in parts:
        own, column = chain.recorded(own, index, signal)
        of_chains.append(own)
        columns.append(column)
    return (tuple(of_sources), tuple(of_chains)), jnp.stack(columns, axis=1)


def recording(
    scene: Scene,
    sensor: Sensor,
    key: Key[Array, ""],
    *,
    laws: Mapping[str, str] | None = None,
    track: Track | None = None,
    start_s: Float[ArrayLike, ""] = 0.0,
    more: Sequence[Source] = (),
) -> Recorder:
    """Return a sensor prepared for sampling; `samples` and `packets` record it.

    Pure, for jit, vmap and grad; values are checked outside jit only.

    Args:
        scene: Charges, air, ground and sensors.
        sensor: Sensor with kind, position, clock and instrument.
        key: Random key of all noise.
        laws: Law names by quantity; absent ones as in `record_laws`.
        track: Positions over time on the common clock, instead of its position.
        start_s: Start of the first sample on the sensor's clock [s].
        more: Further sources, such as `sources.Rotors`.

    Raises:
        InputError: The sensor's kind does not sample, the sensor is on the wrong side
            of the ground or at a charge, cannot be mounted, or as in `waves`.

    Example:
        `recording(scene, scene.sensors[0], jax.random.key(0)).samples(1.0)`
    """
    kind, where = SENSOR_KINDS.named(sensor.kind), f"sensor {shown(sensor.name)}"
    require(kind.sources, where, "a kind that samples", shown(kind.name))
    place = sensor.position_m if track is None else track
    got = f"one on a vehicle; a {kind.name} has one position only"
    require(track is None or not kind.unmounted, where, "a fixed sensor", got)
    _check_site(sensor.position_m if track is None else track.position, kind, where)
    start = as_numbers(start_s)
    known = isinstance(start, Tracer) or bool(np.isfinite(start))
    require(known, where, "a finite start_s", f"{start} s")
    # one key per source: adding one does not change the others
    *keys, last = jax.random.split(key, 4)
    instrument, several = sensor.instrument or Instrument(), len(kind.columns)
    own = [last] if several == 1 else [*jax.random.split(last, several)]
    try:
        sources = resolved(kind.sources)(scene, sensor, place, laws, keys)
        chains = tuple(instrument_chain(instrument, one) for one in own)
    except InputError as error:
        raise InputError(f"{where}: {error}") from None
    begin = start - sensor.clock_offset_s
    return Recorder((*sources, *more), chains, begin, instrument.rate)


def _check_site(places: Float[Array, "..."], kind: Any, where: str) -> None:
    """Reject a sensor on the wrong side of the ground."""
    if not kind.site or isinstance(places, Tracer):
        return
    heights = np.asarray(places)[..., 2]
    above = kind.site == "above"
    up = float(heights.min() if above else heights.max())
    expected = f"a {kind.name} on the ground or {kind.site} it"
    # NaN heights are rejected by both comparisons
    require(up >= 0 if above else up <= 0, where, expected, f"{up:g} m up")
