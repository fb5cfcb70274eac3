r"""Runs: many steps in one scan, with records of the front and the gauges.

`run` is pure and has a fixed number of steps, to be batched and differentiated. `march`
calls one compiled segment after another until the end is reached. Gauges at fixed radii
read the profile between the centres of the cells by linear interpolation.

The pressure of the fitted shock at a radius is interpolated between the records of a
run. A run ends by a step cut short. Such a step leaves another pressure behind the
shock than a whole one, by 6e-6 with 200 cells, and its length jumps as a parameter
varies: differences of runs show the jumps, derivatives do not, for they hold the steps.
The records on the way come from whole steps and lie on a smooth curve.

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

COURANT = 0.7
"""Fraction of the largest stable step that is usual."""
RECORDS = 500
"""Records of one compiled call."""
CUBIC_POINTS = 4
"""Records that a cubic goes through, two on either side."""
STRIDE = 10
"""Steps between records: 2 % of the radius with 100 cells, less later and with more."""
ORDERS = (0.8, 2.5)
"""Between these an observed order is believed; outside, the nearer of the two."""
START_FORGOTTEN = 0.1
r"""$\lambda$ from where on the start is forgotten and errors are the scheme's."""


class History(eqx.Module):
    """What was recorded, each at the beginning of a stretch of steps: the first axis.

    Attributes:
        clock: Radius of the fitted shock [m], or time [s] where none is fitted.
        time: [s].
        front_pressure: Behind the shock [Pa], or in the last cell before the wall.
        front_velocity: Behind the shock [m/s].
        front_speed: Of the shock [m/s]; 1 where none is fitted.
        pressure: At each gauge [Pa].
        velocity: At each gauge, outward [m/s].
        alive: Whether the densities and pressures were all positive.
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
    """Advance by `records` times `stride` steps, or to the end and stand there.

    Where a density or pressure is not positive any more the run stands: the last state
    is the first such one, and it and the records from then on are not alive.

    Pure: it can be jitted, batched and differentiated, both ways. Reverse mode
    keeps the state at each step and works out again what is within one: memory grows
    with the number of steps, by five numbers a cell and step; `frugal`, with
    `records + stride`.

    Args:
        state: Where the flow is.
        flow: What does not change.
        end: The clock goes that far: radius of the shock [m], or time [s].
        records: How many stretches.
        stride: Steps in a stretch.
        courant: Fraction of the largest stable step, above 0 and at most 1. Up to the
            usual 0.7 the error is that of the grid alone; that of a smooth wave in 100
            cells is twice as large at 0.85, and 3.7 times at 1. None is refused for it.
        gauges: Radii at which pressure and velocity are recorded [m].
        frugal: Whether reverse mode keeps the states at the records alone, and runs
            each stretch a second time.

    Raises:
        InputError: The fraction is above 1, or not positive.
    """
    if not 0.0 < courant <= 1.0:
        raise InputError(
            f"courant: expected at most 1, the limit of an explicit step, and above 0, "
            f"got {courant:g}"
        )
    end = jnp.broadcast_to(as_float_array(end), state.clock.shape)
    places = jnp.asarray(gauges, state.radius.dtype)

    # A scan keeps what it saves apart by itself.
    once_more = functools.partial(jax.checkpoint, prevent_cse=False)

    @once_more
    def again(state: FlowState, _) -> tuple[FlowState, None]:
        return step(state, flow, courant, end)[0], None

    def stretch(state: FlowState, _) -> tuple[FlowState, History]:
        first, front = once_more(lambda s: step(s, flow, courant, end))(state)
        pressure, velocity = gauge_readings(state, flow, places)
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
        last, _ = jax.lax.scan(again, first, length=stride - 1)
        return last, record

    last, history = jax.lax.scan(
        once_more(stretch) if frugal else stretch, state, length=records
    )
    # The last step has been looked at by none after it.
    alive = last.alive & is_positive(last, flow.gas)
    return eqx.tree_at(lambda s: s.alive, last, alive), history


@dataclass(frozen=True)
class March:
    """How far a run came.

    Attributes:
        state: Where it ended: at the end, or the last state with positive densities and
            pressures.
        history: What was recorded until then, as NumPy arrays.
        lost: Where and when positivity was lost, in words; empty if it was not.
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
        state: Where the flow is.
        flow: What does not change.
        end: Radius of the shock [m], or time [s] where none is fitted.
        stride: Steps from one record to the next.
        courant: Fraction of the largest stable step, as in `run`.
        gauges: Radii at which pressure and velocity are recorded [m].

    Raises:
        InputError: The fraction of the largest stable step is above 1.
    """
    parts = []
    while True:
        begun = state
        state, history = _stretch(state, flow, end, stride, courant, gauges)
        parts.append(jax.tree.map(np.asarray, history))
        if not state.alive or parts[-1].clock[-1] >= end:
            break
        if not parts[-1].clock[-1] > parts[-1].clock[0]:
            raise RuntimeError(
                f"steps have shrunk to nothing at clock {float(state.clock):g}, before "
                f"the end at {end:g}"
            )
    whole: History = jax.tree.map(lambda *part: np.concatenate(part), *parts)
    moved = np.concatenate([[True], np.diff(whole.clock) > 0.0])
    history = jax.tree.map(lambda values: values[moved & whole.alive], whole)
    if state.alive:
        return March(state, history, "")
    before, after = _last_step(begun, flow, end, courant)
    return March(before, history, _where_lost(before, after, flow.gas))


# nothing is donated: a stretch that fails is done again from its first state
@functools.partial(eqx.filter_jit, donate="none")
def _stretch(state, flow, end, stride, courant, gauges):
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
    """Return the last state that is positive, and the first that is not."""

    def onward(pair):
        return pair[1], step(pair[1], flow, courant, jnp.asarray(end))[0]

    return jax.lax.while_loop(
        lambda pair: is_positive(pair[1], flow.gas), onward, (state, state)
    )


def _where_lost(before: FlowState, after: FlowState, gas: Gas) -> str:
    """Return the message; of several cells it names the innermost."""
    was, is_now = primitives(before, gas), primitives(after, gas)
    good = (np.asarray(is_now.density) > 0.0) & (np.asarray(is_now.pressure) > 0.0)
    at = int(np.argmin(good))
    place = float(cell_centres(before.radius, "planar")[at])
    return (
        f"positivity lost at r = {place:.6g} m, t = {float(before.time):.6g} s, in "
        f"cell {at}: a step takes its density from {float(was.density[at]):.3g} to "
        f"{float(is_now.density[at]):.3g} kg/m3, its pressure from "
        f"{float(was.pressure[at]):.3g} to {float(is_now.pressure[at]):.3g} Pa"
    )


def cell_centres(
    radius: Float[Array, "face ..."], geometry: Geometry
) -> Float[Array, "cell ..."]:
    r"""Return where the means of cells are reached by a straight profile [m].

    $$\frac34 \frac{r_2^4 - r_1^4}{r_2^3 - r_1^3} =
    \frac34 \frac{(r_1+r_2)(r_1^2+r_2^2)}{r_1^2+r_1r_2+r_2^2}$$
    """
    a, b = radius[:-1], radius[1:]
    if geometry == "planar":
        return 0.5 * (a + b)
    return 0.75 * (a + b) * (a * a + b * b) / (a * a + a * b + b * b)


def gauge_readings(
    state: FlowState, flow: Flow, places: Float[Array, " gauge"]
) -> tuple[Float[Array, " gauge"], Float[Array, " gauge"]]:
    """Return pressure [Pa] and velocity [m/s] at some radii.

    Ahead of a fitted shock it is that of the ambient air, and up to the shock the
    profile leads to what is behind it. Within the first centre, and past the last where
    there is a wall, it is the mean of that cell.

    Args:
        state: Of one run, not of a batch written out.
        flow: What does not change.
        places: Radii [m].
    """
    if places.shape[0] == 0:
        return places, places
    cells = primitives(state, flow.gas)
    centres = cell_centres(state.radius, flow.geometry)
    if flow.ambient is None:
        return (
            jnp.interp(places, centres, cells.pressure),
            jnp.interp(places, centres, cells.velocity),
        )
    front = fitted_front(cells, flow.gas.of_cells(slice(-1, None)), flow.ambient)
    radii = jnp.concatenate([centres, state.radius[-1:]])
    ahead = places > state.radius[-1]
    pressure = jnp.concatenate([cells.pressure, front.pressure[None]])
    velocity = jnp.concatenate([cells.velocity, front.velocity[None]])
    return (
        jnp.where(ahead, flow.ambient.pressure, jnp.interp(places, radii, pressure)),
        jnp.where(ahead, 0.0, jnp.interp(places, radii, velocity)),
    )


def front_pressure_at(history: History, radius: Float[Array, ""]) -> Float[Array, ""]:
    r"""Return the pressure behind the shock as it passes a radius [Pa].

    By the cubic through four records of $\ln p$ against $\ln R$.

    Args:
        history: Of one run with a fitted shock; it ends beyond the radius.
        radius: Where [m].

    Returns:
        It; NaN without two records before the radius and two beyond it.
    """
    beyond = jnp.searchsorted(history.clock, radius, side="right")
    first = jnp.clip(beyond - CUBIC_POINTS // 2, 0, history.clock.size - CUBIC_POINTS)
    x, y = (
        jnp.log(jax.lax.dynamic_slice(values, (first,), (CUBIC_POINTS,)))
        for values in (history.clock, history.front_pressure)
    )
    away = x - jnp.log(radius)
    powers = jnp.vander(away / (x[-1] - x[0]))
    value = jnp.exp(jnp.linalg.solve(powers, y)[-1])
    # A run that stands at its end repeats its last record.
    apart = (beyond - CUBIC_POINTS // 2 == first) & jnp.all(jnp.diff(x) > 0.0)
    return jnp.where(apart, value, jnp.nan)


@dataclass(frozen=True)
class Decay:
    r"""The decay of a point source's shock.

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
        cells: How many.
        end: $\lambda$ where it stops [-].
        courant: Fraction of the largest stable step.
        limited: Whether slopes are limited.
        stride: Steps from one record to the next.
        gauges: $\lambda$ at which pressure and velocity are recorded [-].

    Raises:
        InputError: There are too few cells to hold the source.
    """
    air = Ambient(jnp.ones(()), jnp.ones(()), IdealGas())
    flow, state = start_sedov(1.0, air, START_FRACTION, cells=cells, limited=limited)
    return march(state, flow, end, stride=stride, courant=courant, gauges=gauges)


def decay_at(
    scaled: Float[np.ndarray, " node"], run: March, gamma: float = 1.4
) -> Decay:
    r"""Return the decay at some distances, from the records of a run.

    The time between records is integrated from the speed of the shock, which is known
    at each; the slope of the pressure is that of parabolas through three records.

    Args:
        scaled: $\lambda$ [-], within the run.
        run: It.
        gamma: Ratio of specific heats [-].
    """
    history = run.history
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
    stretch = np.clip(np.searchsorted(x, at, side="right") - 1, 0, len(x) - 2)
    way = (at - x[stretch]) / (x[stretch + 1] - x[stretch])
    powers = way[:, None] ** np.arange(4)
    value = (pressure.coefficients[stretch] * powers).sum(1)
    slope = slopes[stretch] + way * (slopes[stretch + 1] - slopes[stretch])
    arrival = (time.coefficients[stretch] * powers).sum(1)
    return Decay(scaled, np.exp(value), slope, np.exp(arrival))


def extrapolated(
    scaled: Float[np.ndarray, " node"], coarse: March, middle: March, fine: March
) -> Decay:
    r"""Return the limit of three runs, each with twice the cells of the one before.

    $$q = q_3 + \frac{q_3 - q_2}{2^n - 1}, \qquad
    2^n = \frac{q_2-q_1}{q_3-q_2}$$

    with the order $n$ observed: 1.7 until waves that went through the hot core catch up
    with the shock, and 1 beyond. They do so the farther out, the finer the core: near
    $\lambda$ = 0.78, 1.0, 1.25, 1.49, 1.76 with 100, 200, ..., 1600 cells. Between the
    place of the coarse run and that of the fine one three runs are of two orders and
    none can be seen; there the two runs on one side give the limit, with the order that
    three had on that side.

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
        # an integral over all that came before, of no order of its own
        np.exp(limit(*(np.log(run.arrival) for run in runs), mixed=False)),
    )


def _falls(coarse: March, middle: March, fine: March):
    r"""Return where the order falls, and $2^n$ before and behind.

    Returns:
        $\lambda$ where it falls in the coarse and in the middle run, where their
        pressure has the largest error, and where it has fallen in the fine one: the
        places move out by a factor that shrinks. And $2^n$ of the last place before
        all three and of the first behind.
    """
    runs = (coarse, middle, fine)
    end = min(float(run.history.clock[-1]) for run in runs)
    nodes = np.geomspace(START_FORGOTTEN, end, 2000)
    first, second, third = (
        np.log(decay_at(nodes, run).overpressure_ratio) for run in runs
    )
    changes = second - first, third - second
    places = [nodes[np.argmax(np.abs(change))] for change in changes]
    last = places[1] ** 2 / places[0]
    # a record or two off the fall, which parabolas through three records round off
    at = np.searchsorted(nodes[:-1], [places[0] / 1.02, last])
    return (*places, last), changes[0][at] / changes[1][at]


def _parabola_slopes(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return dy/dx at nodes: that of a parabola through each three, second order."""
    width = np.diff(x)
    chord = np.diff(y) / width
    inner = (width[1:] * chord[:-1] + width[:-1] * chord[1:]) / (width[1:] + width[:-1])
    return np.concatenate(
        [[2.0 * chord[0] - inner[0]], inner, [2 * chord[-1] - inner[-1]]]
    )
