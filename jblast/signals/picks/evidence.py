r"""Fit of a pulse by all hypotheses, and the evidence of each.

A hypothesis is a form of rise, a form of negative phase, at most one effect, and the
sampling, by means or at instants. With $W$ the whitening matrix of the noise and $A$
the columns of the model, all amounts $c$ (peak, suction, changes of shape, drift and
what an effect adds) are linear and solved,

$$c = \arg\min \tfrac12 |W(y - A^T c)|^2 + \tfrac12 c^T L c,$$

and the five to seven others are searched by damped Gauss-Newton steps, for all
hypotheses at once (variable projection, Golub and Pereyra 1973). By Laplace's
approximation the evidence is

$$\ln Z = \ln\pi - C/\rho - \tfrac12\ln|N|,$$

with cost $C$, normal matrix $N$ of all unknowns, prior probability $\pi$, and the
variance $\rho = (20 + 2 C_{\min})/(20 + n)$ of the noise: the quiet part states its
level with 20 degrees of freedom, the best fit with the rest.

A clipped bin is a lower bound: its term is $-\ln\Phi$ of the excess over the level, in
standard deviations of a sample, expanded about the present solution.
"""

from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float, Int

from jblast.signals.picks.effects import (
    EFFECTS,
    HIGH_PASS_REACH,
    HIGH_PASSED,
    NOTHING,
    Effect,
    through_high_pass,
)
from jblast.signals.picks.preparation import BANK, Prepared, Window
from jblast.signals.picks.pulse import (
    CENTRE,
    CHANGES,
    CHANGES_SD,
    CONTINUED,
    CUBIC,
    FAMILY_PHASE,
    FAMILY_RISE,
    LN_PRIOR_NEGATIVE,
    LN_PRIOR_RISE,
    NEGATIVES,
    NONE,
    PEAK,
    RISES,
    SMOOTH,
    SPREAD,
    SUCTION,
    VARIANCE,
    moved,
    natural,
    outputs,
)

DRIFT_SD = np.array([1.0, 0.5, 0.3, 0.2])
"""Prior standard deviations of the drift's cubic [largest sample]."""
SUCTION_SHARE, SUCTION_SD = 0.3, 0.2
"""Prior of the depth of the negative phase [peaks]: laws have 0.1 to 0.5."""
NO_SUCTION = 0.02
"""Suction below zero costs one standard deviation for this share of the peak: a pulse
without a negative phase is a form of its own."""
FREEDOM = 20.0
"""Degrees of freedom with which the quiet part states the level of the noise."""
MISFIT = 3.0
"""Squared misfit above which no hypothesis fits: residuals of 1.7 times the noise."""
LONGEST_STEP = np.array([4.0, 0.7, 0.7, 1.5, 0.7])
FURTHER_STEP = 0.5
"""Largest change of an unknown in one step, where the expansion is about right."""
DIFFERENCE = np.array([1e-4, 1e-5, 1e-5, *5 * (1e-4,)])
"""Differences for slopes, also of the unknowns of an effect, far above rounding and
below any curvature."""
ROUNDING = 1e-14
"""Damping of every system, relative to its diagonal, so that none is singular."""
ENOUGH = 0.05
"""Expected gain in ln evidence at which a search ends."""
HOPELESS = 20.0
"""Lag in ln evidence behind the best at which a search is given up: the final weight
would be below 1e-8."""
LIKELY, LIKELY_END = 6.0, 12.0
"""Lags behind the best negative phase up to which all rises are tried with it, and
behind the best first end up to which all negative phases are, in ln evidence: the end
of another length may be ahead with its own form."""
LIKELY_EFFECT, HOPELESS_EFFECT = 3.0, 10.0
"""Lags behind the best mode without an effect up to which all forms are tried with the
effect, and beyond which its search is given up."""
EFFECT_STARTS = 4
"""Best starts of an effect that are searched: fewer overlook a ring of a slow front."""
FORM_STEPS = 8
"""Steps of a search from the end of a similar form."""
LEAST_SIGN = 4.0
"""Gain in ln likelihood of the best trial of a scan from which on an effect is
searched. Noise has it in one record of three for a ring; the odds decide, not the
sign."""
UNEXPLAINED = 1.5
"""Squared misfit of the best pulse from which on every effect is searched: one that the
pulse imitates leaves no sign to first order."""
START_RISES = np.array([0.5, 1.5, 3.0, 5.0, 8.0, 13.0])
START_SHIFTS = np.array([-1.5, -0.7, 0.0, 0.7, 1.5])
START_LENGTHS = (0.1, 0.2, 0.35, 0.6, 1.0, 1.5, 2.3)
START_DECAYS = (0.3, 0.9, 1.6)
START_TAILS = ((CUBIC, 1.7), (CUBIC, 3.0), (CONTINUED, 2.4), (NONE, 2.4))
"""Grid of starts: rises and shifts [samples], then factors on the duration, ln(1 + b),
and negative phases with their durations. In slow noise the first pulse is too long."""
STARTS = 5
"""Starts that are searched, each of another length or tail."""
FIRST_STEPS, WINDOWS = 6, 3
"""Steps of the first searches, which need no end as all forms continue from there; and
largest number of windows."""
OTHER_LENGTH, SAME_LENGTH = 0.3, 0.1
"""Differences of ln duration of starts that are searched apart, and of ends that are
one end reached from several starts."""
SHARPEST, SLOWEST = 1.5, 12.0
"""Rises between which samples at instants differ from means [samples]."""
INSTANT_MODES, INSTANT_LIKELY = 8, 5.0
"""Number of modes that are tried at instants, and lag in ln evidence."""
NET_SD, NET_SHARE = 2.0, 0.3
"""Net impulse from which on no high-pass is searched, in standard deviations and shares
of the positive impulse, as it would remove all."""


def _unsolved():
    return np.zeros(0)


@dataclass
class Modes:
    """Modes of one effect and sampling, one a row, with their solution.

    Attributes:
        unknowns: Searched unknowns.
        rise, negative: Forms.
        ln_prior: ln of prior probability and densities.
        effect: Effect of all rows.
        instants: True if samples are instants.
        linear: Solved amounts [mode, amount].
        cost: Half of the sum of squares, priors included [mode].
        normal: Normal matrix of searched and linear unknowns.
        slope: Minus the slope of the cost by the searched ones.
        residuals: Whitened residuals, then those of bounds [mode, term].
        jacobian: Slopes of the model [mode, unknown, term].
    """

    unknowns: Float[np.ndarray, "mode unknown"]
    rise: Int[np.ndarray, " mode"]
    negative: Int[np.ndarray, " mode"]
    ln_prior: Float[np.ndarray, " mode"]
    effect: Effect
    instants: bool
    linear: Float[np.ndarray, "..."] = field(default_factory=_unsolved)
    cost: Float[np.ndarray, "..."] = field(default_factory=_unsolved)
    normal: Float[np.ndarray, "..."] = field(default_factory=_unsolved)
    slope: Float[np.ndarray, "..."] = field(default_factory=_unsolved)
    residuals: Float[np.ndarray, "..."] = field(default_factory=_unsolved)
    jacobian: Float[np.ndarray, "..."] = field(default_factory=_unsolved)

    def __len__(self) -> int:
        return len(self.unknowns)

    def __getitem__(self, some):
        return replace(self, **{name: rows[some] for name, rows in self.rows()})

    @property
    def best(self) -> "Modes":
        """The row of lowest cost."""
        return self[[int(np.argmin(self.cost))]]

    def rows(self) -> list[tuple[str, np.ndarray]]:
        """Return the fields that have a value for each row."""
        return [
            (name, value)
            for name, value in vars(self).items()
            if isinstance(value, np.ndarray) and len(value) == len(self)
        ]

    def set(self, some, other: "Modes") -> None:
        """Replace rows by those of others."""
        for name, rows in other.rows():
            getattr(self, name)[some] = rows


def joined(*parts: Modes) -> Modes:
    """Return the rows of several of one effect and sampling."""
    names = [name for name, _ in parts[0].rows()]
    whole: dict[str, Any] = {
        name: np.concatenate([getattr(p, name) for p in parts]) for name in names
    }
    return replace(parts[0], **whole)


def hypotheses(unknowns, rise, negative, effect=NOTHING, instants=False) -> Modes:
    """Return hypotheses; one form stands for all rows."""
    rise, negative = (np.broadcast_to(f, len(unknowns)) for f in (rise, negative))
    prior = LN_PRIOR_RISE[rise] + LN_PRIOR_NEGATIVE[negative]
    ln_prior = prior + effect.ln_odds + effect.ln_width
    return Modes(unknowns, rise, negative, ln_prior, effect, instants)


def _unit_diagonal(matrices, damping):
    """Return matrices scaled to a unit diagonal, to which damping is added; and scales.

    Columns differ by many orders of magnitude if bins are clipped or noise is small.
    """
    scale = 1 / np.sqrt(np.diagonal(matrices, axis1=1, axis2=2))
    unit = matrices * scale[:, :, None] * scale[:, None, :]
    index = np.arange(scale.shape[1])
    unit[:, index, index] += damping
    return unit, scale


def _solved(matrices, right, damping):
    """Return the solution of each positive system of equations, damped."""
    unit, scale = _unit_diagonal(matrices, damping)
    return np.linalg.solve(unit, (right * scale)[..., None])[..., 0] * scale


def _linear_prior(peak: float, effect: Effect) -> Float[np.ndarray, "amount amount"]:
    """Return the precision of peak, suction, changes, further columns and drift."""
    changes, more = (
        1 / (np.array(sd) * peak) ** 2 for sd in (CHANGES_SD, effect.heights)
    )
    prior = np.diag(np.concatenate([[1e-6, 0.0], changes, more, 1 / DRIFT_SD**2]))
    tie = np.outer([-SUCTION_SHARE, 1.0], [-SUCTION_SHARE, 1.0])
    prior[:2, :2] += tie / (SUCTION_SD * peak) ** 2
    if len(more) == 2:  # peak and suction of a later pulse
        prior[8, 8] = 0.0
        prior[7:9, 7:9] += tie * more[1]
    return prior


def evaluate(window: Window, modes: Modes, slopes: bool = True) -> Modes:
    """Solve the linear unknowns of each; with slopes, expand the cost about it."""
    effect, peak = modes.effect, window.peak
    many, p = modes.unknowns.shape
    centre = np.append(CENTRE, effect.centre)
    spread = np.append(SPREAD, effect.spread)
    if window.front_held:
        # a front within clipped samples is near the first of them
        centre[0], spread[0] = -0.5, 1.0
    # with slopes, copies follow in which one unknown each is a little larger
    copies = p + 1 if slopes else 1
    shifts = np.eye(p + 1, p, -1)[:copies, None] * DIFFERENCE[:p]
    trials = (modes.unknowns + shifts).reshape(-1, p)
    rise, negative = np.tile(modes.rise, copies), np.tile(modes.negative, copies)
    columns = window.means(trials, rise, negative, modes.instants)
    columns = effect.columns(window, columns, trials, rise, negative)
    if window.record.high_pass is not None:
        corner = np.full(len(columns), window.record.high_pass)
        columns = through_high_pass(window.ends, columns, corner)
    q, n = columns.shape[1:]
    columns = columns.reshape(copies, many, q, n)
    model = np.zeros((many, q + 4, n))
    model[:, q:] = window.drift
    own = [PEAK, SUCTION, *range(2 + CHANGES, q)]
    model[:, own] = columns[0][:, own] @ window.whitener.T
    families = np.flatnonzero(
        (modes.rise == FAMILY_RISE) | (modes.negative == FAMILY_PHASE)
    )
    if families.size:  # the changes of others are zero
        changes = columns[0][families, 2 : 2 + CHANGES]
        model[families, 2 : 2 + CHANGES] = changes @ window.whitener.T
    prior = _linear_prior(peak, effect)
    normal = model @ model.transpose(0, 2, 1) + prior
    right = model @ window.data
    held = np.flatnonzero(window.held)
    bounds = _bounded(window, columns[0][..., held], held, normal, right)
    c = bounds.linear
    residuals = window.data - (c[:, None] @ model)[:, 0]
    residuals = np.concatenate([residuals, -bounds.short], axis=1)
    apart = (modes.unknowns - centre) / spread
    cost = 0.5 * (
        np.sum(residuals**2, axis=1)
        + np.einsum("kc,cd,kd->k", c, prior, c)
        + np.sum(apart**2, axis=1)
        + (np.minimum(c[:, SUCTION], 0) / (NO_SUCTION * peak)) ** 2
    )
    cost = np.where(np.isfinite(cost) & (c[:, PEAK] > 0), cost, np.inf)
    if not slopes:
        return replace(modes, linear=c, cost=cost)
    pulses = (c[:, None, :q] @ columns)[..., 0, :]
    moved_by = ((pulses[1:] - pulses[0]) / DIFFERENCE[:p, None, None]).transpose(
        1, 0, 2
    )
    jacobian = np.concatenate([moved_by @ window.whitener.T, model], axis=1)
    more = [moved_by[..., held] * bounds.slack[:, None], bounds.rows]
    jacobian = np.concatenate([jacobian, np.concatenate(more, axis=1)], axis=2)
    normal = jacobian @ jacobian.transpose(0, 2, 1)
    normal[:, p:, p:] += prior
    normal[:, np.arange(p), np.arange(p)] += 1 / spread**2
    slope = (jacobian[:, :p] @ residuals[..., None])[..., 0] - apart / spread
    return replace(
        modes,
        linear=c,
        cost=cost,
        normal=normal,
        slope=slope,
        residuals=residuals,
        jacobian=jacobian,
    )


class _Bounds(NamedTuple):
    """Terms of clipped bins.

    Attributes:
        linear: The solution with them.
        short: The terms.
        slack: Their slopes by the model.
        rows: Their slopes by the amounts.
    """

    linear: Float[np.ndarray, "mode amount"]
    short: Float[np.ndarray, "mode bin"]
    slack: Float[np.ndarray, "mode bin"]
    rows: Float[np.ndarray, "mode amount bin"]


def _bounded(window: Window, columns, held, normal, right) -> _Bounds:
    """Solve the amounts with the bounds of clipped bins."""
    c = _solved(normal, right, ROUNDING)
    many = len(columns)
    if not held.size:
        none = np.zeros((many, 0))
        return _Bounds(c, none, none, np.zeros((*c.shape, 0)))
    # SciPy is loaded for records with clipped samples alone
    from scipy.special import log_ndtr

    sign, level = window.held[held], np.abs(window.values[held])
    sigma = window.record.sigma
    drift = np.broadcast_to(window.line[:, held], (many, 4, held.size))
    model = np.concatenate([columns, drift], axis=1) * sign
    for last in (False, False, False, True):
        v = ((c[:, None] @ model)[:, 0] - level) / sigma
        chance = log_ndtr(v)
        short = np.sqrt(np.maximum(-2 * chance, 1e-12))
        slope = -np.exp(-0.5 * v * v - chance) / np.sqrt(2 * np.pi) / short / sigma
        rows = model * slope[:, None]
        if not last:
            to = (c[:, None] @ rows)[:, 0] - short
            with_bounds = normal + rows @ rows.transpose(0, 2, 1)
            pulled = right + (rows @ to[..., None])[..., 0]
            c = _solved(with_bounds, pulled, ROUNDING)
    return _Bounds(c, short, slope * sign, rows)


def search(
    window: Window, start: Modes, steps: int = 12, against: float = np.inf
) -> Modes:
    """Return the optima of hypotheses by damped Gauss-Newton steps, all at once.

    Args:
        window: The bins.
        start: Where the searches begin.
        steps: Largest number of steps.
        against: Cost above which a search is given up after five steps.
    """
    here = evaluate(window, start[np.arange(len(start))])  # a copy
    many, p = here.unknowns.shape
    damping, stalled = np.full(many, 0.03), np.zeros(many, int)
    done = ~np.isfinite(here.cost)
    largest = np.append(LONGEST_STEP, np.full(p - 5, FURTHER_STEP))
    for step in range(steps):
        some = np.flatnonzero(~done)
        if not some.size:
            break
        normal, slope = here.normal[some], here.slope[some]
        right, damped = np.zeros(normal.shape[:2]), np.full(normal.shape[:2], ROUNDING)
        right[:, :p] = slope
        damped[:, :p] += damping[some, None]
        move = _solved(normal, right, damped)[:, :p]
        move /= np.maximum(np.max(np.abs(move) / largest, axis=1), 1.0)[:, None]
        expected = 0.5 * np.sum(move * slope, axis=1)
        before = here[some]
        trial = evaluate(window, replace(before, unknowns=before.unknowns + move))
        gain = before.cost - trial.cost
        better = gain > -1e-9
        here.set(some[better], trial[better])
        damping[some] = np.clip(damping[some] * np.where(better, 0.1, 10.0), 1e-9, 1e5)
        widened = widening(window, here)
        stalled[some] = np.where(gain > 0.02 * widened, 0, stalled[some] + 1)
        done[some] = (better & (expected < ENOUGH * widened)) | (stalled[some] > 2)
        if step >= 2:
            done |= here.cost > np.min(here.cost) + HOPELESS * widened
        if step >= 5:
            done |= here.cost > against
    return here


def widening(window: Window, *groups: Modes) -> float:
    """Return the factor on the variance of the noise, by quiet part and best fit."""
    least = min(np.min(modes.cost) for modes in groups)
    return float((FREEDOM + 2 * least) / (FREEDOM + window.count))


def covariance(modes: Modes) -> Float[np.ndarray, "mode row row"]:
    """Return the covariance of all unknowns of each, for noise as stated."""
    unit, scale = _unit_diagonal(modes.normal, ROUNDING)
    return np.linalg.inv(unit) * scale[:, :, None] * scale[:, None, :]


def levels(window: Window, modes: Modes, widened: float) -> Float[np.ndarray, " mode"]:
    """Return ln evidence of each by Laplace's approximation."""
    sign, size = np.linalg.slogdet(modes.normal)
    heights = np.sum(np.log(np.array(modes.effect.heights) * window.peak))
    level = modes.ln_prior - heights - modes.cost / widened - 0.5 * size
    return np.where((sign > 0) & np.isfinite(level), level, -np.inf)


def _starts(window: Window, member: int) -> Modes:
    """Return starts of different lengths and tails: rise and shift first."""
    first, negative = BANK.unknowns[member], BANK.negative[member]
    rise = np.append(START_RISES, np.exp(first[3]))
    rise = np.minimum(rise, 0.5 * np.exp(first[1]))
    trials = np.repeat(first[None], rise.size * START_SHIFTS.size, axis=0)
    trials[:, 0] = np.tile(START_SHIFTS, rise.size) - 0.5
    trials[:, 3] = np.log(np.repeat(rise, START_SHIFTS.size))
    best = _most_likely(window, hypotheses(trials, SMOOTH, negative), 1).unknowns
    grid = np.array(
        [
            (np.log(length), decay, tail, np.log(fall))
            for length in START_LENGTHS
            for decay in START_DECAYS
            for tail, fall in START_TAILS
        ]
    )
    trials = np.repeat(best, len(grid), axis=0)
    trials[:, 1] += grid[:, 0]
    trials[:, 2], trials[:, 4] = grid[:, 1], grid[:, 3]
    trials[:, 3] = np.minimum(trials[:, 3], trials[:, 1] + np.log(0.4))
    tails = grid[:, 2].astype(int)
    return _most_likely(window, hypotheses(trials, SMOOTH, tails), STARTS)


def _most_likely(window: Window, trials: Modes, many: int) -> Modes:
    """Return the best of trials, each of another length or form."""
    tried = evaluate(window, trials, slopes=False)
    return trials[_distinct(tried, np.argsort(tried.cost), OTHER_LENGTH)[:many]]


def _distinct(modes: Modes, order, apart: float, *, forms: bool = True) -> list[int]:
    """Return indices in order, without those of form and length of another."""
    length = modes.unknowns[:, 1]
    form = (modes.rise * len(NEGATIVES) + modes.negative) * forms
    kept: list[int] = []
    for i in order:
        if all(form[i] != form[j] or abs(length[i] - length[j]) > apart for j in kept):
            kept.append(int(i))
    return kept


def modes_of(record: Prepared, longest: float = np.inf) -> tuple[Window, list[Modes]]:
    """Return all hypotheses worth a weight, in groups of one effect and one sampling.

    Args:
        record: The record.
        longest: Longest duration of the start [samples].
    """
    member = record.best_member(longest)
    window, ends = _first_ends(record, member, record.start_duration(longest))
    for _ in range(WINDOWS - 1):
        if _leaves(window, [ends]):
            window, ends = _first_ends(record, member, _duration([ends]))
    if not np.isfinite(ends.cost).any():
        return window, []
    plain = _all_forms(window, ends)
    instants = _at_instants(window, plain)
    groups = [*_with_effects(window, plain), *instants]
    if _leaves(window, groups):
        peak, window = window.peak, record.window(_duration(groups))
        window.peak = peak
        groups = [search(window, modes) for modes in groups]
    return window, groups


def _first_ends(record: Prepared, member: int, duration: float):
    """Return the window for a duration, and the ends of the first searches in it."""
    window = record.window(duration)
    ends = search(window, _starts(window, member), FIRST_STEPS)
    window.peak = float(np.clip(ends.best.linear[0, PEAK], 0.02, 3.0))
    return window, ends


def _duration(groups: list[Modes]) -> float:
    """Return the duration of the mode of lowest cost."""
    best = min(groups, key=lambda modes: modes.cost.min()).best
    return float(np.exp(best.unknowns[0, 1]))


def _leaves(window: Window, groups: list[Modes]) -> bool:
    """Return True if a pulse that fits has another length than its window is for."""
    ratio = _duration(groups) / window.duration
    return widening(window, *groups) < MISFIT and not 0.6 < ratio < 1.7


def _all_forms(window: Window, found: Modes) -> Modes:
    """Return all negative phases from the best ends, then all rises."""
    # ends of one length are one, since all negative phases are tried from each
    ends = _distinct(found, np.argsort(found.cost), SAME_LENGTH, forms=False)
    ends = found[ends[:3]]
    ends = ends[ends.cost <= ends.cost[0] + LIKELY_END * widening(window, ends)]
    many, effect = len(NEGATIVES), found.effect
    unknowns, rise = (np.repeat(x, many, axis=0) for x in (ends.unknowns, ends.rise))
    forms = np.tile(np.arange(many), len(ends))
    tails = search(window, hypotheses(unknowns, rise, forms, effect))
    # one end that is reached from several starts counts once
    level = levels(window, tails, widening(window, tails))
    kept = _distinct(tails, np.argsort(-level), SAME_LENGTH)
    tails, level = tails[kept], level[kept]
    likely = tails[level >= level[0] - LIKELY]
    rises = np.setdiff1d(np.arange(len(RISES)), ends.rise)
    unknowns, before, negative = (
        np.repeat(x, rises.size, axis=0)
        for x in (likely.unknowns, likely.rise, likely.negative)
    )
    rise = np.tile(rises, len(likely))
    unknowns[:, :5] = moved(unknowns[:, :5], before, rise)
    start = hypotheses(unknowns, rise, negative, effect)
    return joined(tails, search(window, start, FORM_STEPS))


def _at_instants(window: Window, plain: Modes) -> list[Modes]:
    """Return the likeliest modes with a resolved rise, for samples at instants."""
    level = levels(window, plain, widening(window, plain))
    tau = natural(plain.unknowns, plain.rise)[3]
    best = np.argsort(-level)[:INSTANT_MODES]
    likely = level[best] > level.max() - INSTANT_LIKELY
    best = best[likely & (tau[best] > SHARPEST) & (tau[best] < SLOWEST)]
    if not best.size:
        return []
    unknowns, rise = plain.unknowns[best].copy(), plain.rise[best]
    # the average over a sample has made the rise longer
    longer = np.sqrt(tau[best] ** 2 + 1 / 12 / VARIANCE[rise])
    left = np.maximum(1 - longer / np.exp(unknowns[:, 1]), 0.1)
    unknowns[:, 3] = np.log(longer / left)
    start = hypotheses(unknowns, rise, plain.negative[best], instants=True)
    found = search(window, start, FORM_STEPS)
    # both samplings are equally probable; these stand for all modes of the other
    rest = np.logaddexp.reduce(level) - np.logaddexp.reduce(level[best])
    return [replace(found, ln_prior=found.ln_prior + rest)]


def _sign(window: Window, effect: Effect, best: Modes) -> tuple[float, int]:
    """Return the largest gain in ln likelihood of an effect's scan, and its trial."""
    n = window.data.size
    columns = effect.scan(window, best) @ window.whitener.T
    basis = np.linalg.qr(best.jacobian[0, :, :n].T)[0]
    columns = columns - (columns @ basis) @ basis.T
    own = columns @ columns.transpose(0, 2, 1)
    size = np.trace(own, axis1=1, axis2=2)[:, None, None]
    own = own + (1e-9 * size + 1e-9) * np.eye(own.shape[1])
    across = columns @ best.residuals[0, :n]
    solved = np.linalg.solve(own, across[..., None])[..., 0]
    gain = 0.5 * np.sum(across * solved, axis=1) / widening(window, best)
    trial = int(np.argmax(gain))
    return float(gain[trial]), trial


def _with_effects(window: Window, plain: Modes) -> list[Modes]:
    """Return modes without an effect, then those with each that has a sign."""
    widened = widening(window, plain)
    level = levels(window, plain, widened)
    best = plain[[int(np.argmax(level))]]
    again, groups = [plain], []
    for effect in EFFECTS:
        gain, trial = _sign(window, effect, best)
        sign = gain >= LEAST_SIGN or widened > UNEXPLAINED
        if not (sign or effect.suspected(best)):
            continue
        base = best
        if not effect.all_forms:
            usual = (plain.rise == SMOOTH) & (plain.negative == CUBIC)
            base = plain[[int(np.argmax(np.where(usual, level, -np.inf)))]]
        starts = effect.starts(window, base, trial)
        trials = hypotheses(starts, base.rise[0], base.negative[0], effect)
        tried = evaluate(window, trials, slopes=False)
        trials = trials[np.argsort(tried.cost)[:EFFECT_STARTS]]
        limit = best.cost[0] + HOPELESS_EFFECT * widened
        found = search(window, trials, 20, against=limit)
        reached = levels(window, found, widened)
        if effect.all_forms and reached.max() > level.max() - LIKELY_EFFECT:
            # the best forms without the effect may only imitate it
            found = _all_forms(window, found)
        if reached.max() > level.max():
            # or the search without it ended elsewhere
            end = found.best
            start = hypotheses(end.unknowns[:, :5], end.rise, end.negative)
            again.append(_all_forms(window, search(window, start, FORM_STEPS)))
        groups.append(found)
    plain = joined(*again)
    order = np.argsort(-levels(window, plain, widened))
    return [plain[_distinct(plain, order, SAME_LENGTH)], *groups]


class Weighted(NamedTuple):
    """Modes of one effect and sampling, with their weights.

    Attributes:
        window: Their window.
        modes: The modes.
        weights: Probability of each among all of a record.
        widened: Factor on the variance of the noise.
    """

    window: Window
    modes: Modes
    weights: Float[np.ndarray, " mode"]
    widened: float


def weighed(window: Window, groups: list[Modes]) -> list[Weighted]:
    """Return modes with weights by their evidence, those of a high-pass among them.

    Args:
        window: Window of the groups.
        groups: Modes without a high-pass, those without an effect first.
    """
    widened = widening(window, *groups)
    found = [(window, m, levels(window, m, widened), widened) for m in groups]
    best = max(found, key=lambda group: group[2].max())[1]
    if widened < MISFIT and best.effect.name != "resonating":
        total = np.logaddexp.reduce(np.concatenate([group[2] for group in found]))
        found += _high_passed(window, groups, total)
    total = np.logaddexp.reduce(np.concatenate([group[2] for group in found]))
    return [Weighted(w, m, np.exp(x - total), by) for w, m, x, by in found]


def _high_passed(window: Window, groups: list[Modes], total: float):
    """Return modes before an unstated high-pass, if there is a sign of one.

    They are fitted over a longer window. Their ln evidence is that of all modes without
    one, `total`, and the odds in that window.
    """
    record, plain = window.record, groups[0]
    level = levels(window, plain, widening(window, plain))
    best = plain[[int(np.argmax(level))]]
    duration = float(np.exp(best.unknowns[0, 1]))
    end = int(min(record.front + HIGH_PASS_REACH * duration, record.samples.size))
    if record.bound.any() or record.high_pass is not None:
        return []
    net = abs(record.samples[record.quiet : end].sum())
    sd = np.sqrt(record.slow_variance(end - record.quiet))
    impulse = float(
        np.exp(outputs(best.unknowns, best.rise, best.negative, best.linear)[0, 3])
    )
    if net > NET_SD * sd + NET_SHARE * impulse:
        return []
    far = record.window(duration, reach=HIGH_PASS_REACH)
    far.peak = window.peak
    there = search(far, best, 4)
    sign, _ = _sign(far, HIGH_PASSED, there)
    if sign < LEAST_SIGN and not HIGH_PASSED.suspected(there):
        return []
    others = (m.best for m in groups[1:] if m.effect.name)
    without = [_all_forms(far, there), *(search(far, m, 10) for m in others)]
    # another effect may imitate a high-pass, and its pulse be nearer
    near = min(groups, key=lambda modes: modes.cost.min()).best
    starts = HIGH_PASSED.starts(far, near, 0)
    trials = hypotheses(starts, near.rise[0], near.negative[0], HIGH_PASSED)
    ends = search(far, _most_likely(far, trials, 3), 15)
    modes = _all_forms(far, ends)
    widened = widening(far, modes, *without)
    against = np.concatenate([levels(far, m, widened) for m in without])
    level = levels(far, modes, widened) - np.logaddexp.reduce(against) + total
    return [(far, modes, level, widened)]
