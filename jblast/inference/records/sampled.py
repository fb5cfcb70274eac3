"""Records made ready to stand in a likelihood with their samples."""

from collections.abc import Sequence
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jblast.inference.picks.fit.lanes import CHANCE, with_what_shows
from jblast.inference.picks.fit.model import data_misfit, misfit, readings
from jblast.inference.picks.fit.optimum import optimum_of
from jblast.inference.picks.fit.posterior import NARROW, WIDE
from jblast.inference.picks.ready.bins import bins_about_front
from jblast.inference.picks.ready.case import prepared
from jblast.inference.picks.ready.clipped import clipped_samples
from jblast.inference.picks.ready.start import bank_of
from jblast.inference.picks.unknowns import CENTRE, SPREAD, natural_of
from jblast.inference.posterior.correlated_errors import own_and_shared_errors
from jblast.inference.posterior.record_likelihood import SampledRecords, evidence
from jblast.inference.records.covariance import TOLD
from jblast.inference.records.pulse_terms import ASKED, PulseTerms, SampledCase
from jblast.observations import Observations
from jblast.observations.records.pressure_record import PressureRecord

LONGEST = 65536
"""Of a longer record the stretch about its largest sample counts."""
UNRESOLVED = 0.1
"""Standard deviation of ln of a rise within two samples, about the pick's: samples do
not tell it from the arrival, whose error then has the part of a sample."""
NONE = 1e-9
"""Corner in place of none, where another record has a high-pass [Hz]."""
BEFORE = 0.25
"""Share of that stretch that lies before the largest sample."""


def sampled_records(
    observations: Observations, records: Sequence[tuple[str, PressureRecord]]
) -> SampledRecords:
    """Put samples in place of the rows that were picked of them.

    Args:
        observations: A log with four rows of each record.
        records: By what the log calls them.
    """
    cut = [_stretch(record) for _, record in records]
    length = max(512, 1 << (max(one.samples.size for one in cut) - 1).bit_length())
    high_passed = any(one.high_pass_hz for one in cut)
    ready = _plain([_case(one, length, high_passed) for one in cut])
    case: SampledCase = jax.tree.map(lambda *x: jnp.stack(x), *[c for c, _ in ready])
    terms = PulseTerms(length)
    nuisance = case.unknowns[:, ASKED:]
    rows = _rows(observations, [name for name, _ in records])
    natural = jax.vmap(natural_of)(case.unknowns)
    unresolved = jnp.clip((WIDE - natural.rise) / (WIDE - NARROW), 0.0, 1.0)
    between = jnp.sqrt(unresolved / 12.0) / case.rate
    return SampledRecords(
        terms=terms,
        rows=rows,
        case=case,
        picked=jnp.stack([picked for _, picked in ready]),
        nuisance=nuisance,
        jitter=jnp.zeros((len(cut), ASKED)).at[:, 0].set(between),
        evidence=_evidence(terms, nuisance, case),
        error_columns=_errors_of_others(observations, rows),
    )


@partial(jax.jit, static_argnums=0)
def _evidence(terms, nuisance, case):
    return jax.vmap(lambda n, c: evidence(terms, n, c, ASKED))(nuisance, case)


def _stretch(record: PressureRecord) -> PressureRecord:
    """Return what of a record counts."""
    spare = record.samples.size - LONGEST
    if spare <= 0:
        return record
    largest = int(np.argmax(np.abs(record.samples - np.median(record.samples))))
    begin = int(np.clip(largest - int(BEFORE * LONGEST), 0, spare))
    return PressureRecord(
        record.name,
        record.samples[begin : begin + LONGEST],
        record.rate_hz,
        start_s=record.start_s + begin / record.rate_hz,
        full_scale=record.full_scale,
        high_pass_hz=record.high_pass_hz,
    )


def _case(
    record: PressureRecord, length: int, high_passed: bool
) -> tuple[SampledCase, Float[Array, "4"]]:
    """Return a record ready for its terms, and what its pick reads, as `comparable`."""
    size = record.samples.size
    samples = np.pad(record.samples, (0, length - size), mode="edge")[None]
    corner = None
    if high_passed:
        told = record.high_pass_hz or NONE
        corner = np.array([2 * np.pi * told / record.rate_hz])
    case, front, scale = _picked(samples, np.array([size]), record.full_scale, corner)
    natural = natural_of(case.unknowns)
    step = 1.0 / record.rate_hz
    picked = jnp.stack(
        [
            record.start_s + step * (front + natural.arrival),
            jnp.log(scale * natural.peak),
            jnp.log(step * natural.duration),
            jnp.log(scale * step * natural.impulse),
        ]
    )
    return case._replace(rate=jnp.asarray(record.rate_hz)), picked


@jax.jit
def _picked(samples, count, full_scale, corner):
    """Pick one record, and keep what it was made of."""
    bins = bins_about_front(samples.shape[1])
    bank = bank_of(bins, samples.shape[1])
    clipped = clipped_samples(samples, full_scale)
    ready = jax.vmap(partial(prepared, bins, bank))(samples, clipped, count, corner)
    of_record = partial(misfit, bins)
    first = optimum_of(of_record, ready.start, ready.case)
    best, cases = with_what_shows(bins, first, ready.case)
    one = jax.tree.map(lambda x: x[0], ready._replace(case=cases))
    freedom = jnp.maximum(readings(one.case) - float(CENTRE.size), 1.0)
    ratio = data_misfit(of_record(best.y[0], one.case), bins.first.size) / freedom
    chance = 1.0 + CHANCE * jnp.sqrt(2.0 / freedom)
    widened = jnp.sqrt(jnp.where(ratio > chance, ratio, 1.0))
    y = best.y[0]
    resolved = natural_of(y).rise >= WIDE
    rise = jnp.where(
        resolved,
        jnp.array([CENTRE[ASKED], SPREAD[ASKED]]),
        jnp.stack([y[ASKED], jnp.asarray(UNRESOLVED)]),
    )
    case = SampledCase(one.case, y, jnp.zeros(()), rise, widened)
    return case, one.front.sample.astype(y.dtype), one.scale


def _plain(ready: list[tuple[SampledCase, Array]]) -> list[tuple[SampledCase, Array]]:
    """Leave rings, further fronts and high-passes out where no record has any."""
    shown = [c.ready.rings + c.ready.follows + c.ready.passed for c, _ in ready]
    if any(float(one) > 0 for one in shown):
        return ready
    few = CENTRE.size
    return [
        (
            case._replace(
                ready=case.ready._replace(centre=case.ready.centre[:few]),
                unknowns=case.unknowns[:few],
            ),
            picked,
        )
        for case, picked in ready
    ]


def _rows(
    observations: Observations, names: Sequence[str]
) -> tuple[tuple[int, ...], ...]:
    """Return which rows of a log were picked of each record."""
    pairs = list(zip(observations.records(), observations.quantity, strict=True))
    return tuple(
        tuple(pairs.index((name, quantity)) for quantity in TOLD) for name in names
    )


def _errors_of_others(
    observations: Observations, rows: tuple[tuple[int, ...], ...]
) -> tuple[int, ...]:
    """Return which of the errors that rows share are of rows that are no samples."""
    _, shared = own_and_shared_errors(observations)
    shared[np.array(rows)] = 0.0
    return tuple(np.flatnonzero(shared.any(axis=0)).tolist())
