"""Do 90 % intervals hold the truth in 90 of 100 logs?

    python -m calibration.coverage > calibration/results/coverage.txt
    python -m calibration.coverage default > calibration/results/coverage_default.txt
    python -m calibration.coverage bounds > calibration/results/lower_bounds.txt

Five microphones, four unknowns (mass, place in the plane, time), no prior: few readings
more than unknowns, where a normal approximation is weakest. 400 logs are simulated with
the errors the fit assumes, seed 11. The first line of each pair takes the width of the
interval from the expected information, as `jblast fit` does; the second from the
curvature of the posterior at the optimum.

Default: do the intervals of `jblast fit`, as it comes, hold the truth in 90 of 100
logs? Seven microphones about a charge, four unknowns (mass, place in the plane, time),
no prior, laws that scatter, Student-t errors. 400 logs are simulated with the errors
the fit assumes, seed 11. "weighted" is the default: draws of the normal approximation,
weighted by the posterior; in the few logs where importance sampling cannot tell, that
approximation alone. "laplace" is the approximation alone in every log.

Below it stands why the approximation holds the place less often than nine in ten: the
root mean square of the optimum's error in the standard deviations that the
approximation prints, which are those of the expected information, the same log by log;
and the kurtosis of that error, 3 for a normal one. Information tells the error of many
readings; a place hangs on some four, and the optimum of four Student-t readings is
spread wider than it says, with longer tails, most so the east here. The mass hangs on
one effect that all rows share, which is normal. Weights see how well the readings of
the log at hand agree.

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

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from calibration import run_part
from calibration.cases import MICROPHONE_LAWS, POSITIONS, TRUTH, scene_with
from jblast.cli.jax_start import start_jax
from jblast.inference import Posterior
from jblast.inference.fitting.solution import Solution
from jblast.inference.fitting.suspects import LEFT_OUT_SIGMA
from jblast.inference.fitting.uncertainty import uncertainty
from jblast.inference.identifiability import identifiability
from jblast.inference.mode.laplace import laplace, marginals
from jblast.inference.mode.search import optima
from jblast.inference.posterior.fisher_information import information
from jblast.inference.posterior.parameters import parameters_of
from jblast.scene import Scene, Sensor, UncertainScene, freed, with_values
from jblast.sensors import observe, planned_layout
from jblast.sensors.record import to_error_scale
from jblast.sensors.simulated_readings import Noise

LOGS = 400


DEFAULT_LOGS = 400
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


def coverage(scene: Scene, noise: Noise) -> tuple[np.ndarray, np.ndarray]:
    """Return the share of logs whose interval holds each truth, by both widths."""
    layout, sigma, _ = planned_layout(scene)
    keys = jax.random.split(jax.random.key(11), LOGS)
    draw = eqx.filter_jit(
        jax.vmap(
            lambda key: observe(key, scene, layout, MICROPHONE_LAWS, sigma, noise=noise)
        )
    )
    measured = jax.vmap(lambda value: to_error_scale(value, layout.quantity))(
        draw(keys)
    )
    parameters = parameters_of(freed(UncertainScene(scene), list(TRUTH)))
    laws = tuple(MICROPHONE_LAWS.items())
    blank = Posterior(parameters, layout, measured[0], sigma, laws, noise)

    @eqx.filter_jit
    def one(measured):
        posterior = eqx.tree_at(lambda p: p.measured, blank, measured)
        z = optima(jax.random.key(0), posterior).z[0]
        curvature = jax.hessian(lambda z: -posterior.log_density(z))(z)
        return z, information(posterior, z), curvature

    z, *widths = jax.lax.map(one, measured)
    truth = [
        float(belief.unconstrain(jnp.asarray(TRUTH[name])))
        for name, belief in zip(parameters.names, parameters.beliefs, strict=True)
    ]
    away = np.abs(np.asarray(z) - np.array(truth))
    sds = [np.sqrt(np.diagonal(np.linalg.inv(w), axis1=1, axis2=2)) for w in widths]
    expected, curved = (np.mean(away < 1.645 * sd, axis=0) for sd in sds)
    return expected, curved


def main() -> None:
    """Print the table."""
    start_jax()
    print(f"share of {LOGS} logs whose 90 % interval holds the truth (+- 0.015)")
    print(
        f"{'laws':9s}{'errors':10s}{'width':13s}" + "".join(f"{n:>16s}" for n in TRUTH)
    )
    noises: tuple[Noise, ...] = ("gaussian", "student")
    for scatter in (False, True):
        for noise in noises:
            both = coverage(scene_with(scatter=scatter), noise)
            for width, share in zip(("information", "curvature"), both, strict=True):
                print(
                    f"{'scatter' if scatter else 'exact':9s}{noise:10s}{width:13s}"
                    + "".join(f"{x:16.3f}" for x in share)
                )


def blank_and_logs(count: int) -> tuple[Posterior, Float[jax.Array, "log row"]]:
    """Return the posterior of the first log, and what each log reads."""
    scene = scene_with(scatter=True, positions=SEVEN)
    layout, sigma, _ = planned_layout(scene)
    keys = jax.random.split(jax.random.key(11), count)
    read = jax.vmap(lambda key: observe(key, scene, layout, MICROPHONE_LAWS, sigma))(
        keys
    )
    measured = jax.vmap(lambda value: to_error_scale(value, layout.quantity))(read)
    parameters = parameters_of(freed(UncertainScene(scene), list(TRUTH)))
    return Posterior(
        parameters, layout, measured[0], sigma, tuple(MICROPHONE_LAWS.items())
    ), measured


def default(count: int = DEFAULT_LOGS) -> None:
    """Print the table."""
    start_jax()
    blank, logs = blank_and_logs(count)
    parameters, truth = blank.parameters, np.array(list(TRUTH.values()))
    coordinate = np.array(
        [
            float(belief.unconstrain(jnp.asarray(value)))
            for belief, value in zip(parameters.beliefs, truth, strict=True)
        ]
    )
    held: dict[str, list[np.ndarray]] = {"weighted": [], "laplace": []}
    away, weighted = [], 0
    for measured in logs:
        posterior = eqx.tree_at(lambda p: p.measured, blank, measured)
        found = optima(jax.random.key(0), posterior)
        z = np.asarray(found.z[0])
        identified = identifiability(posterior, z)
        normal = laplace(posterior, z, identified.identified_basis)
        solution = Solution(posterior, {}, {}, found, identified, normal)
        sure = uncertainty(solution, "weighted")
        weighted += sure.weighted
        for how, intervals in (
            ("weighted", sure.marginals),
            ("laplace", marginals(parameters, normal)),
        ):
            ends = np.array([[intervals[n].q05, intervals[n].q95] for n in TRUTH])
            held[how].append((ends[:, 0] <= truth) & (truth <= ends[:, 1]))
        away.append((z - coordinate) / np.sqrt(np.diag(normal.covariance)))
    print(f"share of {count} logs whose 90 % interval holds the truth (+- 0.015)")
    print(f"{'':24s}" + "".join(f"{name:>16s}" for name in TRUTH))
    for how, inside in held.items():
        shares = "".join(f"{x:16.3f}" for x in np.mean(inside, axis=0))
        print(f"{how:24s}{shares}")
    square, fourth = (np.mean(np.power(away, k), axis=0) for k in (2, 4))
    for what, numbers in (
        ("error/sd of laplace", np.sqrt(square)),
        ("its kurtosis", fourth / square**2),
    ):
        print(f"{what:24s}" + "".join(f"{x:16.2f}" for x in numbers))
    print(f"weighted where importance sampling could tell: {weighted} of {count} logs")


def clipped_logs(count: int) -> tuple[Posterior, np.ndarray]:
    """Return a posterior of nothing yet, and what gauges would read [Pa]."""
    sensors = tuple(
        Sensor(f"g{i}", jnp.array([*place, 0.0]), records=((PEAK, 0.05),))
        for i, place in enumerate(GAUGES)
    )
    scene = with_values(Scene(sensors=sensors), CLIPPED_TRUTH)
    layout, sigma, _ = planned_layout(scene)
    keys = jax.random.split(jax.random.key(19), count)
    read = jax.vmap(lambda key: observe(key, scene, layout, PEAK_LAWS, sigma))(keys)
    parameters = parameters_of(freed(UncertainScene(scene), list(CLIPPED_TRUTH)))
    laws = tuple(PEAK_LAWS.items())
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
        "left out": of(written, np.where(clipped, LEFT_OUT_SIGMA, sigma)),
        "as readings": of(written),
    }


def bounds(count: int = CLIPPED_LOGS) -> None:
    """Print the table."""
    start_jax()
    blank, logs = clipped_logs(count)
    truth = np.array(list(CLIPPED_TRUTH.values()))
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
    names = "".join(f"{name:>16s}" for name in CLIPPED_TRUTH)
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
        return np.full((len(CLIPPED_TRUTH), 3), np.nan)
    solution = Solution(posterior, {}, {}, found, identified, normal)
    sure = uncertainty(solution, "weighted").marginals
    return np.array([[sure[n].q05, sure[n].value, sure[n].q95] for n in CLIPPED_TRUTH])


if __name__ == "__main__":
    run_part({"approximation": main, "default": default, "bounds": bounds})
