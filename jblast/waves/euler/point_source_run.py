r"""The point source from the strong shock to $\lambda = 100$, in scaled terms.

With $P_0 = \rho_0 = E = 1$ the radius of the shock is $\lambda = R\,(P_0/E)^{1/3}$.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jblast.waves.curves import hermite_curve
from jblast.waves.euler.initial import START_FRACTION, start_sedov
from jblast.waves.euler.run import COURANT, March, march
from jblast.waves.euler.state import Ambient, IdealGas

STRIDE = 10
"""Steps between records: 2 % of the radius with 100 cells, less later and with more."""


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
    slopes = _slopes(x, y)
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


ORDERS = (0.8, 2.5)
"""Between these an observed order is believed; outside, the nearer of the two."""

FIRST = 0.1
r"""$\lambda$ from where on the start is forgotten and errors are the scheme's."""


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
    nodes = np.geomspace(FIRST, end, 2000)
    first, second, third = (
        np.log(decay_at(nodes, run).overpressure_ratio) for run in runs
    )
    changes = second - first, third - second
    places = [nodes[np.argmax(np.abs(change))] for change in changes]
    last = places[1] ** 2 / places[0]
    # a record or two off the fall, which parabolas through three records round off
    at = np.searchsorted(nodes[:-1], [places[0] / 1.02, last])
    return (*places, last), changes[0][at] / changes[1][at]


def _slopes(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return dy/dx at nodes: that of a parabola through each three, second order."""
    width = np.diff(x)
    chord = np.diff(y) / width
    inner = (width[1:] * chord[:-1] + width[:-1] * chord[1:]) / (width[1:] + width[:-1])
    return np.concatenate(
        [[2.0 * chord[0] - inner[0]], inner, [2 * chord[-1] - inner[-1]]]
    )
