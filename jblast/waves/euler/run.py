r"""Runs: many steps in one scan, with records of the front and the gauges.

`run` is pure and has a fixed number of steps, so that it can be batched and
differentiated. `march` calls one compiled segment after another until the end is
reached. Gauges at fixed radii interpolate the profile linearly between the centres of
the cells.

The pressure of the fitted shock at a radius is interpolated between the records of a
run. The last step of a run is shorter than the others. The pressure behind the shock
then differs by 6e-6 with 200 cells, and the length of the step jumps as a parameter
varies. Differences of runs show the jumps; derivatives do not, because the steps are
constant there. The records before the end come from whole steps and lie on a smooth
curve.

The point source is run from the strong shock to $\lambda = 100$ in scaled terms: with
$P_0 = \rho_0 = E = 1$ the radius of the shock is $\lambda = R\,(P_0/E)^{1/3}$. The
limit of three such runs is the reference of the laws.
"""

import functools
from collections.abc import Sequence
from dataclasses import dataclass

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Bool, Float

from jblast.errors import InputError
from jblast.types import as_float_array
from jblast.waves.curves import hermite_curve
from jblast.waves.euler.initial import START_FRACTION, start_sedov
from jblast.waves.euler.state import (
    Ambient,
    Flow,
    FlowState,
    Gas,
    Geometry,
    IdealGas,
    is_positive,
    primitives,
)
from jblast.waves.euler.step import fitted_front, step

# Up to here the error is that of the grid; a smooth wave has twice the error at 0.85
# and 3.7 times at 1 (`jblast stability solver`).
COURANT = 0.7
"""Default fraction of the largest stable step."""
# Some hundred records a call hide the cost of the call; a march may overrun its end by
# one call of steps without length.
RECORDS = 500
"""Records of one compiled call."""
CUBIC_POINTS = 4
"""Records that define a cubic, two on either side."""
STRIDE = 10
"""Steps between records: 2 % of the radius with 100 cells, less later and with more."""
# The scheme has orders 1 to 2; an estimate outside is noise of a vanishing difference.
ORDERS = (0.8, 2.5)
"""Limits of an observed order of convergence; estimates outside are clipped."""
START_FORGOTTEN = 0.1
r"""$\lambda$ from which on errors of the start are negligible."""


class History(eqx.Module):
    """Records of a run, each at the begin of a segment of steps: the first axis.

    Attributes:
        clock: Radius of the fitted shock [m], or time [s] if none is fitted.
        time: Time [s].
        front_pressure: Pressure behind the shock, or in the last cell at a wall [Pa].
        front_velocity: Velocity behind the shock [m/s].
        front_speed: Speed of the shock [m/s]; 1 if none is fitted.
        pressure: Pressure at each gauge [Pa].
        velocity: Outward velocity at each gauge [m/s].
        alive: True if all densities and pressures were positive.
    """

    clock: Float[Array, "..."]
    time: Float[Array, "..."]
    front_pressure: Float[Array, "..."]
    front_velocity: Float[Array, "..."]
    front_speed: Float[Array, "..."]
    pressure: Float[Array, "..."]
    velocity: Float[Array, "..."]
    alive: Bool[Array, "..."]


def run(
    state: FlowState,
    flow: Flow,
    end: Float[ArrayLike, "..."],
    *,
    records: int,
    stride: int = 1,
    courant: float = COURANT,
    gauges: Sequence[float] | Float[Array, " gauge"] = (),
    frugal: bool = False,
) -> tuple[FlowState, History]:
    """Advance by `records` times `stride` steps, or until the end.

    If a density or pressure is no longer positive, the run stops: the last state is the
    first one with this fault, and that state and all later records are not alive.

    The function is pure: it can be jitted, batched and differentiated in both modes.
    Reverse mode stores the state at each step and recomputes the rest of the step. Its
    memory grows with the number of steps, by five numbers per cell and step; with
    `frugal`, by `records + stride`.

    Args:
        state: State of the flow.
        flow: Constants of the run.
        end: Final clock: radius of the shock [m], or time [s].
        records: Number of segments.
        stride: Steps in a segment.
        courant: Fraction of the largest stable step, above 0 and at most 1. Up to the
            default 0.7 the error is that of the grid alone. The error of a smooth wave
            in 100 cells is twice as large at 0.85, and 3.7 times at 1.
        gauges: Radii at which pressure and velocity are recorded [m].
        frugal: True to store in reverse mode the states at the records only, and to run
            each segment a second time.

    Raises:
        InputError: The fraction is above 1, or not positive.
    """
    if not 0.0 < courant <= 1.0:
        raise InputError(
            f"courant: expected at most 1, the limit of an explicit step, and above 0, "
            f"got {courant:g}"
        )
    end = jnp.broadcast_to(as_float_array(end), state.clock.shape)
    radii = jnp.asarray(gauges, state.radius.dtype)

    # Inside a scan no common subexpressions can be shared, so no barrier is needed.
    recomputed = functools.partial(jax.checkpoint, prevent_cse=False)

    @recomputed
    def one_step(state: FlowState, _) -> tuple[FlowState, None]:
        return step(state, flow, courant, end)[0], None

    def segment(state: FlowState, _) -> tuple[FlowState, History]:
        first, front = recomputed(lambda s: step(s, flow, courant, end))(state)
        pressure, velocity = gauge_readings(state, flow, radii)
        record = History(
            clock=state.clock,
            time=state.time,
            front_pressure=front.pressure,
            front_velocity=front.velocity,
            front_speed=front.speed,
            pressure=pressure,
            velocity=velocity,
            alive=first.alive,
        )
        last, _ = jax.lax.scan(one_step, first, length=stride - 1)
        return last, record

    last, history = jax.lax.scan(
        recomputed(segment) if frugal else segment, state, length=records
    )
    # Each step checks the state before it, so the last state is still unchecked.
    alive = last.alive & is_positive(last, flow.gas)
    return eqx.tree_at(lambda s: s.alive, last, alive), history


@dataclass(frozen=True)
class March:
    """Result of a run.

    Attributes:
        state: State at the end, or the last state with positive densities and
            pressures.
        history: Records until then, as NumPy arrays.
        lost: Message with radius and time at which positivity was lost; else empty.
    """

    state: FlowState
    history: History
    lost: str


def march(
    state: FlowState,
    flow: Flow,
    end: float,
    *,
    stride: int = 10,
    courant: float = COURANT,
    gauges: Sequence[float] = (),
) -> March:
    """Run one flow until its clock is at the end. It cannot be differentiated.

    Args:
        state: State of the flow.
        flow: Constants of the run.
        end: Radius of the shock [m], or time [s] if none is fitted.
        stride: Steps between records.
        courant: Fraction of the largest stable step, as in `run`.
        gauges: Radii at which pressure and velocity are recorded [m].

    Raises:
        InputError: The fraction of the largest stable step is above 1.
    """
    parts = []
    while True:
        begun = state
        state, history = _segment(state, flow, end, stride, courant, gauges)
        parts.append(jax.tree.map(np.asarray, history))
        if not state.alive or parts[-1].clock[-1] >= end:
            break
        if not parts[-1].clock[-1] > parts[-1].clock[0]:
            raise RuntimeError(
                f"expected steps of a positive length, got zero at clock "
                f"{float(state.clock):g}, before the end at {end:g}"
            )
    whole: History = jax.tree.map(lambda *part: np.concatenate(part), *parts)
    moved = np.concatenate([[True], np.diff(whole.clock) > 0.0])
    history = jax.tree.map(lambda values: values[moved & whole.alive], whole)
    if state.alive:
        return March(state, history, "")
    before, after = _last_step(begun, flow, end, courant)
    return March(before, history, _where_lost(before, after, flow.gas))


# nothing is donated: a segment that fails is repeated from its first state
@functools.partial(eqx.filter_jit, donate="none")
def _segment(state, flow, end, stride, courant, gauges):
    return run(
        state,
        flow,
        end,
        records=RECORDS,
        stride=stride,
        courant=courant,
        gauges=gauges,
    )


@eqx.filter_jit
def _last_step(state, flow, end, courant) -> tuple[FlowState, FlowState]:
    """Return the last state with positive values, and the first without."""

    def onward(pair):
        return pair[1], step(pair[1], flow, courant, jnp.asarray(end))[0]

    return jax.lax.while_loop(
        lambda pair: is_positive(pair[1], flow.gas), onward, (state, state)
    )


def _where_lost(before: FlowState, after: FlowState, gas: Gas) -> str:
    """Return the message on the innermost cell that lost positivity."""
    was, is_now = primitives(before, gas), primitives(after, gas)
    good = (np.asarray(is_now.density) > 0.0) & (np.asarray(is_now.pressure) > 0.0)
    at = int(np.argmin(good))
    radius = float(cell_centres(before.radius, "planar")[at])
    return (
        f"positivity lost at r = {radius:.6g} m, t = {float(before.time):.6g} s, in "
        f"cell {at}: a step takes its density from {float(was.density[at]):.3g} to "
        f"{float(is_now.density[at]):.3g} kg/m3, its pressure from "
        f"{float(was.pressure[at]):.3g} to {float(is_now.pressure[at]):.3g} Pa"
    )


def cell_centres(
    radius: Float[Array, "face ..."], geometry: Geometry
) -> Float[Array, "cell ..."]:
    r"""Return the radii at which a linear profile has the means of the cells [m].

    $$\frac34 \frac{r_2^4 - r_1^4}{r_2^3 - r_1^3} =
    \frac34 \frac{(r_1+r_2)(r_1^2+r_2^2)}{r_1^2+r_1r_2+r_2^2}$$
    """
    a, b = radius[:-1], radius[1:]
    if geometry == "planar":
        return 0.5 * (a + b)
    return 0.75 * (a + b) * (a * a + b * b) / (a * a + a * b + b * b)


def gauge_readings(
    state: FlowState, flow: Flow, gauges: Float[Array, " gauge"]
) -> tuple[Float[Array, " gauge"], Float[Array, " gauge"]]:
    """Return pressure [Pa] and velocity [m/s] at radii.

    The values ahead of a fitted shock are those of the ambient air. Up to the shock the
    profile is interpolated to the state behind it. Inside the first centre, and beyond
    the last at a wall, the values are the means of that cell.

    Args:
        state: State of one run, without batch axes.
        flow: Constants of the run.
        gauges: Radii [m].
    """
    if gauges.shape[0] == 0:
        return gauges, gauges
    cells = primitives(state, flow.gas)
    centres = cell_centres(state.radius, flow.geometry)
    if flow.ambient is None:
        # interp is constant beyond the outermost centres, as at a rigid wall
        return (
            jnp.interp(gauges, centres, cells.pressure),
            jnp.interp(gauges, centres, cells.velocity),
        )
    front = fitted_front(cells, flow.gas.of_cells(slice(-1, None)), flow.ambient)
    radii = jnp.concatenate([centres, state.radius[-1:]])
    ahead = gauges > state.radius[-1]
    pressure = jnp.concatenate([cells.pressure, front.pressure[None]])
    velocity = jnp.concatenate([cells.velocity, front.velocity[None]])
    return (
        jnp.where(ahead, flow.ambient.pressure, jnp.interp(gauges, radii, pressure)),
        jnp.where(ahead, 0.0, jnp.interp(gauges, radii, velocity)),
    )


def front_pressure_at(history: History, radius: Float[Array, ""]) -> Float[Array, ""]:
    r"""Return the pressure behind the shock as it passes a radius [Pa].

    It is the cubic through four records of $\ln p$ against $\ln R$, and NaN without two
    records before the radius and two beyond it.

    Args:
        history: Records of one run with a fitted shock that ends beyond the radius.
        radius: Radius [m].
    """
    beyond = jnp.searchsorted(history.clock, radius, side="right")
    first = jnp.clip(beyond - CUBIC_POINTS // 2, 0, history.clock.size - CUBIC_POINTS)
    x, y = (
        jnp.log(jax.lax.dynamic_slice(values, (first,), (CUBIC_POINTS,)))
        for values in (history.clock, history.front_pressure)
    )
    # Centred at the radius, the value is the constant term; scaled, it is well posed.
    offset = x - jnp.log(radius)
    powers = jnp.vander(offset / (x[-1] - x[0]))
    value = jnp.exp(jnp.linalg.solve(powers, y)[-1])
    # A run that has reached its end repeats its last record.
    apart = (beyond - CUBIC_POINTS // 2 == first) & jnp.all(jnp.diff(x) > 0.0)
    return jnp.where(apart, value, jnp.nan)


@dataclass(frozen=True)
class Decay:
    r"""Decay of the shock of a point source.

    Attributes:
        scaled: $\lambda$ [-], ascending.
        overpressure_ratio: $p/P_0$ [-].
        slope: $d\ln p/d\ln\lambda$ [-].
        arrival: $c_0 t\,(P_0/E)^{1/3}$ [-].
    """

    scaled: Float[np.ndarray, " node"]
    overpressure_ratio: Float[np.ndarray, " node"]
    slope: Float[np.ndarray, " node"]
    arrival: Float[np.ndarray, " node"]


def point_source_march(
    cells: int,
    end: float,
    *,
    courant: float = COURANT,
    limited: bool = True,
    stride: int = STRIDE,
    gauges: Sequence[float] = (),
) -> March:
    r"""Run a point source in air of gamma 1.4.

    Args:
        cells: Number of cells.
        end: $\lambda$ at the end [-].
        courant: Fraction of the largest stable step.
        limited: True for limited slopes.
        stride: Steps between records.
        gauges: $\lambda$ at which pressure and velocity are recorded [-].

    Raises:
        InputError: There are too few cells to resolve the source.
    """
    air = Ambient(jnp.ones(()), jnp.ones(()), IdealGas())
    flow, state = start_sedov(1.0, air, START_FRACTION, cells=cells, limited=limited)
    return march(state, flow, end, stride=stride, courant=courant, gauges=gauges)


def decay_at(
    scaled: Float[np.ndarray, " node"], run: March, gamma: float = 1.4
) -> Decay:
    r"""Return the decay at scaled distances, from the records of a run.

    The time between records is integrated from the speed of the shock at each. The
    slope of the pressure is that of parabolas through three records.

    Args:
        scaled: $\lambda$ [-], within the run.
        run: Result of a run.
        gamma: Ratio of specific heats [-].
    """
    history = run.history
    # in logarithms both curves are nearly straight between two records
    x = np.log(history.clock)
    y = np.log(np.asarray(history.front_pressure) - 1.0)
    slopes = _parabola_slopes(x, y)
    pressure = hermite_curve(x, y, slopes)
    sound = np.sqrt(gamma)
    log_time = np.log(sound * np.asarray(history.time))
    time = hermite_curve(
        x, log_time, np.asarray(history.clock / (history.time * history.front_speed))
    )
    at = np.log(scaled)
    interval = np.clip(np.searchsorted(x, at, side="right") - 1, 0, len(x) - 2)
    share = (at - x[interval]) / (x[interval + 1] - x[interval])
    powers = share[:, None] ** np.arange(4)
    value = (pressure.coefficients[interval] * powers).sum(1)
    # interpolated, not differentiated: the derivative of the cubic is one order less
    slope = slopes[interval] + share * (slopes[interval + 1] - slopes[interval])
    arrival = (time.coefficients[interval] * powers).sum(1)
    return Decay(scaled, np.exp(value), slope, np.exp(arrival))


def extrapolated(
    scaled: Float[np.ndarray, " node"], coarse: March, middle: March, fine: March
) -> Decay:
    r"""Return the limit of three runs with doubled numbers of cells.

    $$q = q_3 + \frac{q_3 - q_2}{2^n - 1}, \qquad
    2^n = \frac{q_2-q_1}{q_3-q_2}$$

    with the observed order $n$: 1.7 until waves through the hot core catch up with the
    shock, and 1 beyond. The finer the core, the farther out they do: near $\lambda$ =
    0.78, 1.0, 1.25, 1.49, 1.76 with 100, 200, ..., 1600 cells. Between this radius of
    the coarse run and that of the fine one, the three runs have two orders and the
    observed one has no meaning. There the two runs on one side give the limit, with the
    order that three runs have on that side.

    Args:
        scaled: $\lambda$ [-], ascending, within the runs.
        coarse: The first run.
        middle: The second.
        fine: The third.
    """
    runs = [decay_at(scaled, run) for run in (coarse, middle, fine)]
    falls, ratios = _falls(coarse, middle, fine)

    def limit(a, b, c, *, mixed):
        change = np.where(c == b, 1.0, c - b)
        ratio = np.clip((b - a) / change, 2.0 ** ORDERS[0], 2.0 ** ORDERS[1])
        seen = c + (c - b) / (ratio - 1.0)
        if not mixed:
            return seen
        before = c + (c - b) / (ratios[0] - 1.0)
        behind = b + (b - a) / (ratios[1] - 1.0)
        between = [scaled < end for end in falls]
        return np.select(between, [seen, before, behind], seen)

    return Decay(
        scaled,
        np.exp(limit(*(np.log(r.overpressure_ratio) for r in runs), mixed=True)),
        limit(*(run.slope for run in runs), mixed=True),
        # an integral over all smaller radii, which mixes both orders
        np.exp(limit(*(np.log(run.arrival) for run in runs), mixed=False)),
    )


def _falls(coarse: March, middle: March, fine: March):
    r"""Return the radii at which the order falls, and $2^n$ before and behind.

    Returns:
        $\lambda$ of the fall in the coarse and in the middle run, where the error of
        their pressure is largest, and an upper bound for the fine one, because the
        ratio of successive radii decreases. Then $2^n$ at the last radius before all
        three and at the first behind.
    """
    runs = (coarse, middle, fine)
    end = min(float(run.history.clock[-1]) for run in runs)
    nodes = np.geomspace(START_FORGOTTEN, end, 2000)
    first, second, third = (
        np.log(decay_at(nodes, run).overpressure_ratio) for run in runs
    )
    changes = second - first, third - second
    radii = [nodes[np.argmax(np.abs(change))] for change in changes]
    last = radii[1] ** 2 / radii[0]
    # one or two records before the fall, which parabolas through three records smooth
    at = np.searchsorted(nodes[:-1], [radii[0] / 1.02, last])
    return (*radii, last), changes[0][at] / changes[1][at]


def _parabola_slopes(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return dy/dx at nodes by parabolas through three nodes each (second order)."""
    width = np.diff(x)
    chord = np.diff(y) / width
    inner = (width[1:] * chord[:-1] + width[:-1] * chord[1:]) / (width[1:] + width[:-1])
    return np.concatenate(
        [[2.0 * chord[0] - inner[0]], inner, [2 * chord[-1] - inner[-1]]]
    )
