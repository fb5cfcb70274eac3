r"""Does a fit get out of a log all that is in it?

    python -m calibration.efficiency > calibration/results/efficiency.txt

Of each case (`efficiency_cases.py`) 4,000 logs of one blast are simulated and fitted by
`fit_many`, without any prior. An answer's root mean square error (RMSE) is set beside
the Cramer-Rao sd, which no unbiased estimate undercuts (`information_of_layout` at the
truth); laws are exact, so that no error but the log's own is in it. 4,000 normal
errors tell the ratio to $1/\sqrt{2 \cdot 4000} = 0.011$; the table has the standard
error measured. Case number $i$ has the seed $(11, i)$, the search seed 0.

A number is judged, 0.95 to 1.05, where its sd is below 0.1: of the ln of a positive
number, over the nearest range for a place, over the time sound needs for that range for
the origin time. A wider one is printed: there the laws bend within the error, the
bound is not attained, and a fit may be biased.

"student" is the RMSE of Student-t logs fitted as such, over Student-t's own bound. That
is neared as readings outnumber unknowns: by 24 microphones, and not by five. Few wild
readings make several optima, too, and the search takes a costlier one for up to 1 % of
the logs. Far off, these are most of the excess of "pressure", where searches from the
truth come to 1.14 to 1.23. One such log makes the price of 1.10 (else 1.04).

"price" is the RMSE of normal errors fitted as Student-t, over the bound of the normal;
`efficiency_price.py` has what it should be.

No log is left out. "unconverged" counts those that `fit_many` does not call converged:
of normal errors none, of Student-t up to 3 of 4,000. "costlier" counts those that end
where minus ln of the density is higher than at the end that is reached from the truth,
so at another optimum.

Where laws scatter `burial` is left out: it has more effects than `fit_many` takes.
"""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from calibration.efficiency_cases import CASES, Case
from calibration.efficiency_price import price
from jblast.cli.jax_start import start_jax
from jblast.inference import fit_many, information_of_layout
from jblast.inference.posterior.parameters import parameters_of
from jblast.scene import UncertainScene, freed
from jblast.sensors import observe, planned_layout
from jblast.sensors.simulated_readings import Noise

LOGS = 4000
SEED = 11
WIDEST = 0.1
LEAST, MOST = 0.95, 1.05
COSTLIER = 1e-6
"""Ends whose cost differs by less are the same."""
SCATTERING = ("microphones", "air and ground")


class Errors(NamedTuple):
    """How answers to many logs miss the truth, in sds of the bound.

    Attributes:
        sd: The bound's, in the fitted coordinate of each number.
        rmse: Root mean square error of each number.
        rmse_error: Its standard error.
        bias: Mean error.
        unconverged: Logs whose end is not called an optimum.
        costlier: Logs with a better optimum near the truth.
    """

    sd: np.ndarray
    rmse: np.ndarray
    rmse_error: np.ndarray
    bias: np.ndarray
    unconverged: int
    costlier: int


def errors_of(
    case: Case,
    seed: int,
    drawn: Noise,
    fitted: Noise,
    *,
    scatter: bool = False,
    logs: int = LOGS,
) -> Errors:
    """Simulate logs, fit them, and compare with the bound of those errors.

    Args:
        case: The blast and its sensors.
        seed: Tells one case from another.
        drawn: Distribution of the errors.
        fitted: What the fit takes it for.
        scatter: Whether laws scatter about nature.
        logs: How many.
    """
    scene, laws = case.scene(scatter=scatter), case.laws
    layout, sigma, _ = planned_layout(scene)
    uncertain = freed(UncertainScene(scene), list(case.truth))
    parameters = parameters_of(uncertain)
    truth = jnp.stack(
        [
            belief.unconstrain(jnp.asarray(case.truth[name]))
            for name, belief in zip(parameters.names, parameters.beliefs, strict=True)
        ]
    )
    known = information_of_layout(parameters, layout, sigma, laws, truth, drawn)
    sd = np.sqrt(np.diagonal(np.linalg.inv(known)))

    @eqx.filter_jit
    def read(keys):
        def one(key):
            return observe(key, scene, layout, laws, sigma, noise=drawn)

        return jax.vmap(one)(keys)

    key = jax.random.fold_in(jax.random.key(SEED), seed)
    values = read(jax.random.split(key, logs))

    def ends(starts=None):
        return fit_many(
            uncertain,
            layout,
            values,
            np.asarray(sigma),
            laws,
            noise=fitted,
            starts=starts,
        )

    found, near = ends(), ends(jnp.broadcast_to(truth, (logs, truth.size)))
    away = (np.asarray(found.z) - np.asarray(truth)) / sd
    rmse = np.sqrt(np.mean(away**2, axis=0))
    return Errors(
        sd=sd,
        rmse=rmse,
        rmse_error=np.std(away**2, axis=0) / (2 * rmse * np.sqrt(logs)),
        bias=np.mean(away, axis=0),
        unconverged=int(np.sum(~np.asarray(found.converged))),
        costlier=int(np.sum(np.asarray(found.cost - near.cost) > COSTLIER)),
    )


def verdict(width: float, rmse: float) -> str:
    """Return what is to be said of a number: as good as can be, or not.

    Args:
        width: Sd of the bound, over the number's yardstick.
        rmse: In sds of the bound.
    """
    if width >= WIDEST:
        return "(wide)"
    return "ok" if LEAST <= rmse <= MOST else "MISSED"


def show(name: str, case: Case, told: list[Errors]) -> list[str]:
    """Print a case, and return the verdicts.

    Args:
        name: Of the case.
        case: The blast and its sensors.
        told: Normal errors fitted as such; then, if at hand, Student-t errors fitted as
            such, and normal errors fitted as Student-t.
    """
    rows = len(case.places) * len(case.records)
    unconverged = "/".join(f"{errors.unconverged}" for errors in told)
    costlier = "/".join(f"{errors.costlier}" for errors in told)
    print(
        f"\n{name}: {rows} readings, {len(case.truth)} unknowns; "
        f"unconverged {unconverged}, costlier {costlier}"
    )
    verdicts = []
    best, *others = told
    for i, (number, yardstick) in enumerate(case.yardsticks().items()):
        width = float(best.sd[i]) / yardstick
        verdicts.append(verdict(width, float(best.rmse[i])))
        line = (
            f"  {number:20s}{width:9.5f}{best.rmse[i]:8.3f} +-{best.rmse_error[i]:.3f}"
            f"{best.bias[i]:+8.3f}  {verdicts[-1]:8s}"
        )
        line += "".join(f"{x.rmse[i]:7.3f} +-{x.rmse_error[i]:.3f}" for x in others)
        print(line.rstrip())
    return verdicts


def main() -> None:
    """Print the tables."""
    start_jax()
    print(f"{LOGS} logs a case, seed ({SEED}, case), no prior: RMSE over Cramer-Rao sd")
    print(f"price of Student-t on many normal readings, in theory: {price():.4f}")
    print("unconverged and costlier: of normal errors/Student-t/normal as Student-t")
    print(f"\n{'':22s}{'sd':>9s}{'normal':>16s}{'bias':>8s}{'':10s}", end="")
    print(f"{'student':>14s}{'price':>14s}")
    verdicts: list[str] = []
    ways: tuple[tuple[Noise, Noise], ...] = (
        ("gaussian", "gaussian"),
        ("student", "student"),
        ("gaussian", "student"),
    )
    for seed, (name, case) in enumerate(CASES.items()):
        verdicts += show(name, case, [errors_of(case, seed, *way) for way in ways])
    judged = [said for said in verdicts if said != "(wide)"]
    print(f"\n{judged.count('ok')} of {len(judged)} numbers within {LEAST} to {MOST}")
    print(
        "\nThe same where laws scatter, shared effects and all. The bound leaves out\n"
        "what the size of the errors tells, so a ratio may fall below 1."
    )
    for seed, name in enumerate(SCATTERING, start=len(CASES)):
        case = CASES[name]
        normal = errors_of(case, seed, "gaussian", "gaussian", scatter=True)
        show(name, case, [normal])


if __name__ == "__main__":
    main()
