r"""The blast of a point source in air of gamma 1.4, from the strong shock to sound.

The solution of the equations of motion for energy released at a point, as a function of
$\lambda = R\,(P_0/E)^{1/3}$ with $E = 4.184$ MJ/kg times the mass. With $x = p/P_0$ the
front is one curve $x(\lambda)$. From 0.1 to 100 (Z = 346) it is the cubic spline of
$\ln x$ in $\ln\lambda$ through the nodes of `data/point_source_euler.csv`, computed by
`jblast.waves.euler`. Nearer the source it is Sedov's and Taylor's strong limit with the
constant that meets the first value,

$$x = \frac{8}{60\,\alpha}\lambda^{-3} + 1.063, \qquad \alpha(1.4) = 0.851071854758$$

and farther the weak-shock law that leaves the last node in value and slope
(`waves/shock.py`). The curvature jumps where the three meet, and nowhere else. The
arrival is the integral of one over the speed,

$$\frac{c_0 t}{R_0} = \int_0^\lambda \frac{d\lambda}{M}, \qquad
  M^2 = 1 + \tfrac67 x, \qquad R_0 = (E/P_0)^{1/3}$$

as a series below the first node, a table from there to $\lambda$ = 1e4, and past it the
head start over sound of a weak shock (`waves/curves.py`).

On the grid the pressure is within 1e-6 of the method of characteristics in all 41 rows
of its table there (S. Hancock, blast-ips, table S1x4, itself good to 7e-7) and within
2e-6 of the solver between the nodes; the arrival is within 4e-6 of the table and 5e-6
of the solver's. Beyond the grid, to Z = 1e4, the weak-shock continuation joins the
solver, with its error stated: against the same table 0.02 % low at $\lambda$ = 228,
0.09 % at 664, 0.21 % at 2359 (Z = 8150), 0.37 % at 1.07e4, 0.7 % at 5.7e5
(`calibration/results/point_source.txt`).

A charge of TNT is no point source, and its products continue to burn: by the pressure
in free air of Kingery and Bulmash it acts as a point source of 1.5 MJ/kg at Z = 0.3,
3.0 at 0.5, 5.35 at 1, 6.4 at 2, 5.2 at 10 to 20, 4.1 at 40. So with 4.184 MJ/kg this
law gives 2.7 times their pressure at Z = 0.3, 1.4 at 0.5, 0.80 at 1, 0.73 at 2, 0.91 at
10 and 20, and the arrival is 0.36, 0.57, 0.88, 1.06, 1.02 and 1.02 of theirs.

Range: $\lambda \ge 0.1$ (Z = 0.346, 158 ambient pressures: real air has lost its gamma
of 1.4 well before) to Z = 1e4 of arrival and speed, where absorption counts; the
pressure to Z = 300, past which recorded peaks are half of a weak shock's
(`waves/shock.py`). Outside it remains finite, by the strong limit and the weak-shock
law.
"""

import math
from functools import cache

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Bool, Float

from jblast.constants import (
    STANDARD_PRESSURE,
    STANDARD_SOUND_SPEED,
    TNT_SPECIFIC_ENERGY,
)
from jblast.registry import Law, declared_scatter, register
from jblast.types import as_float_array, as_float_arrays
from jblast.waves.arguments import checked
from jblast.waves.curves import (
    Arrival,
    HermiteCurve,
    Tail,
    clamped_log_spline,
    data_rows,
    head_start,
    hermite_curve,
    log_sound_fraction,
)
from jblast.waves.scaling import scaled_distance
from jblast.waves.shock import FAR_END, WeakShockTail, measured_far_scatter, tail_from

LENGTH = (TNT_SPECIFIC_ENERGY / STANDARD_PRESSURE) ** (1.0 / 3.0)
"""Scaled distance of lambda = 1 [m/kg^(1/3)]: 3.456."""
ENDS = (0.1, 100.0)
r"""$\lambda$ of the first and the last node, where the curvature jumps."""
RANGE = (ENDS[0] * LENGTH, 1e4)
"""Valid scaled distances [m/kg^(1/3)]."""
# The remaining error is 1e-9 of the arrival.
ARRIVAL_PARTS = 3
"""Intervals of the arrival table for each of the pressure table."""
# $x$ is 1e-5 there, and its square negligible.
ARRIVAL_END = 1e4
r"""Largest $\lambda$ of the arrival table."""
SEDOV_ALPHA = 0.851071854758
"""$E t^2/(\rho_0 R^5)$ for gamma 1.4; `laws/sedov_taylor.py` computes it."""
STRONG = 8.0 / (60.0 * SEDOV_ALPHA)
"""$x \\lambda^3$ of the strong limit: $p = 8E/(25 \\cdot 2.4\\,\\alpha R^3)$."""


def _log_lambda(slant_range, charge_mass, ambient_pressure) -> Float[Array, "..."]:
    """Return the logarithm of the distance in units of $(E/P_0)^{1/3}$."""
    radius, mass, ambient = as_float_arrays(slant_range, charge_mass, ambient_pressure)
    return jnp.log(radius) - jnp.log(TNT_SPECIFIC_ENERGY * mass / ambient) / 3.0


@checked
def point_source_pressure(
    slant_range: Float[ArrayLike, "..."],
    charge_mass: Float[ArrayLike, "..."],
    ambient_pressure: Float[ArrayLike, "..."] = STANDARD_PRESSURE,
) -> Float[Array, "..."]:
    """Return the peak incident overpressure [Pa].

    Args:
        slant_range: Range $R$ [m], positive.
        charge_mass: Hydrodynamic energy $E$ as TNT of 4.184 MJ/kg [kg], positive.
        ambient_pressure: $P_0$ [Pa], positive.
    """
    log_lambda = _log_lambda(slant_range, charge_mass, ambient_pressure)
    return as_float_array(ambient_pressure) * jnp.exp(
        log_overpressure_ratio(log_lambda)
    )


@checked
def point_source_shock_speed(
    slant_range: Float[ArrayLike, "..."],
    charge_mass: Float[ArrayLike, "..."],
    ambient_pressure: Float[ArrayLike, "..."] = STANDARD_PRESSURE,
    sound_speed: Float[ArrayLike, "..."] = STANDARD_SOUND_SPEED,
) -> Float[Array, "..."]:
    r"""Return the speed of the shock front, $c_0\sqrt{1 + \tfrac67 p/P_0}$ [m/s].

    Args:
        slant_range: Range $R$ [m], positive.
        charge_mass: Hydrodynamic energy $E$ as TNT of 4.184 MJ/kg [kg], positive.
        ambient_pressure: $P_0$ [Pa], positive.
        sound_speed: $c_0$ [m/s], positive.
    """
    log_lambda = _log_lambda(slant_range, charge_mass, ambient_pressure)
    return as_float_array(sound_speed) * point_source_mach_number(log_lambda)


@checked
def point_source_arrival_time(
    slant_range: Float[ArrayLike, "..."],
    charge_mass: Float[ArrayLike, "..."],
    ambient_pressure: Float[ArrayLike, "..."] = STANDARD_PRESSURE,
    sound_speed: Float[ArrayLike, "..."] = STANDARD_SOUND_SPEED,
) -> Float[Array, "..."]:
    r"""Return the time from detonation to the arrival of the shock [s].

    $$t = \int_0^R dr/U$$

    Args:
        slant_range: Range $R$ [m], positive.
        charge_mass: Hydrodynamic energy $E$ as TNT of 4.184 MJ/kg [kg], positive.
        ambient_pressure: $P_0$ [Pa], positive.
        sound_speed: $c_0$ [m/s], positive.
    """
    log_lambda = _log_lambda(slant_range, charge_mass, ambient_pressure)
    sound_time = as_float_array(slant_range) / as_float_array(sound_speed)
    return sound_time * jnp.exp(log_sound_fraction(log_lambda, point_source_arrival()))


def point_source_valid(
    slant_range: Float[ArrayLike, "..."],
    charge_mass: Float[ArrayLike, "..."],
    ambient_pressure: Float[ArrayLike, "..."] = STANDARD_PRESSURE,
    burst: str = "surface",
) -> Bool[Array, "..."]:
    """Return True where arrival and speed are valid: Z = 0.346 to 1e4 in free air."""
    z = scaled_distance(slant_range, charge_mass, ambient_pressure)
    return (z >= RANGE[0]) & (z <= RANGE[1]) & (burst == "free-air")


def point_source_pressure_valid(
    slant_range: Float[ArrayLike, "..."],
    charge_mass: Float[ArrayLike, "..."],
    ambient_pressure: Float[ArrayLike, "..."] = STANDARD_PRESSURE,
    burst: str = "surface",
) -> Bool[Array, "..."]:
    """Return True where the pressure is valid: Z = 0.346 to 300 in free air."""
    z = scaled_distance(slant_range, charge_mass, ambient_pressure)
    return (z >= RANGE[0]) & (z <= FAR_END) & (burst == "free-air")


@cache
def point_source_arrival() -> Arrival:
    r"""Integrate 1/M: in NumPy, always in float64, also under jit.

    The near curve has evenly spaced nodes that include those of the pressure. The
    pressure is a spline, which no single series reproduces.
    """
    curve = point_source_curve()
    first, step = float(curve.nodes[0]), np.diff(curve.nodes)[0] / ARRIVAL_PARTS
    count = math.ceil((math.log(ARRIVAL_END) - first) / step)
    nodes = first + step * np.arange(count + 1)
    points, weights = np.polynomial.legendre.leggauss(8)
    inner = nodes[:-1, None] + step * (points + 1.0) / 2.0
    parts = (np.exp(inner) / _mach_number(inner)) @ weights * step / 2.0
    start = math.exp(first + float(_log_fraction_near(first)))
    arrival = start + np.concatenate([[0.0], np.cumsum(parts)])
    slopes = np.exp(nodes) / (_mach_number(nodes) * arrival) - 1.0
    tail = point_source_tail()
    # Degree 0 gives a straight line: the shock is weak enough there.
    weak = Tail(tail.log_pressure, degree=0, log_length=math.log(tail.length))
    last, lead = float(nodes[-1]), float(np.exp(nodes[-1]) - arrival[-1])
    return Arrival(
        first=first,
        join=last,
        inner=_log_fraction_near,
        near=hermite_curve(nodes, np.log(arrival) - nodes, slopes).value,
        head_start=head_start(weak, last, lead),
        mach_number=point_source_mach_number,
    )


def _log_fraction_near(log_lambda):
    r"""Return ln(c t/R) of $M^2 = a\lambda^{-3} + b$, below the first node.

    $$c_0 t/R_0 = \tfrac25 a^{-1/2} \lambda^{5/2} \left[1 - \tfrac12 \tfrac5{11} w +
    \tfrac38 \tfrac5{17} w^2 - \dots\right], \qquad w = b\lambda^3/a < 0.015$$

    Its first factor is Sedov's and Taylor's $R = (E t^2/\alpha\rho_0)^{1/5}$.
    """
    a, b = 6.0 / 7.0 * STRONG, 1.0 + 6.0 / 7.0 * strong_offset()
    # NumPy where the table starts, in float64; JAX in the law.
    xp = np if isinstance(log_lambda, float) else jnp
    w = b / a * xp.exp(3.0 * log_lambda)
    total, binomial = 0.0, 1.0  # binomial coefficients of (1 + w)^(-1/2)
    terms = []
    for n in range(7):
        terms.append(binomial * 5.0 / (5.0 + 6.0 * n))
        binomial *= -(n + 0.5) / (n + 1.0)
    for term in reversed(terms[1:]):
        total = (total + term) * w
    # the sum is small near the source, and log1p keeps its digits
    return math.log(0.4 / math.sqrt(a)) + 1.5 * log_lambda + xp.log1p(total)


def _mach_number(log_lambda: Float[np.ndarray, "..."]) -> Float[np.ndarray, "..."]:
    """Return U/c from the first node on, in NumPy (see `point_source_mach_number`)."""
    curve, tail = point_source_curve(), point_source_tail()
    last = curve.nodes[-1]
    far = np.maximum(log_lambda, last)
    near = curve.inside(np.minimum(log_lambda, last))
    ratio = np.where(log_lambda > last, tail.log_pressure(far), near)
    return np.sqrt(1.0 + 6.0 / 7.0 * np.exp(ratio))


@cache
def point_source_curve() -> HermiteCurve:
    r"""Return $\ln x$ against $\ln\lambda$ from 0.1 to 100, its nodes evenly spaced."""
    rows = data_rows("point_source_euler")
    table = np.array([[float(value) for value in row.values()] for row in rows])
    distance, pressure, slopes, _ = table.T
    # With eight digits the nodes are even to 1e-7 only, fewer digits than the values.
    distance = np.geomspace(*ENDS, distance.size)
    # The slope of the strong limit and its constant; the solver's is 2e-4 steeper.
    start = -3.0 * STRONG / (distance[0] ** 3 * pressure[0])
    return clamped_log_spline(distance, pressure, start, slopes[-1])


@cache
def point_source_tail() -> WeakShockTail:
    r"""Return the weak-shock tail beyond the last node: $x$ against $\lambda$."""
    curve = point_source_curve()
    return tail_from(ENDS[1], math.exp(curve.coefficients[-1].sum()), curve.slope_after)


@cache
def strong_offset() -> float:
    """Return the excess of the first node over the strong limit."""
    return math.exp(point_source_curve().coefficients[0, 0]) - STRONG / ENDS[0] ** 3


def log_overpressure_ratio(log_lambda: Float[Array, "..."]) -> Float[Array, "..."]:
    """Return ln(p/P0)."""
    curve, offset = point_source_curve(), strong_offset()
    first, last = math.log(ENDS[0]), math.log(ENDS[1])
    # Each branch has an argument in its own range, so that no unused gradient is NaN.
    close = jnp.minimum(log_lambda, first)
    strong = math.log(STRONG) - 3.0 * close
    strong = strong + jnp.log1p(offset / STRONG * jnp.exp(3.0 * close))
    near, far = log_lambda < first, log_lambda > last
    between = curve.value(jnp.where(near | far, last, log_lambda))
    weak = point_source_tail().log_pressure(jnp.where(far, log_lambda, last))
    return jnp.where(near, strong, jnp.where(far, weak, between))


def point_source_mach_number(log_lambda: Float[Array, "..."]) -> Float[Array, "..."]:
    """Return U/c."""
    return jnp.sqrt(1.0 + 6.0 / 7.0 * jnp.exp(log_overpressure_ratio(log_lambda)))


for _quantity, _function, _valid, _last, _sd, _far in (
    (
        "air_arrival_s",
        point_source_arrival_time,
        point_source_valid,
        "1e4 m/kg^(1/3)",
        0.01,
        None,
    ),
    (
        "peak_overpressure_pa",
        point_source_pressure,
        point_source_pressure_valid,
        "300 m/kg^(1/3)",
        0.10,
        measured_far_scatter("peak_overpressure_pa"),
    ),
    (
        "shock_speed_m_s",
        point_source_shock_speed,
        point_source_valid,
        "1e4 m/kg^(1/3)",
        0.01,
        None,
    ),
):
    register(
        Law(
            quantity=_quantity,
            name="point_source",
            title="point-source",
            function=_function,
            range=f"free air, Z = 0.346 to {_last}; source small and light",
            source="jblast.waves.euler to Z = 346, weak-shock tail; 1/U integrated",
            valid=_valid,
            scatter=declared_scatter(shot=_sd, record=_sd),
            scatter_source="declared",
            joins=tuple(LENGTH * end for end in ENDS),
            far_scatter=_far,
        )
    )
