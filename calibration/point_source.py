r"""The shock of a point source by the solver: the table of the law `point_source`.

    python -m calibration.point_source

writes `jblast/waves/data/point_source_euler.csv`. The solver of `calibration.euler`
runs from $\lambda = R\,(P_0/E)^{1/3} = 0.02$, where it starts from Sedov's solution, to
100, each time with twice the cells; the last three give a limit (Richardson's, with the
order that is observed). `results/point_source.txt` compares it with printed values,
with every row of a table by the method of characteristics, and with the law: the spline
through the nodes, the arrival integrated from it, and the weak-shock law past the last.
"""

import math
from pathlib import Path

import numpy as np
from jaxtyping import Float

import jblast.waves
from calibration.euler import Decay, History, decay_at, march
from jblast.cli.jax_start import start_jax
from jblast.files import write_text

END = 100.0
r"""$\lambda$ to which the solver runs."""
CELLS = (400, 800, 1600)
NODES = np.exp(np.linspace(math.log(0.1), math.log(END), 139))
"""Spaced by 0.05 in the logarithm: a cubic spline leaves less than 1e-5 between."""
NODES[[0, -1]] = 0.1, END
OUTPUT = Path(jblast.waves.__path__[0]) / "data" / "point_source_euler.csv"
ORDERS = (0.8, 2.5)
"""The scheme has orders 1 to 2: estimates outside are noise of a vanishing change."""
START_FORGOTTEN = 0.1
r"""$\lambda$ from which on errors of the start are negligible."""


def extrapolated(
    scaled: Float[np.ndarray, " node"], coarse: History, middle: History, fine: History
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
    each = [decay_at(scaled, run) for run in (coarse, middle, fine)]
    end = min(float(run.shock[-1]) for run in (coarse, middle, fine))
    nodes = np.geomspace(START_FORGOTTEN, end, 2000)
    first, second, third = (
        np.log(decay_at(nodes, run).overpressure_ratio)
        for run in (coarse, middle, fine)
    )
    changes = second - first, third - second
    # the order falls where the error of the pressure is largest; an upper bound for the
    # fine run, because the ratio of successive radii decreases
    falls = [nodes[np.argmax(np.abs(change))] for change in changes]
    last = falls[1] ** 2 / falls[0]
    # one or two records before the fall, which parabolas through three records smooth
    at = np.searchsorted(nodes[:-1], [falls[0] / 1.02, last])
    ratios = changes[0][at] / changes[1][at]

    def limit(a, b, c, *, mixed):
        change = np.where(c == b, 1.0, c - b)
        ratio = np.clip((b - a) / change, 2.0 ** ORDERS[0], 2.0 ** ORDERS[1])
        seen = c + (c - b) / (ratio - 1.0)
        if not mixed:
            return seen
        before = c + (c - b) / (ratios[0] - 1.0)
        behind = b + (b - a) / (ratios[1] - 1.0)
        between = [scaled < fall for fall in (*falls, last)]
        return np.select(between, [seen, before, behind], seen)

    return Decay(
        scaled,
        np.exp(limit(*(np.log(r.overpressure_ratio) for r in each), mixed=True)),
        limit(*(r.slope for r in each), mixed=True),
        # an integral over all smaller radii, which mixes both orders
        np.exp(limit(*(np.log(r.arrival) for r in each), mixed=False)),
    )


def table(decay: Decay, apart: float) -> str:
    """Return the data file."""
    head = (
        "# Shock front of a point source in uniform air of gamma 1.4, spherical: "
        "`python -m calibration.point_source`.\n"
        "# lambda = R (P0/E)^(1/3); overpressure_ratio = (p - P0)/P0; log_slope = "
        "d ln(overpressure_ratio)/d ln(lambda); arrival = c0 t (P0/E)^(1/3).\n"
        f"# calibration.euler, limit of {CELLS[0]} to {CELLS[-1]} cells; the last "
        f"is within {apart:.0e} of it.\n"
        "lambda,overpressure_ratio,log_slope,arrival\n"
    )
    columns = (
        decay.scaled,
        decay.overpressure_ratio,
        decay.slope,
        decay.arrival,
    )
    rows = zip(*columns, strict=True)
    return head + "".join(
        f"{lam:.8g},{ratio:.7g},{slope:.5f},{arrival:.7g}\n"
        for lam, ratio, slope, arrival in rows
    )


def main() -> None:
    """Write the nodes as CSV."""
    start_jax()
    marches = [march(number, END)[1] for number in CELLS]
    limit = extrapolated(NODES, *marches)
    last = decay_at(NODES, marches[-1]).overpressure_ratio
    apart = float(np.max(np.abs(last / limit.overpressure_ratio - 1.0)))
    write_text(OUTPUT, table(limit, apart))


if __name__ == "__main__":
    main()
