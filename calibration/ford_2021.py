"""How do impulse and duration in the far field depend on mass, range and burial?

    python -m calibration.ford_2021 > calibration/results/ford_2021.txt

Data: calibration/data/acoustic_ford2021.csv (its provenance stands there). No random
numbers. Writes jblast/waves/data/ford_2021.json.

A record is the curve of `jblast/waves/laws/ford_2021.py` plus what its site, its
shot and its path add, plus an error of its own, Student-t with 4 degrees of freedom. A
path is the same in all shots of a site. The effects are Gaussian and integrated out
(`random_effects.py`). Forms are compared by AIC at the maximum likelihood, printed
below. Coefficients, covariance and scatter are then those of the restricted likelihood,
times a prior on the site and the shot scatter: Gamma of shape 2 and scale 0.1 in ln,
for three sites (two, when one is left out) say next to nothing against zero.

Measured on the way, and left out (AIC of the impulse):

- paths that differ from shot to shot: 42 against -39 for the same path in every shot
  (printed form); both together -37. Duration: -110 for both against -112.
- separate slopes above and below ground -51, a shifted knee -51, against -54 for the
  free ground factor; a shot scatter that also grows above ground -42, or exponentially
  with depth -51; campaigns in place of sites 1 higher.
- a bend b5 ln^2(Z/100): -61 against -55 for the impulse, -114 against -110 for the
  duration. It was chosen by AIC at first. Left-out shots and campaigns then came out
  worse with it (`leave_out.py`), so the printed power law stands: a choice made after
  looking. So was the prior: without it, campaigns left out score 0.3 lower, for the
  scatter of two sites collapses. The free ground factor and the effects came before.
- for duration a free ground factor wanders off to a straight line, with no gain. Its
  site scatter and growth with burial gain nothing either (within 3); they are kept so
  that both quantities have one form.
- effects of impulse and duration on a shot are correlated by 0.48, but by 0.21 in
  ranks: HRI-7 and HTP-7, both deep, make the difference; on records by -0.14 in ranks.
  They are taken as independent, as the error model of a fit has it.
"""

import json
from pathlib import Path

import jax
import numpy as np

import jblast.waves
from calibration.ford_fit import fit
from calibration.ford_likelihood import COEFFICIENTS, SCATTERS, Form
from calibration.ford_records import QUANTITIES, Records, read_records
from calibration.likelihood_maximum import print_forms
from jblast.cli.jax_start import start_jax
from jblast.files import write_text
from jblast.waves.laws.ford_2021 import FordCurve

OUTPUT = Path(jblast.waves.__path__[0]) / "data" / "ford_2021.json"

STRAIGHT = (("b5", 0.0),)
PRINTED = (("b4", 1.0), *STRAIGHT)
ADOPTED = {
    "positive_impulse_pa_s": Form(STRAIGHT),
    "positive_duration_s": Form(PRINTED),
}
FORMS = {
    "printed form, b4 = 1": Form(PRINTED),
    "printed form and a bend b5": Form((("b4", 1.0),)),
    "free ground factor b4": Form(STRAIGHT),
    "  and a bend b5": Form(),
    "  no site effect": Form((*STRAIGHT, ("site", 0.0))),
    "  no growth with burial": Form((*STRAIGHT, ("burial", 0.0))),
    "  Gaussian records": Form(STRAIGHT, np.inf),
    "printed, no growth, no site": Form((*PRINTED, ("burial", 0.0), ("site", 0.0))),
}


def as_json(curves: dict[str, FordCurve], records: Records) -> str:
    """Return the packaged data file: six significant digits, the same each run."""

    def rounded(array: jax.Array) -> object:
        return np.vectorize(lambda x: float(f"{x:.6g}"))(np.asarray(array)).tolist()

    content = {
        "source": "LLNL recordings of S.R. Ford et al. 2021, from "
        "lanl/MultiPEM_Toolbox (BSD-3-Clause); calibration/data/acoustic_ford2021.csv",
        "script": "calibration/ford_2021.py",
        "shots": sorted(set(records.shot.tolist())),
        "n_records": len(records.shot),
        "scaled_range": [rounded(f(records.scaled_range())) for f in (np.min, np.max)],
        "scaled_height": [
            rounded(f(records.scaled_height())) for f in (np.min, np.max)
        ],
        "curves": {
            quantity: {name: rounded(x) for name, x in vars(curve).items()}
            for quantity, curve in curves.items()
        },
    }
    return json.dumps(content, indent=1) + "\n"


def main() -> None:
    """Print the tables and write the data file."""
    start_jax()
    curves: dict[str, FordCurve] = {}
    for quantity in QUANTITIES:
        print_forms(quantity, FORMS, fit)
        adopted = fit(quantity, ADOPTED[quantity])
        curves[quantity] = adopted.curve
        sds = np.sqrt(np.diag(adopted.covariance))
        for name, value, sd in zip(
            COEFFICIENTS, adopted.coefficients, sds, strict=True
        ):
            print(f"  {name} = {value:9.4f} +- {sd:.4f}")
        for name, value in zip(SCATTERS, adopted.scatter, strict=True):
            print(f"  {name} scatter {value:.4f}")
    write_text(OUTPUT, as_json(curves, read_records()))
    print(f"wrote {OUTPUT.name}")


if __name__ == "__main__":
    main()
