"""Do 90 % intervals of `jblast fit` contain the truth in 90 of 100 logs?

    python -m calibration.coverage > calibration/results/coverage.txt
    python -m calibration.coverage bounds > calibration/results/lower_bounds.txt

Each log is fitted by the default method, weighted draws, with the errors that it was
simulated with.

Seven microphones about a charge, four unknowns (mass, place in the plane, time), no
prior, laws that scatter, Student-t errors. 400 logs, seed 11.

Bounds: clipped peaks as lower bounds, and how wide intervals are.

Eight pressure gauges 12 to 90 m from 15 kg, of which mass and place in the plane are
free, no prior; Kingery-Bulmash with its scatter (10 % a shot, 10 % a
record), 5 % of instrument error, Student-t. 100 logs are simulated with the errors the
fit assumes, seed 19; in each the gauges write down what they read, but no more than
their full scale of 20 kPa, which most often clips four. The same logs are fitted four
ways: what would have been read without a full scale; the clipped values as lower
bounds; clipped rows left out; clipped values as if they were readings.

The scatter of laws is drawn as normal, and fitted as part of a Student-t of that scale.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from calibration import run_part
from calibration.cases import MICROPHONE_LAWS, POSITIONS, TRUTH, scene_with
from jblast.cli.jax_start import start_jax
from jblast.inference import Solution, solve
from jblast.inference.fitting.suspects import LEFT_OUT_SIGMA
from jblast.observations import Observations
from jblast.scene import Scene, Sensor, UncertainScene, freed, with_laws, with_values
from jblast.sensors.simulated_readings import readings

LOGS = 400
SEVEN = (*POSITIONS, (-90, -60), (30, 150))
"""East and north of each microphone [m]."""
CLIPPED_LOGS = 100
FULL_SCALE = 20e3
"""Of every gauge [Pa]."""
CLIPPED_TRUTH = {"charge_mass_kg": 15.0, "charge_east_m": 0.0, "charge_north_m": 0.0}
GAUGES = (
    (12, 0),
    (-9, 10),
    (3, -14),
    (-16, -6),
    (22, 24),
    (-35, 30),
    (20, -60),
    (90, 9),
)
"""East and north of each gauge [m]."""
PEAK = "peak_overpressure_pa"
PEAK_LAWS = {PEAK: "kingery_bulmash"}


def logs_of(scene: Scene, seed: int, count: int) -> list[Observations]:
    """Return simulated logs of a scene."""
    keys = jax.random.split(jax.random.key(seed), count)
    return [readings(key, scene) for key in keys]


def ends(solution: Solution, names: Sequence[str]) -> Float[np.ndarray, "number end"]:
    """Return the 90 % interval of each number, and its value between the ends."""
    found = [solution.identified.found[name] for name in names]
    return np.array([[one.q05, one.value, one.q95] for one in found])


def inside(
    every: Float[np.ndarray, "log number end"], truth: Mapping[str, float]
) -> Float[np.ndarray, " number"]:
    """Return the share of logs whose interval contains the truth, by number."""
    known = np.array(list(truth.values()))
    return np.mean((every[..., 0] <= known) & (known <= every[..., 2]), axis=0)


def coverage(scene: Scene, count: int) -> tuple[Float[np.ndarray, " number"], int]:
    """Return the share of logs whose interval contains each truth.

    Returns:
        The shares, and the number of logs whose weights are reliable.
    """
    uncertain = freed(with_laws(UncertainScene(scene), MICROPHONE_LAWS), list(TRUTH))
    fits = [solve(log, uncertain) for log in logs_of(uncertain.scene, 11, count)]
    every = np.array([ends(fit, list(TRUTH)) for fit in fits])
    return inside(every, TRUTH), sum(fit.draws.reliable for fit in fits)


def main(count: int = LOGS) -> None:
    """Print the table of seven microphones."""
    start_jax()
    scene = scene_with(scatter=True, positions=SEVEN)
    shares, reliable = coverage(scene, count)
    print(f"share of {count} logs whose 90 % interval contains the truth (+- 0.015)")
    print(f"{'':24s}" + "".join(f"{name:>16s}" for name in TRUTH))
    print(f"{'weighted':24s}" + "".join(f"{x:16.3f}" for x in shares))
    print(f"weights reliable in {reliable} of {count} logs")


def gauges() -> UncertainScene:
    """Return the scene of the pressure gauges with its free numbers."""
    sensors = tuple(
        Sensor(f"g{i}", jnp.array([*place, 0.0]), records=((PEAK, 0.05),))
        for i, place in enumerate(GAUGES)
    )
    scene = with_values(Scene(sensors=sensors), CLIPPED_TRUTH)
    return freed(with_laws(UncertainScene(scene), PEAK_LAWS), list(CLIPPED_TRUTH))


def ways(read: Observations) -> dict[str, Observations]:
    """Return a log by what is made of its clipped rows."""
    clipped = read.value >= FULL_SCALE
    value = np.minimum(read.value, FULL_SCALE)
    relative = read.sigma / read.value
    written = replace(read, value=value, sigma=relative * value)
    weightless = np.where(clipped, LEFT_OUT_SIGMA, relative)
    return {
        "no full scale": read,
        "lower bounds": replace(written, lower_bound=clipped),
        # rows that no error limits: logs keep one layout, so one program fits all
        "left out": replace(written, sigma=weightless * value),
        "as readings": written,
    }


def bounds(count: int = CLIPPED_LOGS) -> None:
    """Print the table of the pressure gauges."""
    start_jax()
    uncertain = gauges()
    logs = logs_of(uncertain.scene, 19, count)
    found: dict[str, list[np.ndarray]] = {}
    for read in logs:
        for way, log in ways(read).items():
            found.setdefault(way, []).append(_answer(solve(log, uncertain)))
    clipped = np.array([np.sum(log.value >= FULL_SCALE) for log in logs])
    print(
        f"{count} logs of eight gauges; clipped in each: {clipped.min()} to "
        f"{clipped.max()}, {clipped.mean():.2f} on average"
    )
    print(
        "share whose 90 % interval contains the truth (+- 0.03), median of mass/truth,"
    )
    print("median factor between the ends of the mass's interval, unreliable weights\n")
    names = "".join(f"{name:>16s}" for name in CLIPPED_TRUTH)
    print(f"{'':16s}{names}{'mass/truth':>14s}{'factor':>10s}{'failed':>10s}")
    for way, answers in found.items():
        every = np.array(answers)
        good = np.isfinite(every).all(axis=(1, 2))
        shares = "".join(f"{x:16.2f}" for x in inside(every[good], CLIPPED_TRUTH))
        bias = np.median(every[good, 0, 1]) / CLIPPED_TRUTH["charge_mass_kg"]
        wide = np.median(every[good, 0, 2] / every[good, 0, 0])
        print(f"{way:16s}{shares}{bias:14.2f}{wide:10.2f}{np.sum(~good):10d}")


def _answer(solution: Solution) -> np.ndarray:
    """Return the ends of each number; NaN where the weights are unreliable."""
    found = ends(solution, list(CLIPPED_TRUTH))
    return found if solution.draws.reliable else np.full_like(found, np.nan)


if __name__ == "__main__":
    run_part({"seven": main, "bounds": bounds})
