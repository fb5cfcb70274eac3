r"""Samples of records in a likelihood, in place of rows picked from them.

The likelihood of a record's samples is a function of arrival, ln peak, ln duration and
ln impulse by the laws, each relative to the pick. The decay follows from them:
$k = (i/P - \tau/2)/(t_d - \tau)$ is the impulse behind the rise over peak and duration.
The other unknowns of the pick are nuisances.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jblast.inference.posterior.posterior import own_and_shared_errors
from jblast.inference.posterior.record_likelihood import SampledRecords, evidence
from jblast.kept_programs import kept
from jblast.observations import Observations
from jblast.observations.records.recording import PressureRecord
from jblast.observations.table import RECORD_QUANTITIES
from jblast.signals.picks.forms import with_forms
from jblast.signals.picks.hypotheses import unstated_high_pass, with_further_effects
from jblast.signals.picks.model import larger_misfit_ratio, misfit
from jblast.signals.picks.pick import filled_length
from jblast.signals.picks.preparation import (
    Case,
    bank_of,
    bins_about_front,
    clipped_samples,
    prepared,
)
from jblast.signals.picks.record_picks import LONGEST_STRETCH, RecordPick, stretch_begin
from jblast.signals.picks.searches import first_optimum
from jblast.signals.picks.unknowns import (
    CENTRE,
    RESOLVED_RISE_SAMPLES,
    SPREAD,
    UNRESOLVED_RISE_SAMPLES,
    natural_of,
)
from jblast.waves.pulse import LEVEL
from jblast.waves.waveform import decay_of_fraction

UNRESOLVED = 0.1
"""Standard deviation of ln of a rise below two samples, about that of the pick. Samples
do not separate it from the arrival, whose error then contains part of a sample."""
NO_HIGH_PASS = 1e-9
"""Corner of a record without a high-pass, if another record has one [Hz]: a period of
30 years."""
PRIMARY = 4
"""Number of primary unknowns of a pick, which are its first. The last of them, the
decay, is determined by the impulse."""
LEAST_FRACTION = 1e-4
"""Distance of the impulse fraction from the limits of a pulse, which no finite decay
reaches."""
RISES = (1.0, 2.0, 4.0), (0.05, 0.15, 0.4)
"""Starting rises of the two searches [samples]: fronts that samples resolve, and fronts
that rise within one sample."""


def sampled_records(
    observations: Observations, picks: Sequence[tuple[str, RecordPick]]
) -> SampledRecords:
    """Return the samples that replace the rows picked from them.

    Args:
        observations: A log with four rows of each record.
        picks: Picks of the records, with their names in the log.
    """
    cut = [_stretch(one.record) for _, one in picks]
    length = filled_length(max(one.samples.size for one in cut))
    high_passed = any(one.high_pass_hz for one in cut)
    # more than one pulse: rings, later fronts, an unstated high-pass
    more = any(
        bool(pick.resonating)
        or bool(np.isfinite(np.asarray(pick.later_arrivals_s)).any())
        or bool(pick.high_passed)
        for pick in (one.pick for _, one in picks)
    )
    ready = [_case(one, length, high_passed, more) for one in cut]
    case: SampledCase = jax.tree.map(lambda *x: jnp.stack(x), *[c for c, _ in ready])
    terms = PulseTerms(length)
    # in the order of a pick: the primary unknowns are the first
    nuisance = case.unknowns[:, PRIMARY:]
    rows = _rows(observations, [name for name, _ in picks])
    natural = jax.vmap(natural_of)(case.unknowns)
    unresolved = jnp.clip(
        (RESOLVED_RISE_SAMPLES - natural.rise)
        / (RESOLVED_RISE_SAMPLES - UNRESOLVED_RISE_SAMPLES),
        0.0,
        1.0,
    )
    # a front within one sample interval is uniform there: its variance is 1/12
    between = jnp.sqrt(unresolved / 12.0) / case.rate
    # columns of shared errors that rows without samples have
    _, shared = own_and_shared_errors(observations)
    shared[np.array(rows)] = 0.0
    return SampledRecords(
        terms=terms,
        trials=trial_nuisances,
        rows=rows,
        case=case,
        picked=jnp.stack([picked for _, picked in ready]),
        nuisance=nuisance,
        jitter=jnp.zeros((len(cut), PRIMARY)).at[:, 0].set(between),
        evidence=_evidence(terms, nuisance, case),
        error_columns=tuple(np.flatnonzero(shared.any(axis=0)).tolist()),
    )


class SampledCase(NamedTuple):
    """Argument of `PulseTerms`; times in samples, pressures relative to the largest.

    Attributes:
        ready: Samples prepared for a pick.
        unknowns: Unknowns of the pick.
        rate: Sampling rate [Hz].
        rise: Mean and standard deviation of the prior of ln of the rise.
        widened: Factor on the standard deviation of the noise before the front, from
            the residuals of the pulse.
    """

    ready: Case
    unknowns: Float[Array, " unknown"]
    rate: Float[Array, ""]
    rise: Float[Array, "2"]
    widened: Float[Array, ""]


@dataclass(frozen=True)
class PulseTerms:
    """Terms whose half square is minus ln of the probability of samples.

    Attributes:
        samples: Length to which records are padded.
    """

    samples: int

    def __call__(
        self,
        moved: Float[Array, " primary"],
        nuisance: Float[Array, " nuisance"],
        case: SampledCase,
    ) -> Float[Array, " term"]:
        """Return the residuals of the samples, then those of the priors of nuisances.

        Args:
            moved: Arrival [s], ln peak, ln duration and ln impulse minus the pick's.
            nuisance: The other unknowns.
            case: The record.
        """
        bins = bins_about_front(self.samples)
        apart = misfit(bins, unknowns_at(moved, nuisance, case), case.ready)
        last = bins.first.size
        believed = (
            apart[last + PRIMARY :]
            .at[0]
            .set((nuisance[0] - case.rise[0]) / case.rise[1])
        )
        return jnp.concatenate([apart[:last] / case.widened, believed])


@kept
def _evidence(terms: PulseTerms, nuisance, case: SampledCase):
    return jax.vmap(lambda n, c: evidence(terms, n, c, PRIMARY))(nuisance, case)


def _stretch(record: PressureRecord) -> PressureRecord:
    """Return the interval of a record that its pick uses."""
    if record.samples.size <= LONGEST_STRETCH:
        return record
    begin = stretch_begin(record, LONGEST_STRETCH)
    return PressureRecord(
        record.name,
        record.samples[begin : begin + LONGEST_STRETCH],
        record.rate_hz,
        start_s=record.start_s + begin / record.rate_hz,
        full_scale=record.full_scale,
        high_pass_hz=record.high_pass_hz,
    )


def _case(
    record: PressureRecord, length: int, high_passed: bool, more: bool
) -> tuple[SampledCase, Float[Array, "4"]]:
    """Return the case of a record, and its pick on the scale of errors."""
    size = record.samples.size
    samples = np.pad(record.samples, (0, length - size), mode="edge")
    corner = None
    if high_passed:
        hertz = record.high_pass_hz or NO_HIGH_PASS
        corner = np.array(2 * np.pi * hertz / record.rate_hz)
    level = record.full_scale
    case, front, scale = _picked(
        jnp.asarray(samples),
        jnp.array(size),
        None if level is None else jnp.asarray(level),
        None if corner is None else jnp.asarray(corner),
        more=more,
    )
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


@kept
def _picked(samples, count, full_scale, corner, *, more: bool):
    """Pick one record and return the case, its front and its scale.

    Forms besides a single pulse are tried with `more` only: without them the program
    compiles in half the time.
    """
    bins = bins_about_front(samples.size)
    bank = bank_of(bins, samples.size)
    clipped = clipped_samples(samples, count, full_scale)
    ready = prepared(bins, bank, samples, clipped, count, corner)
    case = ready.case
    best, _ = first_optimum(bins, ready)
    if more:
        formed = with_forms(bins, best, ready.continued, case)
        shown = with_further_effects(bins, best, formed, ready.start, case)
        best, case = unstated_high_pass(bins, ready, formed, shown).chosen(shown)
    y = best.y
    ratio = larger_misfit_ratio(bins, y, case)
    widened = jnp.sqrt(jnp.maximum(ratio, 1.0))
    resolved = natural_of(y).rise >= RESOLVED_RISE_SAMPLES
    rise = jnp.where(
        resolved,
        jnp.array([CENTRE[PRIMARY], SPREAD[PRIMARY]]),
        jnp.stack([y[PRIMARY], jnp.asarray(UNRESOLVED)]),
    )
    sampled = SampledCase(case, y, jnp.zeros(()), rise, widened)
    return sampled, ready.front.sample.astype(y.dtype), ready.scale


def _rows(
    observations: Observations, names: Sequence[str]
) -> tuple[tuple[int, ...], ...]:
    """Return the rows of a log that were picked from each record."""
    pairs = list(zip(observations.records(), observations.quantity, strict=True))
    return tuple(
        tuple(pairs.index((name, quantity)) for quantity in RECORD_QUANTITIES)
        for name in names
    )


def unknowns_at(
    moved: Float[Array, " primary"],
    nuisance: Float[Array, " nuisance"],
    case: SampledCase,
) -> Float[Array, " unknown"]:
    """Return the unknowns of a pulse moved from the pick; see `PulseTerms`."""
    arrival = case.unknowns[0] + moved[0] * case.rate
    picked = natural_of(case.unknowns)
    blank = jnp.zeros(1, nuisance.dtype)
    most = jnp.stack(
        [arrival, case.unknowns[1] + moved[1], case.unknowns[2] + moved[2]]
    )
    pulse = natural_of(jnp.concatenate([most, blank, nuisance]))
    # the impulse is primary, the decay is what gives it with peak, rise and duration
    impulse = picked.impulse * jnp.exp(moved[3])
    behind = impulse / pulse.peak - 0.5 * pulse.rise
    fraction = behind / (pulse.duration - pulse.rise)
    fraction = jnp.clip(fraction, LEAST_FRACTION, LEVEL - LEAST_FRACTION)
    decay = jnp.log1p(decay_of_fraction(fraction))
    return jnp.concatenate([most, decay[None], nuisance])


def trial_nuisances(
    moved: Float[Array, " primary"],
    nuisance: Float[Array, " nuisance"],
    case: SampledCase,
) -> Float[Array, "search trial nuisance"]:
    """Return starting nuisances of searches: several rises, the others as picked.

    Samples fix the middle of a front, so a front that arrives later rises faster. The
    trials are `RISES`, the pick's rise (first search), and the rise that keeps the
    middle.

    Args:
        moved: As for `PulseTerms`.
        nuisance: The pick's.
        case: The record.
    """
    picked = jnp.exp(nuisance[0])
    kept = picked - 2.0 * moved[0] * case.rate
    slow, sharp = (jnp.asarray(rises, picked.dtype) for rises in RISES)
    first = jnp.stack([picked, jnp.maximum(kept, slow[0]), *slow])
    within = jnp.clip(kept, sharp[0], sharp[-1])
    second = jnp.stack([jnp.minimum(picked, sharp[-1]), within, *sharp])
    rises = jnp.log(jnp.stack([first, second]))
    return jnp.tile(nuisance, (*rises.shape, 1)).at[:, :, 0].set(rises)
