r"""What is the blast of a point source? The solver's answer, beside the printed ones.

    python -m calibration.point_source > calibration/results/point_source.txt

The solver of `calibration.euler` runs from $\lambda = R\,(P_0/E)^{1/3} = 0.02$, where
it starts from Sedov's solution, to 100, each time with twice the cells; the last three
give a limit (Richardson's, with the order that is observed). Compared are values that
are printed to three or four digits, every row of the table they were read off
(`data/point_source_s1x4.csv`: S. Hancock, by the method of characteristics; its stated
relative error is 7e-7), and the law `point_source`: the spline through the nodes that
`--table` writes, the arrival integrated from it, and the weak-shock law past the last.
"""

import argparse
import json
import math
from pathlib import Path

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from matplotlib.figure import Figure

from calibration.euler import (
    Decay,
    Flow,
    History,
    cell_centres,
    decay_at,
    gas_of,
    march,
)
from jblast.cli.jax_start import start_jax
from jblast.files import write_text
from jblast.report.colours import BLUE, INK, MUTED, VERMILLION
from jblast.report.figures import log_ticks, new_figure, quiet, titled
from jblast.waves.laws.point_source import (
    TAIL,
    log_overpressure_ratio,
    log_sound_fraction,
)

END = 100.0
r"""$\lambda$ to which the solver runs."""


PROFILES = (0.3, 1.0, 3.0, 10.0)
"""Radii of the shock whose profiles are drawn, lambda."""


CELLS = (100, 200, 400, 800, 1600)
QUICK_CELLS = (100, 200, 400)
"""For `--json`, which prints their limit."""
NODES = np.exp(np.linspace(math.log(0.1), math.log(END), 139))
"""Spaced by 0.05 in the logarithm: a cubic spline leaves less than 1e-5 between."""
NODES[[0, -1]] = 0.1, END
PRINTED = {
    0.1: 157.8,
    0.3: 6.721,
    1.0: 0.4986,
    3.0: 0.09463,
    10.0: 0.02046,
    30.0: 5.64e-3,
    100.0: 1.459e-3,
}
"""p/P0 at lambda, rounded, within 0.11 % of table S1x4 interpolated."""
FAR_PRINTED = {1000.0: 1.196e-4, 1e6: 8.54e-8}
FARTHEST = 1e6
r"""$\lambda$ to which the weak-shock law is compared, a hundred times its range."""

ORDERS = (0.8, 2.5)
"""The scheme has orders 1 to 2: estimates outside are noise of a vanishing change."""
START_FORGOTTEN = 0.1
r"""$\lambda$ from which on errors of the start are negligible."""
Run = tuple[Flow, History]


def runs(cells: tuple[int, ...]) -> list[Run]:
    """Return a run for each number of cells."""
    return [march(number, END) for number in cells]


def limit_at(scaled: np.ndarray, marches: list[Run]) -> Decay:
    """Return the limit of the last three runs."""
    return extrapolated(scaled, *(history for _, history in marches[-3:]))


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


def text(marches: list[Run]) -> str:
    """Return the tables."""
    lines = ["The point source, gamma 1.4, from lambda = 0.02 to 100", ""]
    lines += ["cells   records   energy gained / its change expected - 1"]
    for one in marches:
        count, records = one[0].volume.shape[0], len(one[1].shock)
        lines.append(f"{count:5d}{records:10d}{energy_error(one[0]):14.1e}")
    lines += ["", "p/P0 by cells, their limit, and the last run's distance from it"]
    lines += ["  lambda" + "".join(f"{c:>11d}" for c in CELLS) + "      limit   apart"]
    scaled = np.array([*PRINTED])
    values = [decay_at(scaled, one).overpressure_ratio for _, one in marches]
    limit = limit_at(scaled, marches)
    for i, lam in enumerate(scaled):
        lines.append(
            f"{lam:8g}"
            + "".join(f"{v[i]:11.6g}" for v in values)
            + f"{limit.overpressure_ratio[i]:11.6g}"
            + f"{values[-1][i] / limit.overpressure_ratio[i] - 1:9.1e}"
        )
    lines += ["", "observed order, from three runs: 100-200-400 and so on"]
    for i, lam in enumerate(scaled):
        steps = np.diff([math.log(v[i]) for v in values])
        orders = np.log2(np.abs(steps[:-1] / steps[1:]))
        lines.append(f"{lam:8g}" + "".join(f"{order:8.2f}" for order in orders))
    lines += ["", "against the seven printed values: 100 (solver/printed - 1) %"]
    lines += ["  lambda    printed     solver       %    slope"]
    for i, (lam, printed) in enumerate(PRINTED.items()):
        ratio = limit.overpressure_ratio[i]
        lines.append(
            f"{lam:8g}{printed:11.5g}{ratio:11.6g}{100 * (ratio / printed - 1):8.3f}"
            f"{limit.slope[i]:9.4f}"
        )
    lines += ["", "against every row of the table those were read off (S1x4)"]
    lines += ["  lambda      S1x4     solver  solver/S1x4 - 1: limit, " + str(CELLS)]
    x, y, lead = hancock(0.1, END)
    near = limit_at(np.exp(x), marches)
    each = [decay_at(np.exp(x), run).overpressure_ratio for _, run in marches]
    for i in range(len(x)):
        lines.append(
            f"{math.exp(x[i]):8.4f}{math.exp(y[i]):11.6g}"
            f"{near.overpressure_ratio[i]:11.6g}"
            + "".join(
                f"{v[i] / math.exp(y[i]) - 1:9.1e}"
                for v in (near.overpressure_ratio, *each)
            )
        )
    law = np.asarray(log_overpressure_ratio(jnp.asarray(x)))
    arrival = sound_fraction(jnp.asarray(x))
    for name, off in (
        ("the limit", near.overpressure_ratio / np.exp(y) - 1.0),
        ("point_source", np.expm1(law - y)),
        ("its arrival", arrival / (1.0 - np.exp(lead - x)) - 1.0),
    ):
        lines.append(f"worst of {len(x)} rows, {name}: {np.abs(off).max():.1e}")
    lines += ["", *law_lines(fine_limit(marches)), "", *far_lines()]
    return "\n".join(lines)


def energy_error(flow: Flow) -> float:
    """Return the error of the energy, as a share of the whole."""
    whole = float(flow.energy.sum())
    swept = float(flow.shock) ** 3 / 3.0 / 0.4
    return (whole - swept - 1.0 / (4.0 * math.pi)) / whole


def fine_limit(marches: list[Run]) -> Decay:
    """Return the solver's limit at a thousand distances, off the nodes."""
    return limit_at(np.geomspace(0.1, END * (1 - 1e-9), 1000), marches)


def law_lines(limit: Decay) -> list[str]:
    """Compare `point_source` with the solver, between the nodes."""
    lines = ["the law point_source over the solver's limit, between its nodes"]
    for name, off in zip(("pressure", "arrival"), law_over(limit), strict=True):
        worst = int(np.argmax(np.abs(off)))
        lines.append(
            f"  {name:9s} mean {np.mean(np.abs(off)):.1e}, worst {off[worst]:.1e} "
            f"at lambda = {limit.scaled[worst]:.3g}"
        )
    return lines


def far_lines() -> list[str]:
    """Compare the weak-shock continuation with the table past the grid."""
    tail = TAIL
    lines = [
        f"past lambda = {tail.join:g} point_source is the weak-shock law "
        f"{tail.amplitude:.5f}/(lambda sqrt(ln(lambda/{tail.length:.4f})))",
        "  lambda       S1x4        law   law/S1x4 - 1",
    ]
    for x, y, _ in hancock(END, FARTHEST).T:
        law = math.exp(float(log_overpressure_ratio(jnp.asarray(x))))
        lines.append(
            f"{math.exp(x):9.4g}{math.exp(y):11.5g}{law:11.5g}"
            f"{law / math.exp(y) - 1:12.1e}"
        )
    for lam, printed in FAR_PRINTED.items():
        law = math.exp(float(log_overpressure_ratio(jnp.log(lam))))
        lines.append(f"{lam:9.4g}  printed {printed:.4g}: {law / printed - 1:.1e}")
    return lines


def table(decay: Decay, apart: float) -> str:
    """Return the data file."""
    head = (
        "# Shock front of a point source in uniform air of gamma 1.4, spherical: "
        "`python -m calibration.point_source --table`.\n"
        "# lambda = R (P0/E)^(1/3); overpressure_ratio = (p - P0)/P0; log_slope = "
        "d ln(overpressure_ratio)/d ln(lambda); arrival = c0 t (P0/E)^(1/3).\n"
        f"# calibration.euler, limit of {CELLS[-3]} to {CELLS[-1]} cells; the last "
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
    """Print the tables or the JSON, and write what was asked for."""
    parser = argparse.ArgumentParser(description="The point source by the solver.")
    parser.add_argument("--json", action="store_true", help="the decay alone, as JSON")
    parser.add_argument("--table", type=Path, help="write the nodes as CSV")
    parser.add_argument("--figure", type=Path, help="draw decay and profiles")
    asked = parser.parse_args()
    start_jax()
    marches = runs(QUICK_CELLS if asked.json else CELLS)
    limit = limit_at(NODES, marches)
    if asked.json:
        columns = {
            "lambda": limit.scaled.tolist(),
            "overpressure_ratio": limit.overpressure_ratio.tolist(),
        }
        print(json.dumps(columns))
        return
    if asked.table:  # first: the text reads the packaged one
        last = decay_at(NODES, marches[-1][1]).overpressure_ratio
        apart = float(np.max(np.abs(last / limit.overpressure_ratio - 1.0)))
        write_text(asked.table, table(limit, apart))
    print(text(marches))
    if asked.figure:
        point_source_figure(fine_limit(marches), marches[-1]).savefig(
            asked.figure, dpi=110
        )


def point_source_figure(decay: Decay, run: Run) -> Figure:
    """Draw four plots: decay, differences, profiles, and the last profile's wave.

    Args:
        decay: The solver's, between the nodes of its table.
        run: To lambda = 100.
    """
    figure = new_figure(11.0, 8.0)
    (above, apart), (inside, wave) = figure.subplots(2, 2)
    above.loglog(decay.scaled, decay.overpressure_ratio, color=BLUE)
    log_scaled, log_ratio, _ = hancock(0.1, END)
    above.loglog(
        np.exp(log_scaled), np.exp(log_ratio), "o", color=VERMILLION, markersize=5
    )
    above.set_ylabel("p/P0")
    titled(above, "Decay", "line: solver; dots: blast-ips, table S1x4")
    pressure, _ = law_over(decay)
    apart.semilogx(decay.scaled, 1e6 * pressure, color=INK, linewidth=0.9)
    curve = np.asarray(log_overpressure_ratio(jnp.asarray(log_scaled)))
    apart.semilogx(
        np.exp(log_scaled),
        1e6 * np.expm1(curve - log_ratio),
        "o",
        color=VERMILLION,
        markersize=5,
    )
    apart.set_ylabel("point_source over it - 1, millionths")
    titled(apart, "Between the nodes", "line: over the solver; dots: over S1x4")
    for axes in (above, apart):
        axes.set_xlabel(r"$\lambda$")
        log_ticks(axes.xaxis, (0.1, 100.0))
    for number, end in enumerate(PROFILES):
        short = march(400, end)
        place, pressure = _profile(short)
        inside.plot(
            place / end,
            (pressure - 1.0) / (short[1].front.pressure[-1] - 1.0),
            color=BLUE,
            alpha=1.0 - 0.22 * number,
            label=rf"$\lambda$ = {end:g}",
        )
    inside.set_ylim(-0.6, 1.05)
    inside.set_xlabel("r/R")
    inside.set_ylabel("p over that at the shock")
    inside.legend(frameon=False, fontsize=9)
    titled(inside, "Profiles", "overpressures")
    place, pressure = _profile(run)
    end = float(run[0].shock)
    wave.plot(place - end, 1e3 * (pressure - 1.0), ".-", color=BLUE, markersize=3)
    wave.axhline(0.0, color=MUTED, linewidth=0.8)
    wave.set_xlim(-4.0, 0.1)
    wave.set_xlabel(r"$r - R$ in units of $(E/P_0)^{1/3}$")
    wave.set_ylabel("p/P0, thousandths")
    titled(wave, rf"The wave at $\lambda$ = {end:g}", "dots: cells")
    for axes in (above, apart, inside, wave):
        quiet(axes)
    return figure


def _profile(run: Run) -> tuple[np.ndarray, np.ndarray]:
    flow = run[0]
    return np.asarray(cell_centres(flow.radius)), np.asarray(gas_of(flow).pressure)


def hancock(first: float, last: float) -> np.ndarray:
    r"""Return ln lambda, ln p/P0 and ln(lambda - c0 t) of every row of table S1x4.

    Args:
        first: $\lambda$ where they begin [-].
        last: Where they end [-].
    """
    file = Path(__file__).parent / "data" / "point_source_s1x4.csv"
    lines = [line for line in file.read_text().splitlines() if line[:1] != "#"]
    rows = np.genfromtxt(lines, delimiter=",", names=True)
    x = rows["log_lambda"]
    rows = rows[(x >= math.log(first)) & (x <= math.log(last))]
    names = ("log_lambda", "log_overpressure_ratio", "log_lead")
    return np.array([rows[name] for name in names])


def sound_fraction(log_scaled: Array) -> np.ndarray:
    """Return c t / R of the law."""
    return np.exp(np.asarray(log_sound_fraction(log_scaled)))


def law_over(limit: Decay) -> tuple[np.ndarray, np.ndarray]:
    """Return how far `point_source` is above the solver: pressure and arrival, of 1."""
    log_scaled = jnp.log(limit.scaled)
    pressure = np.exp(np.asarray(log_overpressure_ratio(log_scaled)))
    arrival = sound_fraction(log_scaled) * limit.scaled
    return pressure / limit.overpressure_ratio - 1.0, arrival / limit.arrival - 1.0


if __name__ == "__main__":
    main()
