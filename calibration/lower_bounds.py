"""Clipped peaks as lower bounds: do intervals hold the truth, and how wide are they?

    python -m calibration.lower_bounds > calibration/results/lower_bounds.txt

Eight pressure gauges 12 to 90 m from 15 kg, of which mass and place in the plane are
free, no prior; Kingery-Bulmash with its scatter (10 % a shot, 10 % a
record), 5 % of instrument error, Student-t. 100 logs are simulated with the errors the
fit assumes, seed 19; in each the gauges write down what they read, but no more than
their full scale of 20 kPa, which most often clips four. The same logs are fitted four
ways: what would have been read without a full scale; the clipped values as lower
bounds; clipped rows left out; clipped values as if they were readings.
"""

import jax
import jax.numpy as jnp
import numpy as np

from jblast.cli.jax_start import start_jax
from jblast.inference import Posterior
from jblast.inference.fitting.solution import Solution
from jblast.inference.fitting.suspects import UNHEARD
from jblast.inference.fitting.uncertainty import uncertainty
from jblast.inference.identifiability import identifiability
from jblast.inference.mode.laplace import laplace
from jblast.inference.mode.search import optima
from jblast.inference.posterior.parameters import parameters_of
from jblast.scene import Scene, Sensor, UncertainScene, freed, with_values
from jblast.sensors import observe, planned_layout
from jblast.sensors.record import to_error_scale

LOGS = 100
FULL_SCALE = 20e3
"""Of every gauge [Pa]."""
TRUTH = {"charge_mass_kg": 15.0, "charge_east_m": 0.0, "charge_north_m": 0.0}
PLACES = (
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
LAWS = {PEAK: "kingery_bulmash"}


def blank_and_logs(count: int) -> tuple[Posterior, np.ndarray]:
    """Return a posterior of nothing yet, and what gauges would read [Pa]."""
    sensors = tuple(
        Sensor(f"g{i}", jnp.array([*place, 0.0]), records=((PEAK, 0.05),))
        for i, place in enumerate(PLACES)
    )
    scene = with_values(Scene(sensors=sensors), TRUTH)
    layout, sigma, _ = planned_layout(scene)
    keys = jax.random.split(jax.random.key(19), count)
    read = jax.vmap(lambda key: observe(key, scene, layout, LAWS, sigma))(keys)
    parameters = parameters_of(freed(UncertainScene(scene), list(TRUTH)))
    laws = tuple(LAWS.items())
    return Posterior(parameters, layout, read[0], sigma, laws), np.asarray(read)


def ways(blank: Posterior, read: np.ndarray) -> dict[str, Posterior]:
    """Return the posteriors of one log by what is made of its clipped rows."""
    clipped = read >= FULL_SCALE

    sigma = np.asarray(blank.sigma)

    def of(values, sigma=sigma, bounds=None) -> Posterior:
        measured = to_error_scale(values, blank.layout.quantity)
        return Posterior(
            blank.parameters,
            blank.layout,
            jnp.asarray(measured),
            jnp.asarray(sigma),
            blank.laws,
            lower_bound=bounds,
        )

    written = np.minimum(read, FULL_SCALE)
    return {
        "no full scale": of(read),
        "lower bounds": of(written, bounds=jnp.asarray(clipped)),
        "left out": of(written, np.where(clipped, UNHEARD, sigma)),
        "as readings": of(written),
    }


def main(count: int = LOGS) -> None:
    """Print the table."""
    start_jax()
    blank, logs = blank_and_logs(count)
    truth = np.array(list(TRUTH.values()))
    found: dict[str, list[np.ndarray]] = {}
    for read in logs:
        for way, posterior in ways(blank, read).items():
            found.setdefault(way, []).append(_answer(posterior))
    clipped = np.sum(logs >= FULL_SCALE, axis=1)
    print(
        f"{count} logs of eight gauges; clipped in each: {clipped.min()} to "
        f"{clipped.max()}, {clipped.mean():.2f} on average"
    )
    print("share whose 90 % interval holds the truth (+- 0.03), median of mass/truth,")
    print("median factor between the ends of the mass's interval, not converged\n")
    names = "".join(f"{name:>16s}" for name in TRUTH)
    print(f"{'':16s}{names}{'mass/truth':>14s}{'factor':>10s}{'failed':>10s}")
    for way, answers in found.items():
        every = np.array(answers)  # [log, number, (q05, value, q95)]
        good = np.isfinite(every).all(axis=(1, 2))
        inside = (every[..., 0] <= truth) & (truth <= every[..., 2])
        shares = "".join(f"{x:16.2f}" for x in inside[good].mean(axis=0))
        bias = np.median(every[good, 0, 1]) / truth[0]
        wide = np.median(every[good, 0, 2] / every[good, 0, 0])
        print(f"{way:16s}{shares}{bias:14.2f}{wide:10.2f}{np.sum(~good):10d}")


def _answer(posterior: Posterior) -> np.ndarray:
    """Fit as `jblast fit` does; NaN where the search did not converge."""
    found = optima(jax.random.key(0), posterior)
    z = np.asarray(found.z[0])
    identified = identifiability(posterior, z)
    normal = laplace(posterior, z, identified.identified_basis)
    if len(identified.null) or not normal.converged:
        return np.full((len(TRUTH), 3), np.nan)
    solution = Solution(posterior, {}, True, found, identified, normal)
    sure = uncertainty(solution, "weighted").marginals
    return np.array([[sure[n].q05, sure[n].value, sure[n].q95] for n in TRUTH])


if __name__ == "__main__":
    main()
