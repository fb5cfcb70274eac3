r"""What is the blast of a point source? The solver's answer, beside the printed ones.

    python -m calibration.point_source > calibration/results/point_source.txt
    python -m calibration.point_source solver
        > calibration/results/euler_verification.txt

The solver of `jblast.waves.euler` runs from $\lambda = R\,(P_0/E)^{1/3} = 0.02$, where
it starts from Sedov's solution, to 100, each time with twice the cells; the last three
give a limit (Richardson's, with the order that is observed). Compared are values that
are printed to three or four digits, every row of the table they were read off
(`data/point_source_s1x4.csv`: S. Hancock, by the method of characteristics; its stated
relative error is 7e-7), and the law `point_source`: the spline through the nodes that
`--table` writes, the arrival integrated from it, and the weak-shock law past the last.

Solver: is it right? Smooth flow, Sod, Sedov, conservation and derivatives.
"""

import argparse
import functools
import json
import math
from collections.abc import Callable
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from matplotlib.figure import Figure

from calibration import run_part
from jblast.cli.jax_start import start_jax
from jblast.files import write_text
from jblast.report.figure_style import (
    BLUE,
    INK,
    MUTED,
    VERMILLION,
    log_ticks,
    new_figure,
    quiet,
    titled,
)
from jblast.waves.curves import log_sound_fraction
from jblast.waves.euler import (
    Ambient,
    Decay,
    Flow,
    FlowState,
    IdealGas,
    Primitives,
    cell_centres,
    decay_at,
    extrapolated,
    front_pressure_at,
    march,
    point_source_march,
    primitives,
    riemann_profile,
    run,
    simple_wave_means,
    start_sedov,
    start_simple_wave,
    start_sod,
    start_sphere,
)
from jblast.waves.euler.initial import SOD_LEFT, SOD_RIGHT
from jblast.waves.euler.run import March
from jblast.waves.laws.point_source import (
    log_overpressure_ratio,
    point_source_arrival,
    point_source_tail,
)
from jblast.waves.laws.sedov_taylor import sedov_alpha

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


WAVE_TIME, SOD_TIME = 1.5, 0.2
STEP = 0.05
"""Of ln E and ln R, in differences of fourth order."""
NAMES = ("density", "velocity", "pressure")


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
    for one in marches:
        count = one.state.volume.shape[0]
        lines.append(f"{count:5d}{len(one.history.clock):10d}{energy_error(one):14.1e}")
    lines += ["", "p/P0 by cells, their limit, and the last run's distance from it"]
    lines += ["  lambda" + "".join(f"{c:>11d}" for c in CELLS) + "      limit   apart"]
    scaled = np.array([*PRINTED])
    values = [decay_at(scaled, one).overpressure_ratio for one in marches]
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
        from calibration.point_source import point_source_figure

        point_source_figure(fine_limit(marches), marches[-1]).savefig(
            asked.figure, dpi=110
        )


def point_source_figure(decay: Decay, run: March) -> Figure:
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
        short = point_source_march(400, end)
        place, pressure = _profile(short)
        inside.plot(
            place / end,
            (pressure - 1.0) / (short.history.front_pressure[-1] - 1.0),
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
    end = float(run.state.clock)
    wave.plot(place - end, 1e3 * (pressure - 1.0), ".-", color=BLUE, markersize=3)
    wave.axhline(0.0, color=MUTED, linewidth=0.8)
    wave.set_xlim(-4.0, 0.1)
    wave.set_xlabel(r"$r - R$ in units of $(E/P_0)^{1/3}$")
    wave.set_ylabel("p/P0, thousandths")
    titled(wave, rf"The wave at $\lambda$ = {end:g}", "dots: cells")
    for axes in (above, apart, inside, wave):
        quiet(axes)
    return figure


def _profile(run: March) -> tuple[np.ndarray, np.ndarray]:
    cells = primitives(run.state, IdealGas())
    return np.asarray(cell_centres(run.state.radius, "spherical")), np.asarray(
        cells.pressure
    )


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
    return np.exp(np.asarray(log_sound_fraction(log_scaled, point_source_arrival())))


def law_over(limit: Decay) -> tuple[np.ndarray, np.ndarray]:
    """Return how far `point_source` is above the solver: pressure and arrival, of 1."""
    log_scaled = jnp.log(limit.scaled)
    pressure = np.exp(np.asarray(log_overpressure_ratio(log_scaled)))
    arrival = sound_fraction(log_scaled) * limit.scaled
    return pressure / limit.overpressure_ratio - 1.0, arrival / limit.arrival - 1.0


def errors(state: FlowState, flow: Flow, exact: Primitives) -> np.ndarray:
    """Return the L1 norms of density, velocity and pressure against exact means."""
    width = jnp.diff(state.radius)
    cells = primitives(state, flow.gas)
    pairs = zip(cells, exact, strict=True)
    return np.array([float(jnp.sum(jnp.abs(a - b) * width)) for a, b in pairs])


def convergence(rows: list[tuple[int, np.ndarray]]) -> list[str]:
    """Return a table of errors and the orders between its rows."""
    lines = ["   cells" + "".join(f"{name:>12s}{'order':>7s}" for name in NAMES)]
    before = None
    for cells, error in rows:
        line = f"{cells:8d}"
        for i, e in enumerate(error):
            order = "" if before is None else f"{math.log2(before[i] / e):.2f}"
            line += f"{e:12.2e}{order:>7s}"
        lines.append(line)
        before = error
    return lines


def smooth_lines() -> list[str]:
    """Measure the order on a wave that steepens."""
    lines = []
    for overtaking in (0.0, 0.2):
        rows = []
        for cells in (60, 120, 240, 480, 960):
            flow, state = start_simple_wave(cells, overtaking=overtaking)
            end = march(state, flow, WAVE_TIME).state
            rows.append(
                (cells, errors(end, flow, simple_wave_means(end.radius, WAVE_TIME)))
            )
        how = "overtake up to 0.2 of rho c" if overtaking else "stand in the gas"
        lines += [f"smooth: L1 error of a simple wave, t = {WAVE_TIME}; faces {how}"]
        lines += [*convergence(rows), ""]
    return lines


def sod_lines() -> list[str]:
    """Measure Sod's tube against its exact solution, averaged over the cells."""
    left, right = (Primitives(*map(jnp.asarray, q)) for q in (SOD_LEFT, SOD_RIGHT))
    nodes, weights = np.polynomial.legendre.leggauss(16)
    rows = []
    for cells in (100, 200, 400, 800):
        flow, state = start_sod(cells)
        end = march(state, flow, SOD_TIME).state
        width = jnp.diff(end.radius)[:, None]
        places = end.radius[:-1, None] + width * (nodes[None] + 1.0) / 2.0
        exact = riemann_profile(left, right, IdealGas(), places / SOD_TIME)
        means = Primitives(*(jnp.sum(q * weights / 2.0, axis=1) for q in exact))
        rows.append((cells, errors(end, flow, means)))
    return [f"Sod: L1 error, t = {SOD_TIME}", *convergence(rows), ""]


def sedov_lines() -> list[str]:
    """Measure the shock of a point source in cold air against the closed form."""
    lines = ["Sedov in air of 1e-12 E/R^3, from R = 0.02 to 1: off by"]
    lines += ["   cells   radius at its time   shock pressure"]
    air = Ambient(jnp.asarray(1e-12), jnp.ones(()), IdealGas())
    alpha = float(sedov_alpha(1.4))
    for cells in (50, 100, 200, 400):
        flow, state = start_sedov(1.0, air, 0.02, cells=cells, length=100.0)
        end = march(state, flow, 1.0)
        time = float(end.state.time)
        radius = (time**2 / alpha) ** 0.2
        pressure = 8.0 / (25.0 * 2.4 * alpha)
        last = float(end.history.front_pressure[-1])
        lines.append(
            f"{cells:8d}{100 * (1.0 / radius - 1.0):17.4f} %"
            f"{100 * (last / pressure - 1.0):15.4f} %"
        )
    return [*lines, ""]


def conservation_lines() -> list[str]:
    """Add up mass, volume and energy against what came through the shock."""
    air = Ambient(jnp.ones(()), jnp.ones(()), IdealGas())
    lines = ["conserved: change over what the shock brought in, of the whole, - 1"]
    lines += ["                             mass    volume    energy"]
    starts = {
        "point source to lambda = 10": (start_sedov(1.0, air, 0.02, cells=200), 10.0),
        "sphere of 100 P0 to 10 r0": (
            start_sphere(1.0, 100.0, 10.0, air, core_cells=60, air_cells=120),
            10.0,
        ),
    }
    for name, ((flow, state), end) in starts.items():
        last = march(state, flow, end).state
        grown = (last.clock**3 - state.clock**3) / 3.0
        off = [
            float((jnp.sum(b) - jnp.sum(a) - gain) / jnp.sum(b))
            for a, b, gain in (
                (state.mass, last.mass, grown),
                (state.volume, last.volume, grown),
                (state.energy, last.energy, grown / 0.4),
            )
        ]
        lines.append(f"{name:27s}" + "".join(f"{x:10.1e}" for x in off))
    flow, state = start_sod(200)
    last = march(state, flow, SOD_TIME).state
    off = [
        float(jnp.sum(b) / jnp.sum(a) - 1.0)
        for a, b in (
            (state.mass, last.mass),
            (state.volume, last.volume),
            (state.energy, last.energy),
        )
    ]
    lines.append(f"{'Sod':27s}" + "".join(f"{x:10.1e}" for x in off))
    return [*lines, "remeshing: none, the mesh slides through the gas; loss 0", ""]


@functools.partial(jax.jit, static_argnames="limited")
def log_peak(
    log_energy: Float[Array, ""], end: Float[Array, ""], limited: bool
) -> Float[Array, ""]:
    """Return ln of the overpressure of a point source's shock at a radius.

    Read between records: a run that ends there ends by a step cut short, and 3e-6 of
    noise in ln p with it.
    """
    air = Ambient(jnp.ones(()), jnp.ones(()), IdealGas())
    flow, state = start_sedov(
        jnp.exp(log_energy), air, 0.02, cells=200, length=1.0, limited=limited
    )
    _, history = run(state, flow, 1.1 * end, records=1560, stride=10)
    return jnp.log(front_pressure_at(history, end) - 1.0)


def central(function: Callable[[float], float]) -> float:
    """Return the slope at zero by four values, fourth order in `STEP`."""
    one, two = (
        (function(n * STEP) - function(-n * STEP)) / (2.0 * n * STEP) for n in (1, 2)
    )
    return (4.0 * one - two) / 3.0


def derivative_lines() -> list[str]:
    """Compare d ln p/d ln E by forward mode with similarity and with differences."""
    lines = [f"d ln p/d ln E at fixed radius, 200 cells; differences over {STEP} in ln"]
    lines += ["similarity: -(1/3) d ln p/d ln lambda, by differences too"]
    lines += ["  lambda  limited    forward  similarity      off  differences      off"]
    for limited in (True, False):
        for end in (0.1, 0.3, 1.0, 2.0):

            def peak(log_energy, log_radius, end=end, limited=limited):
                radius = jnp.asarray(end * np.exp(log_radius))
                return log_peak(jnp.asarray(log_energy), radius, limited=limited)

            zero, one = jnp.zeros(()), jnp.ones(())
            _, forward = jax.jvp(lambda x, p=peak: p(x, 0.0), (zero,), (one,))
            similar = -central(lambda x, p=peak: float(p(0.0, x))) / 3.0
            differences = central(lambda x, p=peak: float(p(x, 0.0)))
            lines.append(
                f"{end:8g}{'yes' if limited else 'no':>9s}{forward:11.6f}"
                f"{similar:12.6f}{forward / similar - 1.0:9.1e}"
                f"{differences:13.6f}{forward / differences - 1.0:9.1e}"
            )
    return lines


def solver() -> None:
    """Print the tables."""
    start_jax()
    parts = (
        smooth_lines,
        sod_lines,
        sedov_lines,
        conservation_lines,
        derivative_lines,
    )
    for part in parts:
        print("\n".join(part()), flush=True)


if __name__ == "__main__":
    run_part({"table": main, "solver": solver})
