"""Is the solver right? Smooth flow, Sod, Sedov, conservation and derivatives.

    python -m calibration.euler_verification

The point source itself is `python -m calibration.point_source`.
"""

import functools
import math
from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jblast.cli.jax_start import start_jax
from jblast.waves.euler import (
    Ambient,
    Flow,
    FlowState,
    IdealGas,
    Primitives,
    front_pressure_at,
    march,
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
from jblast.waves.laws.sedov_taylor import sedov_alpha

WAVE_TIME, SOD_TIME = 1.5, 0.2
STEP = 0.05
"""Of ln E and ln R, in differences of fourth order."""
NAMES = ("density", "velocity", "pressure")


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


def main() -> None:
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
    main()
