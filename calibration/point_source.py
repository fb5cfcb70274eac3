r"""What is the blast of a point source? The solver's answer, beside the printed ones.

    python -m calibration.point_source
    python -m calibration.point_source --json
    python -m calibration.point_source --table FILE --figure FILE

The solver of `jblast.waves.euler` runs from $\lambda = R\,(P_0/E)^{1/3} = 0.02$, where
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

from calibration.point_source_references import END, hancock, law_over, sound_fraction
from jblast.cli.jax_start import start_jax
from jblast.files import write_text
from jblast.waves.euler import Decay, decay_at, extrapolated, point_source_march
from jblast.waves.euler.run import March
from jblast.waves.laws.point_source import (
    log_overpressure_ratio,
    point_source_tail,
)

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


def runs(cells: tuple[int, ...]) -> list[March]:
    """Return a run for each number of cells."""
    marches = []
    for number in cells:
        marches.append(point_source_march(number, END))
        if marches[-1].lost:
            raise SystemExit(marches[-1].lost)
    return marches


def limit_at(scaled: np.ndarray, marches: list[March]) -> Decay:
    """Return the limit of the last three runs."""
    return extrapolated(scaled, *marches[-3:])


def text(marches: list[March]) -> str:
    """Return the tables."""
    lines = ["The point source, gamma 1.4, from lambda = 0.02 to 100", ""]
    lines += ["cells   records   energy gained / its change expected - 1"]
    for run in marches:
        count = run.state.volume.shape[0]
        lines.append(f"{count:5d}{len(run.history.clock):10d}{energy_error(run):14.1e}")
    lines += ["", "p/P0 by cells, their limit, and the last run's distance from it"]
    lines += ["  lambda" + "".join(f"{c:>11d}" for c in CELLS) + "      limit   apart"]
    scaled = np.array([*PRINTED])
    values = [decay_at(scaled, run).overpressure_ratio for run in marches]
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
    each = [decay_at(np.exp(x), run).overpressure_ratio for run in marches]
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


def energy_error(run: March) -> float:
    """Return what the energy is off, as a share of the whole."""
    whole = float(run.state.energy.sum())
    swept = float(run.state.clock) ** 3 / 3.0 / 0.4
    return (whole - swept - 1.0 / (4.0 * math.pi)) / whole


def fine_limit(marches: list[March]) -> Decay:
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
    tail = point_source_tail()
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
        f"# jblast.waves.euler, limit of {CELLS[-3]} to {CELLS[-1]} cells; the last "
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
        last = decay_at(NODES, marches[-1]).overpressure_ratio
        apart = float(np.max(np.abs(last / limit.overpressure_ratio - 1.0)))
        write_text(asked.table, table(limit, apart))
    print(text(marches))
    if asked.figure:
        from calibration.point_source_figure import point_source_figure

        point_source_figure(fine_limit(marches), marches[-1]).savefig(
            asked.figure, dpi=110
        )


if __name__ == "__main__":
    main()
