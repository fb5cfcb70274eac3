r"""The point source from the strong shock to $\lambda = 100$, in scaled terms.

With $P_0 = \rho_0 = E = 1$ the radius of the shock is $\lambda = R\,(P_0/E)^{1/3}$.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jblast.waves.euler.gas import IdealGas
from jblast.waves.euler.march import March, march
from jblast.waves.euler.run import COURANT
from jblast.waves.euler.start_sedov import START_FRACTION, start_sedov
from jblast.waves.euler.state import Ambient
from jblast.waves.hermite_curve import HermiteCurve, hermite_curve

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

    def pressure_curve(self) -> HermiteCurve:
        r"""Return $\ln p/P_0$ against $\ln\lambda$."""
        return hermite_curve(
            np.log(self.scaled), np.log(self.overpressure_ratio), self.slope
        )


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


def extrapolated(coarse: Decay, middle: Decay, fine: Decay) -> Decay:
    r"""Return the limit of three runs, each with twice the cells of the one before.

    $$q = q_3 + \frac{q_3 - q_2}{2^n - 1}, \qquad
    2^n = \frac{q_2-q_1}{q_3-q_2}$$

    with the order $n$ observed: 2 until waves that went through the hot core catch up
    with the shock, near $\lambda = 2$, and 1 beyond.
    """

    def limit(a, b, c):
        change = np.where(c == b, 1.0, c - b)
        ratio = np.clip((b - a) / change, 2.0 ** ORDERS[0], 2.0 ** ORDERS[1])
        return c + (c - b) / (ratio - 1.0)

    runs = (coarse, middle, fine)
    return Decay(
        fine.scaled,
        np.exp(limit(*(np.log(run.overpressure_ratio) for run in runs))),
        limit(*(run.slope for run in runs)),
        np.exp(limit(*(np.log(run.arrival) for run in runs))),
    )


def _slopes(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return dy/dx at nodes: that of a parabola through each three, second order."""
    width = np.diff(x)
    chord = np.diff(y) / width
    inner = (width[1:] * chord[:-1] + width[:-1] * chord[1:]) / (width[1:] + width[:-1])
    return np.concatenate(
        [[2.0 * chord[0] - inner[0]], inner, [2 * chord[-1] - inner[-1]]]
    )
