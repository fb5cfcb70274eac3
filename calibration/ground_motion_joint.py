r"""Does ground motion improve a mass from impulse and duration, of shots left out?

    python -m calibration.ground_motion_joint \
        > calibration/results/ground_motion_joint.txt

Data: calibration/data/acoustic_ford2021.csv and seismic_ford2021.csv, the 18 shots that
have both. The bootstrap has seed 0.

Both laws, `ford_2021` and `ground_motion`, are fitted again without the shot, or
without its campaign; height, range and air are known, the prior is flat in ln W. The
acoustic part is that of `mass_posterior.py`; of the ground motion the effects and the
errors of records are normal, so its density is in closed form. "score" is ln of the
posterior density of ln W at the recorded mass; shots with h/W^(1/3) < -0.2 stand apart,
outside the range of `ford_2021`.

Campaigns left out lose 0.009 of mean score. The loss is at HTP, whose wet rock moved 3
to 40 times as fast as the other sites predict; the bootstrap does not exclude a gain.

The difference of the scores is bootstrapped over shots (campaigns left out: over
campaigns, then shots).
"""

import numpy as np

from calibration.ford_records import CAMPAIGNS, read_records
from calibration.ground_motion import WITHOUT, log_density, where
from calibration.ground_motion_fit import (
    QUANTITIES,
    Records,
    fit as fit_ground,
    read_records as read_ground,
)
from calibration.leave_out import SHALLOWEST_LEFT_ASIDE, laws_without
from calibration.leave_out_table import Judged, inside, resamples
from calibration.mass_posterior import (
    MassEstimate,
    log_density_of,
    mass_grid,
    summarised,
)
from jblast.cli.jax_start import start_jax
from jblast.waves.laws.ground_motion import GroundMotionCurve

Compared = tuple[Judged, MassEstimate]
"""A shot, whose `exact` is of the acoustic records, and its joint estimate."""


def judge(name: str) -> list[Compared]:
    """Estimate a shot, or each shot of a campaign, from all other records."""
    acoustic, ground = read_records(), read_ground()
    of_campaign = name in CAMPAIGNS
    left_out = (acoustic.campaign if of_campaign else acoustic.shot) == name
    laws = laws_without(left_out, name)
    campaign = np.array([shot.split("-")[0] for shot in ground.shot])
    used = (campaign if of_campaign else ground.shot) != name
    # without a site the burial at which coupling changes is not determined
    whole_site = not np.isin(ground.site[~used], ground.site[used]).any()
    form = WITHOUT["site" if whole_site else "shot"]
    curves = {
        quantity: fit_ground(quantity, form, weight=used * 1.0).curve
        for quantity in QUANTITIES
    }
    return [
        compare(shot, laws, curves, where(ground, ground.shot == shot))
        for shot in dict.fromkeys(acoustic.shot[left_out].tolist())
    ]


def compare(
    shot: str, laws: list, curves: dict[str, GroundMotionCurve], ground: Records
) -> Compared:
    """Estimate the mass of one shot from its acoustic records, and from all."""
    records = read_records()
    log = records.where(records.shot == shot)
    grid = mass_grid(log.charge_mass[0])
    acoustic = log_density_of(log, laws, grid)
    joint = acoustic + sum(
        log_density(quantity, curve, ground, np.exp(grid))
        for quantity, curve in curves.items()
    )
    told = summarised(grid, acoustic)
    one = Judged(
        shot=shot,
        campaign=str(log.campaign[0]),
        n_records=len(log.shot),
        scaled_height=float(log.scaled_height()[0]),
        log_mass=float(np.log(log.charge_mass[0])),
        laplace=told,
        emcee=told,
        valid=float(log.scaled_height()[0]) >= SHALLOWEST_LEFT_ASIDE,
        exact=told,
        exact_of_impulse=told,
    )
    return one, summarised(grid, joint)


def show(table: list[Compared]) -> None:
    """Print one line a shot."""
    each = "  ln est/W     sd  90 %  score"
    print(f"{'':26s}{'acoustic':>32s}{'with ground motion':>33s}")
    print(f"  shot   h/W^1/3   W kg{each} |{each}")
    for one, joint in table:
        cells = " |".join(
            f"{of.mean - one.log_mass:+10.3f} {of.sd:6.3f} "
            f"{'in' if inside(one, of) else 'OUT':>5s} {of.log_density_at_truth:+6.2f}"
            for of in (one.exact, joint)
        )
        mass = np.exp(one.log_mass)
        print(f"  {one.shot:6s} {one.scaled_height:8.2f} {mass:6.0f}{cells}")


def summarise(table: list[Compared], by_campaign: bool) -> None:
    """Print median error, score and coverage, and what ground motion adds."""
    judged = [one for one, _ in table]
    rows = resamples(judged, by_campaign)
    print("  summary              median |ln est/W|  mean score  inside")
    scores = []
    for title, told in (
        ("acoustic alone", [one.exact for one in judged]),
        ("both", [joint for _, joint in table]),
    ):
        pairs = list(zip(judged, told, strict=True))
        error = np.median([abs(of.mean - one.log_mass) for one, of in pairs])
        scores.append(np.array([of.log_density_at_truth for of in told]))
        held = sum(inside(*pair) for pair in pairs)
        print(
            f"  {title:20s} {error:17.3f} {scores[-1].mean():+11.3f}"
            f"  {held} of {len(judged)}"
        )
    gain = scores[1] - scores[0]
    low, high = np.quantile(gain[rows].mean(axis=1), (0.05, 0.95))
    print(f"  gain in mean score {gain.mean():+.3f} ({low:+.3f} to {high:+.3f})")


def main() -> None:
    """Print both tables."""
    start_jax()
    shots = list(dict.fromkeys(read_records().shot.tolist()))
    for title, names in (("shot", shots), ("campaign", list(CAMPAIGNS))):
        table = [pair for name in names for pair in judge(name)]
        near = [p for p in table if p[0].scaled_height > SHALLOWEST_LEFT_ASIDE]
        print(f"Each {title} left out in turn")
        show(near)
        summarise(near, by_campaign=title == "campaign")
        print("  deeper:")
        show([pair for pair in table if pair not in near])


if __name__ == "__main__":
    main()
