"""Do the intervals of `jblast fit`, as it comes, hold the truth in 90 of 100 logs?

    python -m calibration.coverage_default > calibration/results/coverage_default.txt

Seven microphones about a charge, four unknowns (mass, place in the plane, time), no
prior, laws that scatter, Student-t errors. 400 logs are simulated with the errors the
fit assumes, seed 11. "weighted" is the default: draws of the normal approximation,
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
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jblast.cli.jax_start import start_jax
from jblast.inference import Posterior
from jblast.inference.fitting.solution import Solution
from jblast.inference.fitting.uncertainty import uncertainty
from jblast.inference.identifiability import identifiability
from jblast.inference.mode.laplace import laplace, marginals
from jblast.inference.mode.search import optima
from jblast.inference.posterior.parameters import parameters_of
from jblast.scene import UncertainScene, freed
from jblast.sensors import observe, planned_layout
from jblast.sensors.record import to_error_scale
from jblast.verification.sampling_cases import LAWS, PLACES, TRUTH, scene_with

LOGS = 400
SEVEN = (*PLACES, (-90, -60), (30, 150))
"""East and north of each microphone [m]."""


def blank_and_logs(count: int) -> tuple[Posterior, Float[jax.Array, "log row"]]:
    """Return the posterior of the first log, and what each log reads."""
    scene = scene_with(scatter=True, places=SEVEN)
    layout, sigma, _ = planned_layout(scene)
    keys = jax.random.split(jax.random.key(11), count)
    read = jax.vmap(lambda key: observe(key, scene, layout, LAWS, sigma))(keys)
    measured = jax.vmap(lambda value: to_error_scale(value, layout.quantity))(read)
    parameters = parameters_of(freed(UncertainScene(scene), list(TRUTH)))
    return Posterior(
        parameters, layout, measured[0], sigma, tuple(LAWS.items())
    ), measured


def main(count: int = LOGS) -> None:
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
        solution = Solution(posterior, {}, True, found, identified, normal)
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


if __name__ == "__main__":
    main()
