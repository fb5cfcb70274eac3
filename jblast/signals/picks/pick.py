r"""The pick of a pressure record: values of its pulse, averaged over all hypotheses.

A pulse with a finite rise and a negative phase (`pulse`) is fitted with the drift of
the baseline, in the noise of the quiet part before the front (`preparation`). Forms of
the pulse, and effects like a ringing sensor (`effects`), are hypotheses with weights by
their evidence (`evidence`). Values are the mean over all; the covariance is that within
them plus the spread between them, plus the place of an unresolved front within its
sample.

Where no hypothesis fits, the record is tried again with shorter pulses (a drift may be
the largest one), with its flat top as clipped, and by its front alone.
"""

from collections.abc import Callable, Set
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Literal, NamedTuple

import numpy as np
from jaxtyping import Float
from numpy.typing import ArrayLike

from jblast.errors import InputError, argument
from jblast.observations.records.recording import even_clock
from jblast.observations.table import RECORD_QUANTITIES
from jblast.signals.picks.effects import through_high_pass
from jblast.signals.picks.evidence import (
    MISFIT,
    UNEXPLAINED,
    Modes,
    Weighted,
    covariance,
    modes_of,
    weighed,
)
from jblast.signals.picks.preparation import BEHIND_DURATIONS, Prepared, Window
from jblast.signals.picks.pulse import (
    CHANGES,
    CONTINUED,
    OUTPUTS,
    PEAK,
    natural,
    outputs,
    primitive,
)

LEAST_SAMPLES = 16
"""Smallest number of samples of a record: pulse and drift have 11 unknowns, and the
noise before the front has its own."""
HOPELESS = 30.0
"""Squared misfit above which the model explains next to nothing."""
SLIGHT_RESIDUAL = 1e-3
"""Root mean square residual, over the peak, that is accepted whatever the misfit. In a
record with hardly any noise a ground tremor before the front is a hundred standard
deviations, but changes no value of the pick."""
SHORTER = 0.5
"""Longest start of another attempt, over that of the last."""
FLAT_TOP_SD, FLAT_TOP_SAMPLES = 6.0, 8
"""Depth of a flat top [standard deviations of a sample], about the range of thousands
of samples of noise, and its smallest number of samples."""
FRONT_PARTS = 8, 32
"""Parts of the usual window in which the front alone is fitted: up to a half and a
seventh of the positive phase, before any disturbance."""
LEAST_FRONT = 24
"""Shortest fitted interval behind a front alone [samples]."""
OTHER_FORMS = 0.02
"""Standard deviation of arrival and end of the rise due to forms beyond the families
[rise times]."""
LEAST_WEIGHT = 3e-4
"""Smallest weight of a mode that counts."""
STEP_LEVEL, STEP_SAMPLES = 0.5, 16
"""A record is a step, not a pulse, if the mean of its last 16 samples is above half of
its largest sample."""
FOUND_SD = 0.2
"""Largest standard deviation of ln peak of a detected pulse: noise has five standard
deviations in 1 of 3 million records at one arrival, in 1 of 1,000 over all arrivals."""
FEW_SAMPLES = 8.0
"""Duration below which a pulse is marked as under-sampled: there are no more samples
than unknowns of the pulse, so the priors of its form matter."""
BOUND_PEAK_SD = 0.05
"""Standard deviation of ln peak from which on a clipped peak is a lower bound. A better
one, reconstructed from the decay, is used with its error."""
UNSURE_DURATION = 0.2
"""Standard deviation of ln duration from which on a pick is doubtful. A 90 % interval
then spans a factor of 1.9, which hardly constrains a charge."""
FAINT_PEAK_SD = 0.1
"""Standard deviation of ln peak from which on a pulse is noted as faint: a signal to
noise ratio of about ten, where steps of coloured noise may be taken for the front."""
PROBABLE = 0.5
"""Weight from which on an effect is reported."""
NAMES = (
    "air_arrival_s",
    "peak_overpressure_pa",
    "positive_duration_s",
    "positive_impulse_pa_s",
    "decay",
    "rise_time_s",
    "negative_pressure_pa",
    "negative_duration_s",
)
"""Picked values; the first four are quantities of a log."""
IN_LOG = 4
IN_LN = np.array([False, True, True, True, False, True, False, True])
"""Values that are averaged as logarithms."""
Quality = Literal["good", "doubtful", "poor"]
NoteKind = Literal[
    "nothing_found",
    "hopeless",
    "onset_alone",
    "reversed_polarity",
    "misfit",
    "front_alone",
    "clipped",
    "few_quiet_samples",
    "under_sampled",
    "sharp_front",
    "cut_short",
    "resonating",
    "later_arrival",
    "zero_shift",
    "high_passed",
    "continued_decay",
    "duration_unsure",
    "duration_lost",
    "faint",
]
"""Kinds of notes on a pick."""


@dataclass(frozen=True)
class FittedPulse:
    """The most probable pulse: forms, unknowns and amounts, in samples from a front.

    Attributes:
        unknowns, rise, negative: As in `pulse.primitive`.
        amounts: Amount of each column.
        corner: Corner of the instrument's high-pass [1/sample]; None without one.
        first_s: Time of the front [s].
        step_s: Sample interval [s].
        scale: Unit of the amounts.
    """

    unknowns: Float[np.ndarray, "1 unknown"]
    rise: np.ndarray
    negative: np.ndarray
    amounts: Float[np.ndarray, " column"]
    corner: float | None
    first_s: float
    step_s: float
    scale: float

    def means(self, ends_s: Float[np.ndarray, " end"]) -> Float[np.ndarray, " bin"]:
        """Return the mean over bins between rising times, as the recorder has it."""
        ends = (ends_s - self.first_s) / self.step_s
        made = primitive(self.unknowns, self.rise, self.negative, ends)
        means = np.diff(self.amounts @ made) / np.diff(ends)
        if self.corner is not None:
            means = through_high_pass(ends, means[None], np.array([self.corner]))[0]
        return self.scale * means[0]


@dataclass(frozen=True)
class Pick:
    """The pulse of a record.

    Errors are those of the posterior with all hypotheses, rise, suction and drift free.
    Values are NaN if no pulse was found.

    Attributes:
        notes: Kinds of findings, in the order of `NOTES`.
        noise_pa: Standard deviation of the noise of a sample [Pa].
        baseline_pa: Baseline at the arrival [Pa].
        air_arrival_s: Start of the rise, on the clock of the samples [s].
        peak_overpressure_pa: Overpressure behind the front [Pa].
        positive_duration_s: Duration of the positive phase, rise included [s].
        positive_impulse_pa_s: Impulse of the positive phase [Pa s].
        decay: Friedlander's $b$ behind the rise [-].
        rise_time_s: Rise time from zero to the peak; of an exponential rise to 95 %
            of it [s].
        negative_pressure_pa: Greatest underpressure; noise may make it negative in a
            record without a negative phase [Pa].
        negative_duration_s: Duration of the negative phase [s].
        covariance: Covariance of arrival [s], ln peak, ln duration and ln impulse.
        sds: Standard deviations of the eight values in the order of `NAMES`, in their
            units.
        lower_bound: True if samples were clipped at the peak, so that only
            `clipped_at_pa` and the prior constrain it.
        clipped_at_pa: Largest absolute value of a clipped sample; NaN without any [Pa].
        resonance_hz: Undamped frequency of the resonance; NaN without one [Hz].
        later_arrival_s: Arrival of a further front within the fitted interval; NaN
            without one [s].
        later_sigma_s: Its standard deviation [s].
        misfit: Squared misfit per degree of freedom, about 1 where the model fits [-].
        pulse: The most probable pulse; None if only an onset was found.
    """

    notes: tuple[NoteKind, ...]
    noise_pa: float
    baseline_pa: float
    air_arrival_s: float = np.nan
    peak_overpressure_pa: float = np.nan
    positive_duration_s: float = np.nan
    positive_impulse_pa_s: float = np.nan
    decay: float = np.nan
    rise_time_s: float = np.nan
    negative_pressure_pa: float = np.nan
    negative_duration_s: float = np.nan
    covariance: Float[np.ndarray, "4 4"] = field(
        default_factory=lambda: np.full((IN_LOG, IN_LOG), np.nan)
    )
    sds: Float[np.ndarray, " 8"] = field(
        default_factory=lambda: np.full(len(NAMES), np.nan)
    )
    lower_bound: bool = False
    clipped_at_pa: float = np.nan
    resonance_hz: float = np.nan
    later_arrival_s: float = np.nan
    later_sigma_s: float = np.nan
    misfit: float = np.nan
    pulse: FittedPulse | None = None

    @property
    def quality(self) -> Quality:
        """Good, doubtful or poor: the worst that a note makes it."""
        worst = max(
            (QUALITIES.index(NOTES[kind].quality) for kind in self.notes), default=0
        )
        return QUALITIES[worst]

    @property
    def found(self) -> bool:
        """True if there is a pulse or an onset."""
        return "nothing_found" not in self.notes

    def sd(self, name: str) -> float:
        """Return the standard deviation of a value, in its own unit.

        Args:
            name: One of `NAMES`.

        Raises:
            ValueError: There is no such value.
        """
        if name not in NAMES:
            raise ValueError(f"expected one of {', '.join(NAMES)}, got {name}")
        return float(self.sds[NAMES.index(name)])


def pick(
    time_s: ArrayLike,
    pressure_pa: ArrayLike,
    *,
    full_scale_pa: float | None = None,
    high_pass_hz: float | None = None,
) -> Pick:
    """Return the pulse of a record.

    Args:
        time_s: Middle of each sample on an even clock [s], [sample].
        pressure_pa: Overpressure [Pa], [sample]. In another unit, peak, impulse and
            suction are in that unit.
        full_scale_pa: Largest absolute value of a sample; samples at it are clipped.
            None if not specified: equal samples in a row at the extreme are clipped.
        high_pass_hz: Corner of the instrument's first-order high-pass [Hz].

    Returns:
        Arrival, peak, duration, impulse and more, with their covariance.

    Raises:
        InputError: Times are uneven or do not rise, lengths differ, a value is not
            finite, or a scale or corner is not positive.

    Example:
        `found = jblast.pick(time_s, pressure_pa)`, then `found.positive_impulse_pa_s`
        and `found.sd("positive_impulse_pa_s")`.
    """
    time, pressure = np.asarray(time_s, float), np.asarray(pressure_pa, float)
    if time.ndim != 1 or pressure.shape != time.shape:
        raise InputError(
            f"{argument('pressure_pa')}: expected one record with as many samples as "
            f"{argument('time_s')}, got the shapes {pressure.shape} and {time.shape}"
        )
    check_samples(argument("pressure_pa"), pressure)
    start_s, rate_hz = even_clock(time, lambda at: f"{argument('time_s')}[{at}]")
    for name, what, value, unit in (
        ("high_pass_hz", "a positive corner", high_pass_hz, "Hz"),
        ("full_scale_pa", "a positive pressure", full_scale_pa, "Pa"),
    ):
        if value is not None and not (0 < value < np.inf):
            raise InputError(f"{argument(name)}: expected {what}, got {value:g} {unit}")
    return picked(
        pressure,
        start_s,
        1.0 / rate_hz,
        full_scale=full_scale_pa,
        high_pass_hz=high_pass_hz,
    )


def check_samples(where: str, samples: Float[np.ndarray, " sample"]) -> None:
    """Raise an error for a record that is too short or not finite.

    Args:
        where: Name of the record, for messages.
        samples: Its samples.
    """
    if samples.size < LEAST_SAMPLES:
        raise InputError(
            f"{where}: expected {LEAST_SAMPLES} samples or more, got {samples.size}"
        )
    bad = np.flatnonzero(~np.isfinite(samples))
    if bad.size:
        raise InputError(
            f"{where}: expected finite samples, got {samples[bad[0]]} at [{bad[0]}] "
            f"and {bad.size - 1} more"
        )


@dataclass(frozen=True)
class _Fit:
    """A fit of a record by all hypotheses.

    Attributes:
        window: Window of the fit without a high-pass.
        groups: Modes with their weights.
        misfit: Squared misfit of the best.
        alone: True if the front alone was fitted.
    """

    window: Window
    groups: list[Weighted]
    misfit: float
    alone: bool = False

    @property
    def record(self) -> Prepared:
        """The record."""
        return self.window.record

    @property
    def left(self) -> float:
        """Root mean square residual of the best [largest sample]."""
        return float(np.sqrt(self.misfit)) * self.record.sigma

    @property
    def fits(self) -> bool:
        """True if a hypothesis explains the record well enough to be used."""
        return self.misfit < MISFIT or self.left < SLIGHT_RESIDUAL

    @property
    def explains(self) -> bool:
        """True if nothing else need be tried."""
        return self.misfit < UNEXPLAINED or self.left < SLIGHT_RESIDUAL

    @property
    def is_step(self) -> bool:
        """True if the record ends above half of its peak."""
        return bool(self.record.samples[-STEP_SAMPLES:].mean() > STEP_LEVEL)

    @cached_property
    def moments(self) -> tuple[np.ndarray, np.ndarray]:
        """Mean and covariance of the outputs over all modes."""
        parts = [_of_group(group) for group in self.groups]
        weights, values, within = (np.concatenate(x) for x in zip(*parts, strict=True))
        weights = weights / weights.sum()
        mean = weights @ values
        apart = values - mean
        spread = (weights[:, None] * apart).T @ apart
        return mean, np.einsum("k,kij->ij", weights, within) + spread

    @property
    def mean(self) -> Float[np.ndarray, " 8"]:
        """Mean of the outputs."""
        return self.moments[0]

    @property
    def sd(self) -> Float[np.ndarray, " 8"]:
        """Standard deviations of the outputs."""
        return np.sqrt(np.diag(self.moments[1]))

    def best(self, effect: str | None = None) -> tuple[Weighted, Modes]:
        """Return the most probable mode, of all or of an effect, and its group."""
        groups = [
            g for g in self.groups if effect is None or g.modes.effect.name == effect
        ]
        group = max(groups, key=lambda g: g.weights.max())
        return group, group.modes[[int(np.argmax(group.weights))]]

    def share(self, of: Callable[[Modes], np.ndarray]) -> float:
        """Return the weight of modes with a property."""
        return float(sum(np.sum(g.weights * of(g.modes)) for g in self.groups))

    def shows(self, effect: str) -> bool:
        """Return True if an effect is probable."""
        return self.share(lambda m: np.array(m.effect.name == effect)) > PROBABLE

    def is_found(self) -> bool:
        """Return True if there is a pulse."""
        clear = self.sd[1] < FOUND_SD or np.any(self.record.clipped > 0)
        return bool(clear and (self.alone or not self.is_step))

    def is_hopeless(self) -> bool:
        """Return True if the best hypothesis explains next to nothing."""
        return self.misfit > HOPELESS and self.left > SLIGHT_RESIDUAL

    def loses_duration(self) -> bool:
        """Return True if neither duration nor peak is well known."""
        return not (self.sd[2] < UNSURE_DURATION or self.sd[1] < FAINT_PEAK_SD)


def picked(
    samples: Float[np.ndarray, " sample"],
    start_s: float,
    step_s: float,
    *,
    full_scale: float | None = None,
    high_pass_hz: float | None = None,
) -> Pick:
    """Return the pick of checked samples.

    Args:
        samples: The samples.
        start_s: Time of the first one [s].
        step_s: Sample interval [s].
        full_scale: Largest absolute value of a sample; None if not specified.
        high_pass_hz: Corner of the instrument's first-order high-pass [Hz].
    """
    corner = None if high_pass_hz is None else 2 * np.pi * high_pass_hz * step_s
    # hypotheses that overflow have an infinite cost
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        return _pick_of(_fitted(samples, full_scale, corner), start_s, step_s)


def _fitted(samples, full_scale: float | None, high_pass: float | None) -> _Fit:
    """Return the best of several attempts."""
    record = Prepared(samples, full_scale, high_pass=high_pass)
    longest, best = np.inf, _fit_of(record)
    for _ in range(2):
        longest = SHORTER * record.start_duration(longest)
        if best.explains or longest < 0.5 * FEW_SAMPLES:
            break
        tried = _fit_of(record, longest=longest)
        best = min(best, tried, key=lambda fit: fit.misfit)
    if not best.explains:
        top = record.samples.max()
        flat = (record.samples > top - FLAT_TOP_SD * record.sigma) * 1.0
        high = top > 2 * FLAT_TOP_SD * record.sigma
        if high and flat.sum() >= FLAT_TOP_SAMPLES:
            clipped = np.maximum(record.clipped, flat)
            other = Prepared(samples, full_scale, clipped, high_pass)
            tried = _fit_of(other)
            best = tried if tried.fits and tried.misfit < best.misfit else best
    is_step = best.is_step
    for part in FRONT_PARTS:
        if best.fits or is_step:
            break
        front, duration = record.front, record.start_duration(longest)
        until = int(front + max(BEHIND_DURATIONS * duration / part, LEAST_FRONT))
        other = Prepared(samples[:until], full_scale, high_pass=high_pass)
        tried = _fit_of(other, longest=duration)
        if tried.fits and tried.sd[1] < FOUND_SD:
            best = replace(tried, alone=True)
    return best


def _fit_of(record: Prepared, longest: float = np.inf) -> _Fit:
    """Return the fit of a record; arguments are those of `modes_of`."""
    window, groups = modes_of(record, longest)
    if not groups:
        return _Fit(window, [], np.inf)
    misfit = float(2 * min(modes.cost.min() for modes in groups) / window.count)
    return _Fit(window, weighed(window, groups), misfit)


def _of_group(group: Weighted):
    """Return weights, outputs and their covariances, of the modes that count."""
    some = group.weights > LEAST_WEIGHT
    modes, weights = group.modes[some], group.weights[some]
    many, p = modes.unknowns.shape
    values = outputs(modes.unknowns, modes.rise, modes.negative, modes.linear)
    used = [*range(5), *range(p, p + 2 + CHANGES)]
    slopes = np.zeros((many, OUTPUTS, len(used)))
    for k, of in enumerate(used):
        unknowns, linear = modes.unknowns.copy(), modes.linear.copy()
        if of < p:
            unknowns[:, of] += 1e-4
        else:
            linear[:, of - p] += 1e-4
        ahead = outputs(unknowns, modes.rise, modes.negative, linear)
        slopes[:, :, k] = (ahead - values) / 1e-4
    own = covariance(modes)[:, used][:, :, used] * max(group.widened, 1.0)
    own = slopes @ own @ slopes.transpose(0, 2, 1)
    _, duration, b, tau, _ = natural(modes.unknowns, modes.rise)
    one, zero, rest = np.ones(many), np.zeros(many), np.zeros((many, 4))
    drop = (1 + b) / duration
    share = modes.linear[:, PEAK] / np.exp(values[:, 3])
    # a front within one sample is uniform there, and with it all that follows
    sharp = np.sqrt((1 - np.clip(tau - 1, 0, 1)) / 12)
    for size, change in (
        (sharp, (one, -drop, -1 / duration, -share)),
        (OTHER_FORMS * tau, (one, zero, -1 / duration, zero)),
        (OTHER_FORMS * tau, (zero, drop, zero, zero)),
    ):
        change = size[:, None] * np.concatenate(
            [np.stack(change, axis=1), rest], axis=1
        )
        own = own + change[:, :, None] * change[:, None, :]
    return weights, values, own


class NoteRow(NamedTuple):
    """A row of the table of notes.

    Attributes:
        test: True if a pick has the note.
        withheld: Quantities that a log does not get.
        quality: Best quality with the note.
    """

    test: Callable[[_Fit], bool | np.bool_]
    withheld: Set[str] = frozenset()
    quality: Quality = "doubtful"


QUALITIES: tuple[Quality, ...] = ("good", "doubtful", "poor")
_ARRIVAL, _PEAK, _DURATION, _IMPULSE = RECORD_QUANTITIES
ALL, TAIL = frozenset(RECORD_QUANTITIES), frozenset({_DURATION, _IMPULSE})
NOTES: dict[NoteKind, NoteRow] = {
    "nothing_found": NoteRow(lambda f: not f.is_found(), ALL, "poor"),
    "hopeless": NoteRow(_Fit.is_hopeless, ALL, "poor"),
    # made for a recording, not by a fit, like that of reversed polarity
    "onset_alone": NoteRow(lambda f: False, ALL - {_ARRIVAL}),
    "reversed_polarity": NoteRow(lambda f: False),
    # of simulated records a quarter of the peaks are right, an eighth of durations
    "misfit": NoteRow(
        lambda f: f.misfit > MISFIT and not f.is_hopeless(), ALL - {_ARRIVAL}
    ),
    "front_alone": NoteRow(lambda f: f.alone, TAIL),
    "clipped": NoteRow(lambda f: np.any(f.record.clipped)),
    "few_quiet_samples": NoteRow(lambda f: not f.record.known),
    "under_sampled": NoteRow(lambda f: np.exp(f.mean[2]) < FEW_SAMPLES),
    "sharp_front": NoteRow(lambda f: np.exp(f.mean[5]) < 1, quality="good"),
    "cut_short": NoteRow(
        lambda f: (
            f.mean[0] + np.exp(f.mean[2]) > f.record.samples.size - f.record.front
            and not f.alone
        ),
        TAIL,
    ),
    "resonating": NoteRow(lambda f: f.shows("resonating")),
    "later_arrival": NoteRow(lambda f: f.shows("later_arrival"), quality="good"),
    "zero_shift": NoteRow(lambda f: f.shows("zero_shift"), TAIL),
    "high_passed": NoteRow(lambda f: f.shows("high_passed"), TAIL),
    "continued_decay": NoteRow(
        lambda f: f.share(lambda m: m.negative == CONTINUED) > PROBABLE, quality="good"
    ),
    # "not less than" is also true of NaN
    "duration_unsure": NoteRow(
        lambda f: not (f.sd[2] < UNSURE_DURATION or f.loses_duration())
    ),
    "duration_lost": NoteRow(_Fit.loses_duration, {_DURATION}),
    "faint": NoteRow(lambda f: not f.sd[1] < FAINT_PEAK_SD),
}
"""Notes on picks, in the order in which they are listed."""


def _pick_of(fit: _Fit, start_s: float, step_s: float) -> Pick:
    """Return a pick in seconds and in the record's unit."""
    record = fit.record
    notes: tuple[NoteKind, ...] = ("nothing_found",)
    if fit.groups:
        notes = tuple(kind for kind, row in NOTES.items() if row.test(fit))
    if "nothing_found" in notes:
        return Pick(("nothing_found",), record.scale * record.sigma, record.offset)
    mean, covariance = fit.moments
    first_s, scale = start_s + step_s * record.front, record.scale
    units = np.array(
        [step_s, scale, step_s, scale * step_s, 1.0, step_s, scale, step_s]
    )
    values = units * np.where(IN_LN, np.exp(mean), mean)
    sds = fit.sd * np.where(IN_LN, np.abs(values), units)
    values[0] += first_s
    one_way = np.append(step_s, np.ones(IN_LOG - 1))
    in_log = covariance[:IN_LOG, :IN_LOG] * np.outer(one_way, one_way)
    group, best = fit.best()
    baseline = best.linear[0, -4:] @ np.array(
        [np.interp(mean[0], group.window.middle, line) for line in group.window.line]
    )
    high = bool(np.any(record.clipped > 0))
    clipped = np.abs(record.offset + scale * record.samples[record.clipped != 0])
    pulse = FittedPulse(
        best.unknowns,
        best.rise,
        best.negative,
        best.linear[0, : 2 + CHANGES],
        record.high_pass,
        first_s,
        step_s,
        scale,
    )
    frequency, later, later_sd = np.nan, np.nan, np.nan
    if "resonating" in notes:
        omega = np.exp(fit.best("resonating")[1].unknowns[0, 5])
        frequency = float(omega / (2 * np.pi * step_s))
    if "later_arrival" in notes:
        later, later_sd = _later(*fit.best("later_arrival"))
    return Pick(
        notes,
        scale * record.sigma,
        record.offset + scale * float(baseline),
        *map(float, values),
        covariance=in_log,
        sds=sds,
        lower_bound=high and not fit.sd[1] < BOUND_PEAK_SD,
        clipped_at_pa=float(clipped.max()) if clipped.size else np.nan,
        resonance_hz=frequency,
        later_arrival_s=first_s + step_s * later,
        later_sigma_s=step_s * later_sd,
        misfit=float(fit.misfit),
        pulse=pulse,
    )


def _later(group: Weighted, mode: Modes) -> tuple[float, float]:
    """Return the arrival of a further front and its standard deviation [samples]."""
    own = covariance(mode)[0] * max(group.widened, 1.0)
    lag = float(np.exp(mode.unknowns[0, 5]))
    arrival = float(natural(mode.unknowns, mode.rise)[0][0])
    variance = own[0, 0] + 2 * lag * own[0, 5] + lag * lag * own[5, 5]
    return arrival + lag, float(np.sqrt(variance))
