"""Places of charges beside arrays by exact integration, without the fit.

    python -m calibration.array_grid > calibration/results/array_grid.txt

Every fifth layout of `calibration.array_coverage`. The posterior is summed over a grid
of ln of the range (steps of 0.2 from 0.3 to 1,000 widths of the array), the bearing
(1 degree) and ln of the mass (scaled distances of 0.3 to 100 m/kg^(1/3)), flat in all
three and in the origin time, which is integrated in closed form. Errors are normal,
correlated between paths by the four functions of `jblast.sensors.path_scatter`, equally
probable, and of 1 % of the shot. What this leaves open no fit of the same model can
identify.
"""

import math

import numpy as np

from calibration.array_coverage import LAYOUTS, SD, SIGMA, simulated
from jblast.cli.jax_start import start_jax

start_jax()

import jax  # noqa: E402
import jax.numpy as jnp  # noqa: E402
from jax.scipy.linalg import solve_triangular  # noqa: E402
from jax.scipy.special import logsumexp  # noqa: E402

from jblast.sensors.path_scatter import KERNELS, correlations, embedded  # noqa: E402
from jblast.waves import kingery_bulmash_arrival_time  # noqa: E402

EACH = 5
STEP = 0.2
NEAREST, FARTHEST = 0.3, 1000.0
BEARINGS, MASSES = 360, 33
SCALED_RANGES = 0.3, 100.0
WIDE = 5.0
"""A range whose 90 % interval spans a larger factor is not known."""


@jax.jit
def at_range(places, times, distance, kernel):
    """Return ln of the likelihood at one range, by mass and bearing."""
    turn = 2 * jnp.pi * jnp.arange(BEARINGS) / BEARINGS
    charge = places.mean(axis=0) + distance * jnp.stack(
        [jnp.sin(turn), jnp.cos(turn)], axis=1
    )
    toward = charge[:, None] - places[None]
    reach = jnp.linalg.norm(toward, axis=2)

    def correlation(toward, reach):
        flat = jnp.concatenate([toward, jnp.zeros_like(reach)[:, None]], axis=1)
        place, _ = embedded(flat, reach)
        return correlations(place, place, kernel) + 1.0  # and the shot

    shared = jax.vmap(correlation)(toward, reach)

    def of_mass(log_z):
        mass = (distance / jnp.exp(log_z)) ** 3
        travel = kingery_bulmash_arrival_time(reach.ravel(), mass).reshape(reach.shape)
        covariance = SD**2 * shared * travel[:, :, None] * travel[:, None, :]
        root = jnp.linalg.cholesky(covariance + SIGMA**2 * jnp.eye(reach.shape[1]))

        def white(rows):
            return solve_triangular(root, rows[..., None], lower=True)[..., 0]

        one, left = white(jnp.ones_like(travel)), white(times - travel)
        known = jnp.sum(one**2, axis=1)
        misfit = jnp.sum(left**2, axis=1) - jnp.sum(one * left, axis=1) ** 2 / known
        size = jnp.sum(jnp.log(jnp.diagonal(root, axis1=1, axis2=2)), axis=1)
        found = -0.5 * (misfit + jnp.log(known)) - size
        return jnp.where(jnp.isfinite(found), found, -jnp.inf)

    low, high = np.log(SCALED_RANGES)
    return jax.lax.map(of_mass, jnp.linspace(low, high, MASSES))


def row(number: int) -> dict[str, float]:
    """Return the intervals of one layout, and whether they contain the truth."""
    case = simulated(number)
    places, times = jnp.asarray(case.places), jnp.asarray(case.times)
    apart = case.places[:, None] - case.places[None]
    width = float(np.linalg.norm(apart, axis=-1).max())
    log_range = np.arange(math.log(NEAREST * width), math.log(FARTHEST * width), STEP)
    kernels = jnp.eye(len(KERNELS))
    of_each = np.array(
        [
            logsumexp(
                jnp.stack([at_range(places, times, math.exp(r), k) for k in kernels]),
                axis=(0, 1),
            )
            for r in log_range
        ]
    )
    weight = np.exp(of_each - of_each.max())
    weight /= weight.sum()
    low, high = np.exp(np.interp([0.05, 0.95], weight.sum(axis=1).cumsum(), log_range))
    east, north = case.places.mean(axis=0)  # the charge is the origin
    true = math.hypot(east, north)
    bearing = np.arange(BEARINGS) * 2 * math.pi / BEARINGS
    middle = np.angle(weight.sum(axis=0) @ np.exp(1j * bearing))
    off = (bearing - middle + math.pi) % (2 * math.pi) - math.pi
    order = np.argsort(off)
    left, right = np.interp(
        [0.05, 0.95], weight.sum(axis=0)[order].cumsum(), off[order]
    )
    aside = math.atan2(-east, -north) - middle
    aside = (aside + math.pi) % (2 * math.pi) - math.pi
    half_a_step = math.pi / BEARINGS
    return {
        "aperture": case.aperture,
        "range": low <= true <= high,
        "bearing": left - half_a_step <= aside <= right + half_a_step,
        "factor": high / low,
    }


def main() -> None:
    """Print how often intervals contain the truth, and how wide those of ranges are."""
    rows = [row(number) for number in range(1, LAYOUTS, EACH)]
    for label, low, high in (
        ("all", 0.0, math.inf),
        ("aperture/range below 0.1", 0.0, 0.1),
        ("aperture/range above 0.1", 0.1, math.inf),
    ):
        of = [r for r in rows if low <= r["aperture"] < high]
        wide = sum(r["factor"] > WIDE for r in of)
        print(
            f"{label:26s} {len(of):3d} layouts; 90 % intervals contain range "
            f"{100 * np.mean([r['range'] for r in of]):3.0f} %, bearing "
            f"{100 * np.mean([r['bearing'] for r in of]):3.0f} %; range known within a "
            f"factor of {WIDE:g} in {len(of) - wide}"
        )


if __name__ == "__main__":
    main()
