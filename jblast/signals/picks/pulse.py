r"""Pulses of many forms, as antiderivatives: a rise or a negative phase is a table row.

With $u$ the time since the arrival, $\tau$ the rise time, $D$ the duration of the
positive phase and $b$ the decay, the overpressure over its peak is

$$R(u/\tau) \text{ in the rise}, \quad (1 - s)\,e^{-b s}, \; s = (u - \tau)/(D -
\tau),$$

behind it (Friedlander 1946), and $-S((u - D)/t^-)$ in the negative phase. An
exponential rise, $1 - e^{-3 u/\tau}$, multiplies the decay instead. The mean over a bin
of samples is the difference of the antiderivative at its ends, exact for any width.

A form is a point or a family. A family has a mean shape, and changes of that shape
whose amounts are linear unknowns with priors, so it contains the forms between: rises
that are straight, smooth or bent, and negative phases $r(1-r)^k$ with $k$ = 1 to 3.

The searched unknowns of a pulse are the centre of its rise [samples], $\ln D$,
$\ln(1+b)$, $\ln\tau'$ and $\ln(t^-/D)$, with $\tau = \tau'/(1 + \tau'/D)$. The centre
of the rise, not the arrival, since samples determine it whatever form and $\tau$ are.
The prior of the others has the medians and spreads of the laws: b of 0.4 to 2.9,
negative phases of 1.8 to 4.5 positive ones.
"""

import numpy as np
from jaxtyping import Float, Int

CENTRE = np.array([0.0, 3.0, 0.6, 0.0, np.log(2.4)])
SPREAD = np.array([1e3, 5.0, 0.7, 2.0, 0.5])
"""Prior means and standard deviations of the searched unknowns; the first two are
flat."""
CHANGES = 5
"""Number of changes of shape: three of a rise, two of a negative phase."""
CHANGES_SD = np.array([0.7, 0.4, 0.5, 0.15, 0.15])
"""Prior standard deviations of their amounts [peaks], so that the members of a family
are within 0.7 of its mean."""
FASTEST = 3.0
"""Time constants in an exponential rise, which reaches 95 % of the peak."""
NODES = 1024
X = np.linspace(0.0, 1.0, NODES + 1)
ZERO = np.zeros_like(X)

_SMOOTH = X * X * (3 - 2 * X)
_BENT = np.expm1(-FASTEST * X) / np.expm1(-FASTEST)
_MEAN_RISE = X + 0.6 * (_SMOOTH - X) + 0.3 * (_BENT - X)
# name, prior probability, shape R(x), its changes; the last change is the beginning of
# the decay within the rise, to first order
RISES = (
    ("smooth", 0.15, _SMOOTH, (ZERO, ZERO, ZERO)),
    ("smoother", 0.15, X**3 * (10 - 15 * X + 6 * X * X), (ZERO, ZERO, ZERO)),
    ("family", 0.45, _MEAN_RISE, (_SMOOTH - X, _BENT - X, _MEAN_RISE * (1 - X))),
    ("exponential", 0.25, -np.expm1(-FASTEST * X), (ZERO, ZERO, ZERO)),
)
_PARABOLA, _CUBIC = 4 * X * (1 - X), 6.75 * X * (1 - X) ** 2
_QUARTIC = 256 / 27 * X * (1 - X) ** 3
# the cubic is that of Granstroem (1956), the triangle that of UFC 3-340-02, figure 2-8;
# "continued" is the Friedlander formula for all times
NEGATIVES = (
    ("cubic", 0.15, _CUBIC, (ZERO, ZERO)),
    ("half-sine", 0.15, np.sin(np.pi * X), (ZERO, ZERO)),
    ("triangle", 0.15, np.where(X < 0.25, 4 * X, (1 - X) / 0.75), (ZERO, ZERO)),
    (
        "family",
        0.25,
        0.5 * (_PARABOLA + _CUBIC),
        (_PARABOLA - _CUBIC, _QUARTIC - _CUBIC),
    ),
    ("continued", 0.15, ZERO, (ZERO, ZERO)),
    ("none", 0.15, ZERO, (ZERO, ZERO)),
)
SMOOTH, FAMILY_RISE, EXPONENTIAL = 0, 2, 3
CUBIC, FAMILY_PHASE, CONTINUED, NONE = 0, 3, 4, 5
PEAK, SUCTION, CHANGED = 0, 1, slice(2, 2 + CHANGES)
"""Columns of a pulse: of a peak of 1, of a suction of 1, of the changes."""


def _integral(shape):
    return np.append(0.0, np.cumsum(0.5 * (shape[1:] + shape[:-1]))) / NODES


def _shapes(rows):
    return np.array([[shape, *changes] for _, _, shape, changes in rows])


SHAPES, PHASES = _shapes(RISES), _shapes(NEGATIVES)
# [form, shape and changes, node]
RISEN = np.apply_along_axis(_integral, -1, SHAPES)
SUCKED = np.apply_along_axis(_integral, -1, PHASES)
# maxima of shapes need fewer nodes
SHAPES, PHASES = SHAPES[..., ::16].copy(), PHASES[..., ::16].copy()
LN_PRIOR_RISE = np.log([row[1] for row in RISES])
LN_PRIOR_NEGATIVE = np.log([row[1] for row in NEGATIVES])
# mean and variance of the times at which a rise rises, in rises
MIDDLE = 1 - RISEN[:, 0, -1]
VARIANCE = np.array([2 * _integral((1 - row[2]) * X)[-1] for row in RISES]) - MIDDLE**2
MIDDLE[EXPONENTIAL], VARIANCE[EXPONENTIAL] = 1 / FASTEST, 1 / FASTEST**2
_RISE_COLUMNS, _PHASE_COLUMNS = [0, 2, 3, 4], [1, 5, 6]


def natural(
    unknowns: Float[np.ndarray, "trial unknown"], rise: Int[np.ndarray, " trial"]
):
    """Return arrival, D, b, tau and the duration of the negative phase."""
    duration, decay = np.exp(unknowns[:, 1]), np.expm1(unknowns[:, 2])
    free = np.exp(unknowns[:, 3])
    tau = free * duration / (free + duration)
    arrival = unknowns[:, 0] - MIDDLE[rise] * tau
    return arrival, duration, decay, tau, duration * np.exp(unknowns[:, 4])


def fallen(decay, s):
    """Return the integral of (1 - s) exp(-decay s) from 0 to s."""
    b = np.where(np.abs(decay) < 1e-3, 1e-3, decay)
    return (b - 1 + np.exp(-b * s) * (1 - b + b * s)) / (b * b)


def _looked_up(table, form, x):
    """Return the columns of table[form] at x in [0, 1], linear between nodes."""
    at = x * NODES
    node = np.minimum(at.astype(np.intp), NODES - 1)
    many = table.shape[1]
    rows = (form * many)[:, None, None] + np.arange(many)[None, :, None]
    flat, index = table.ravel(), node[:, None] + rows * (NODES + 1)
    low = flat.take(index)
    return low + (at - node)[:, None] * (flat.take(index + 1) - low)


def primitive(
    unknowns: Float[np.ndarray, "trial unknown"],
    rise: Int[np.ndarray, " trial"],
    negative: Int[np.ndarray, " trial"],
    ends: Float[np.ndarray, " end"],
) -> Float[np.ndarray, "trial column end"]:
    """Return the antiderivatives of the columns of pulses at rising times."""
    a, duration, b, tau, fall = natural(unknowns, rise)
    out = np.zeros((len(unknowns), 2 + CHANGES, ends.size))
    first, risen, over = np.searchsorted(
        ends, [a.min(), (a + tau).max(), (a + duration).min()]
    )
    a, duration, b, tau, fall = (v[:, None] for v in (a, duration, b, tau, fall))
    length = duration - tau
    last = np.where(negative == CONTINUED, np.inf, 1.0)[:, None]
    x = np.clip((ends[first:risen] - a) / tau, 0, 1)
    # changes of shape cost as much as the shape, and only families have them
    changed = bool(np.any(rise == FAMILY_RISE))
    of, table = (_RISE_COLUMNS, RISEN) if changed else ([PEAK], RISEN[:, :1])
    out[:, of, first:risen] = tau[:, :, None] * _looked_up(table, rise, x)
    out[:, of, risen:] = (tau * table[rise, :, -1])[:, :, None]
    # a rise that multiplies the decay; the mean of the family has half of it
    out[:, 4] *= (1 + b) * tau / length
    out[:, PEAK] += 0.5 * out[:, 4]
    s = np.clip((ends[first:] - a - tau) / length, 0, last)
    out[:, PEAK, first:] += length * fallen(b, s)
    if (some := rise == EXPONENTIAL).any():
        # (1 - s) exp(-b s) (1 - exp(-k s)), not divided by its maximum
        whole, mine = duration[some], b[some]
        s = np.clip((ends[first:] - a[some]) / whole, 0, last[some])
        faster = mine + FASTEST * whole / tau[some]
        out[some, PEAK, first:] = whole * (fallen(mine, s) - fallen(faster, s))
    r = np.clip((ends[over:] - a - duration) / fall, 0, 1)
    changed = bool(np.any(negative == FAMILY_PHASE))
    of, table = (_PHASE_COLUMNS, SUCKED) if changed else ([SUCTION], SUCKED[:, :1])
    out[:, of, over:] = -fall[:, :, None] * _looked_up(table, negative, r)
    return out


OUTPUTS = 8
"""Arrival, ln peak, ln duration, ln positive impulse, decay, ln rise time, depth and ln
duration of the negative phase."""
CUBIC_AREA = 9 / 16
"""Area of the cubic negative phase, over depth times duration."""


def outputs(
    unknowns: Float[np.ndarray, "trial unknown"],
    rise: Int[np.ndarray, " trial"],
    negative: Int[np.ndarray, " trial"],
    linear: Float[np.ndarray, "trial column"],
) -> Float[np.ndarray, "trial 8"]:
    """Return the values of pulses, as `OUTPUTS`.

    The negative phase of a pulse that continues below zero is that of a cubic one of
    equal depth and impulse.
    """
    a, duration, b, tau, fall = natural(unknowns, rise)
    height = np.maximum(linear[:, PEAK], 1e-9)
    changes = linear[:, 2:5] / height[:, None]
    steep = (1 + b) * tau / (duration - tau)
    changes[:, 2] = (changes[:, 2] + 0.5) * steep
    mine = SHAPES[rise]
    shape = mine[:, 0] + np.einsum("kc,kcx->kx", changes, mine[:, 1:])
    s = np.linspace(0, 1, 65) ** 2 * np.minimum(4 * tau / duration, 1)[:, None]
    faster = FASTEST * duration / tau
    exponential = (1 - s) * np.exp(-b[:, None] * s) * -np.expm1(-faster[:, None] * s)
    top = np.where(
        rise == EXPONENTIAL,
        exponential.max(1),
        # noisy amounts must not make a hump; a rise bends by its own steepness
        np.clip(shape.max(1), 1, 1 + 0.25 * steep),
    )
    risen = RISEN[rise, :, -1]
    area = np.where(
        rise == EXPONENTIAL,
        duration * (fallen(b, 1.0) - fallen(b + faster, 1.0)),
        tau * (risen[:, 0] + np.einsum("kc,kc->k", changes, risen[:, 1:]))
        + (duration - tau) * fallen(b, 1.0),
    )
    sucked = np.einsum("kc,kcx->kx", linear[:, _PHASE_COLUMNS], PHASES[negative])
    # (1 - s) exp(-b s) is lowest at 1 + 1/b; without a decay it has no lowest value
    steady = np.maximum(b, 0.05)
    continued = negative == CONTINUED
    depth = np.where(
        continued, height * np.exp(-steady - 1) / steady, sucked.max(axis=1)
    )
    long = np.where(continued, np.e / steady / CUBIC_AREA * (duration - tau), fall)
    return np.stack(
        [
            a,
            np.log(height * top),
            np.log(duration),
            np.log(height * np.maximum(area, 1e-12)),
            b,
            np.log(tau),
            depth,
            np.log(long),
        ],
        axis=1,
    )


def moved(unknowns, rise_from, rise_to):
    """Return the unknowns of another rise of equal centre, spread and end of phase."""
    a, duration, _, tau, fall = natural(unknowns, rise_from)
    new = tau * np.sqrt(VARIANCE[rise_from] / VARIANCE[rise_to])
    new = np.minimum(new, 0.5 * duration)
    long = a + duration - (unknowns[:, 0] - MIDDLE[rise_to] * new)
    out = unknowns.copy()
    out[:, 1], out[:, 4] = np.log(long), np.log(fall / long)
    out[:, 3] = np.log(new / (1 - new / long))
    return out
