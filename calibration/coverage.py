"""Do 90 % intervals hold the truth in 90 of 100 logs?

    python -m calibration.coverage

Five microphones, four unknowns (mass, place in the plane, time), no prior: few readings
more than unknowns, where a normal approximation is weakest. 400 logs are simulated with
the errors the fit assumes, seed 11. The first line of each pair takes the width of the
interval from the expected information, as `jblast fit` does; the second from the
curvature of the posterior at the optimum.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jblast.cli.jax_start import start_jax
from jblast.inference import Posterior
from jblast.inference.mode.search import optima
from jblast.inference.posterior.fisher_information import information
from jblast.inference.posterior.parameters import parameters_of
from jblast.scene import Scene, UncertainScene, freed
from jblast.sensors import observe, planned_layout
from jblast.sensors.record import to_error_scale
from jblast.sensors.simulated_readings import Noise
from jblast.verification.sampling_cases import LAWS, TRUTH, scene_with

LOGS = 400


def coverage(scene: Scene, noise: Noise) -> tuple[np.ndarray, np.ndarray]:
    """Return the share of logs whose interval holds each truth, by both widths."""
    layout, sigma, _ = planned_layout(scene)
    keys = jax.random.split(jax.random.key(11), LOGS)
    draw = eqx.filter_jit(
        jax.vmap(lambda key: observe(key, scene, layout, LAWS, sigma, noise=noise))
    )
    measured = jax.vmap(lambda value: to_error_scale(value, layout.quantity))(
        draw(keys)
    )
    parameters = parameters_of(freed(UncertainScene(scene), list(TRUTH)))
    laws = tuple(LAWS.items())
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


if __name__ == "__main__":
    main()
