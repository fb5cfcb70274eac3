"""How much does the ground move, by scaled range and burial?

    python -m calibration.ground_motion > calibration/results/ground_motion.txt

Data: calibration/data/seismic_ford2021.csv (its provenance stands there; that its
values are metres and metres a second is INFERRED, with medium confidence). No random
numbers. Writes jblast/waves/data/ground_motion.json and
calibration/results/ground_motion.png.

A record is the curve of `jblast/waves/laws/ground_motion.py` plus what its site,
its shot and its path add, plus an error of its own, all Gaussian in ln. A path is the
same in all shots of a site. Forms are compared by AIC at the maximum likelihood.
Scatters are then those of the restricted likelihood, times a prior on the site and the
shot scatter (`EXPECTED_SD`): four sites are few. Of these two the law has the root of
the posterior mean of the variance (`predictive`), which is larger than the most
probable scatter: with normal effects, what is uncertain about a scatter has to enter
its size. Coefficients and covariance are those that go with it. How steeply the
coupling changes with burial (b4) the recordings do not say, between 10 and 30 per
m/kg^(1/3); it is held at 15 for both quantities.

Shots. 12 shots were added to the first ten, whose shot scatter was 0.09 in displacement
and 0.07 in velocity. Now it is 0.47 and 0.61: charges of 175 kg in the wet rock of HTP
differ by up to 2.4 in ln, those at the other sites hardly more than before. A scatter
that differs from site to site needs more sites than four; until then all sites have the
mean.

Records of the one shot at FSS lie 3 in ln below the others in displacement, 1.2 in
velocity: the other sites do not predict it. Its displacement over velocity is 0.3 ms in
the middle, against 3 ms elsewhere: either its displacements are in another unit, or a
high-pass took most of them, or the rock is another. They stay in, and make the site
scatter of the displacement what it is.

Left out in turn, shots and sites are predicted by curves that have not seen them, with
the scatter that the law claims for a new site. "mean" is that of what a shot's records
are above the prediction, in ln, "sd" what the law claims for it; "inside" counts
records within their own 90 % interval; ln W is the most probable one of the shot, its
height known, every mass of 1e-3 to 1e9 kg as likely in ln beforehand. Shots of a site
that was seen are predicted better than claimed, for the site is no longer new. Without
the site HR the burial at which coupling changes is not determined, so b5 is held at
-0.2 where sites are left out: that much these rows have seen.
"""

import json
from pathlib import Path

import jax
import numpy as np

import jblast.waves
from calibration.ground_motion_figure import draw
from calibration.ground_motion_fit import (
    COEFFICIENTS,
    QUANTITIES,
    SCATTERS,
    Fit,
    Form,
    Records,
    fit,
    read_records,
)
from calibration.likelihood_maximum import print_forms
from jblast.cli.jax_start import start_jax
from jblast.files import write_text
from jblast.waves.laws.ground_motion import (
    GroundMotionCurve,
    log_curve,
    log_scaled_place,
)

OUTPUT = Path(jblast.waves.__path__[0]) / "data" / "ground_motion.json"
FIGURE = Path(__file__).parent / "results" / "ground_motion.png"
STEEP = (("b4", 15.0),)
ADOPTED = Form(STEEP)
WITHOUT = {"shot": ADOPTED, "site": Form((*STEEP, ("b5", -0.2)))}
"""What is fitted when one is left out."""
FORMS = {
    "coupling steps, b4 = 15": ADOPTED,
    "  b4 = 10": Form((("b4", 10.0),)),
    "  b4 = 30": Form((("b4", 30.0),)),
    "  b4 free": Form(),
    "  no site effect": Form((*STEEP, ("site", 0.0))),
    "  no path effect": Form((*STEEP, ("path", 0.0))),
    "  Student-t records": Form(STEEP, 4.0),
    "straight line in h/W^(1/3)": Form((("b4", 0.1), ("b5", 0.0))),
    "no coupling": Form((*STEEP, ("b3", 0.0), ("b5", 0.0))),
}
MASSES = np.geomspace(1e-3, 1e9, 1201)
NINETY = 1.645
"""Standard deviations of a normal to either side that hold 90 %."""


def covariance_of(
    curve: GroundMotionCurve, records: Records, charge_mass: np.ndarray
) -> np.ndarray:
    """Return what the law claims for the records of one shot at a new site.

    Args:
        curve: The law.
        records: Of one shot, n of them.
        charge_mass: Masses that broadcast against the records [kg].

    Returns:
        Of shape [..., n, n].
    """
    shot, path, own = curve.scatter(
        records.slant_range, charge_mass, records.height_of_burst
    )
    shot = np.asarray(shot)
    same_path = records.path[:, None] == records.path[None, :]
    return (
        shot[..., :, None] * shot[..., None, :]
        + float(path) ** 2 * same_path
        + float(own) ** 2 * np.eye(len(records.path))
    )


def log_density(
    quantity: str, curve: GroundMotionCurve, shot: Records, mass: np.ndarray
) -> np.ndarray:
    """Return ln of the density of a shot's records at each mass.

    Args:
        quantity: Of `QUANTITIES`.
        curve: The law.
        shot: Records of one shot; their mass only undoes the scaling of the values.
        mass: Charge masses [kg].
    """
    mass = mass[:, None]
    # measured values, scaled by each mass instead
    scale = np.log(mass / shot.charge_mass) / 3.0
    value = shot.log_value[quantity] - scale * (quantity == "ground_displacement_m")
    place = log_scaled_place(shot.slant_range, mass, shot.height_of_burst)
    residual = value - np.asarray(log_curve(curve.coefficients, *place))
    claimed = covariance_of(curve, shot, mass)
    solved = np.linalg.solve(claimed, residual[..., None])[..., 0]
    density = -0.5 * np.sum(residual * solved, axis=-1)
    return density - 0.5 * np.linalg.slogdet(claimed)[1]


def log_mass(
    quantity: str, curve: GroundMotionCurve, shot: Records
) -> tuple[float, float]:
    """Return the most probable ln W of a shot, and the sd of its posterior."""
    density = log_density(quantity, curve, shot, MASSES)
    weights = np.exp(density - density.max())
    weights /= weights.sum()
    masses = np.log(MASSES)
    sd = np.sqrt(weights @ masses**2 - (weights @ masses) ** 2)
    return float(masses[np.argmax(weights)]), float(sd)


def where(records: Records, keep: np.ndarray) -> Records:
    """Pick rows."""
    values = {name: value[keep] for name, value in records.log_value.items()}
    return Records(*(column[keep] for column in records[:-1]), log_value=values)


def show_left_out(quantity: str, by: str) -> None:
    """Print how shots come out by curves that have not seen them, or their site."""
    records = read_records()
    groups = records.shot if by == "shot" else records.site
    print(f"  each {by} left out in turn")
    print("    shot     records  h/W^(1/3)   mean     sd  inside   ln W   true     sd")
    scores, inside, total = [], 0, 0
    for name in dict.fromkeys(groups.tolist()):
        learned = fit(quantity, WITHOUT[by], weight=(groups != name) * 1.0).curve
        for shot in dict.fromkeys(records.shot[groups == name].tolist()):
            mine = where(records, records.shot == shot)
            residual = mine.log_value[quantity] - np.asarray(
                log_curve(learned.coefficients, *mine.place())
            )
            claimed = covariance_of(learned, mine, mine.charge_mass)
            n = len(residual)
            hits = int(np.sum(np.abs(residual) < NINETY * np.sqrt(np.diag(claimed))))
            sd = np.sqrt(claimed.sum()) / n
            found, found_sd = log_mass(quantity, learned, mine)
            true = np.log(mine.charge_mass[0])
            print(
                f"    {shot:8s} {n:7d} {float(mine.place()[1][0]):10.2f} "
                f"{residual.mean():6.2f} {sd:6.2f} {hits:3d}/{n:<3d}"
                f"{found:6.2f} {true:6.2f} {found_sd:6.2f}"
            )
            scores.append(residual.mean() / sd)
            inside, total = inside + hits, total + n
    rms = np.sqrt(np.mean(np.square(scores)))
    print(f"    mean over sd, rms {rms:.2f}; {inside} of {total} records inside")


def as_json(fits: dict[str, Fit], records: Records) -> str:
    """Return the packaged data file: six significant digits, the same each run."""

    def rounded(array: jax.Array | np.ndarray) -> object:
        return np.vectorize(lambda x: float(f"{x:.6g}"))(np.asarray(array)).tolist()

    log_range, height = map(np.asarray, records.place())
    content = {
        "source": "LLNL recordings of S.R. Ford et al. 2021, from "
        "lanl/MultiPEM_Toolbox (BSD-3-Clause); calibration/data/seismic_ford2021.csv; "
        "units inferred",
        "script": "calibration/ground_motion.py",
        "shots": sorted(set(records.shot.tolist())),
        "n_records": len(records.shot),
        "scaled_range": rounded(np.exp([log_range.min(), log_range.max()])),
        "scaled_height": rounded(np.array([height.min(), height.max()])),
        "curves": {
            quantity: {name: rounded(x) for name, x in vars(found.curve).items()}
            for quantity, found in fits.items()
        },
    }
    return json.dumps(content, indent=1) + "\n"


def main() -> None:
    """Print the tables, write the data file and the picture."""
    start_jax()
    fits: dict[str, Fit] = {}
    for quantity in QUANTITIES:
        print_forms(quantity, FORMS, fit)
        curve = (fits.setdefault(quantity, fit(quantity, ADOPTED))).curve
        sds = np.sqrt(np.diag(curve.covariance))
        for name, value, sd in zip(COEFFICIENTS, curve.coefficients, sds, strict=True):
            print(f"  {name} = {value:9.4f} +- {sd:.4f}")
        for name in SCATTERS:
            print(f"  {name} scatter {getattr(curve, f'{name}_sd'):.4f}")
        show_left_out(quantity, "shot")
        show_left_out(quantity, "site")
    write_text(OUTPUT, as_json(fits, read_records()))
    draw({quantity: found.curve for quantity, found in fits.items()}, FIGURE)
    print(f"wrote {OUTPUT.name} and {FIGURE.name}")


if __name__ == "__main__":
    main()
