"""The tables of `leave_out.py`: shots weighed by laws that have not seen them."""

from typing import NamedTuple

import numpy as np

from calibration.mass_posterior import MassEstimate


class Judged(NamedTuple):
    """A shot estimated from the others: what `jblast fit` says, and two checks.

    Attributes:
        shot: Its name.
        campaign: Its campaign's.
        n_records: How many the log has, of each quantity.
        scaled_height: Height of burst h/W^(1/3) [m/kg^(1/3)].
        log_mass: The recorded mass, ln of kg.
        laplace: By `jblast fit`.
        emcee: By `jblast fit --posterior emcee`.
        valid: Whether these are marked valid.
        exact: By quadrature.
        exact_of_impulse: The same from the impulses alone.
    """

    shot: str
    campaign: str
    n_records: int
    scaled_height: float
    log_mass: float
    laplace: MassEstimate
    emcee: MassEstimate
    valid: bool
    exact: MassEstimate
    exact_of_impulse: MassEstimate


def inside(one: Judged, told: MassEstimate) -> bool:
    """Return whether the 90 % interval holds the true mass."""
    return told.q05 <= one.log_mass <= told.q95


def show(judged: list[Judged]) -> None:
    """Print one line a shot: by Laplace's method, then by emcee."""
    each = "  ln est/W     sd  90 %  score"
    print(f"{'':35s}{'Laplace':>32s}{'emcee':>33s}")
    print(f"  shot   records  h/W^1/3   W kg{each} |{each}  mark")
    for one in judged:
        told = " |".join(
            f"{of.mean - one.log_mass:+10.3f} {of.sd:6.3f} "
            f"{'in' if inside(one, of) else 'OUT':>5s} {of.log_density_at_truth:+6.2f}"
            for of in (one.laplace, one.emcee)
        )
        print(
            f"  {one.shot:6s} {one.n_records:7d} {one.scaled_height:8.2f} "
            f"{np.exp(one.log_mass):6.0f}{told}{'' if one.valid else ' outside'}"
        )


def resamples(judged: list[Judged], by_campaign: bool, n: int = 10_000) -> np.ndarray:
    """Draw rows of shots with replacement; by campaign, campaigns first."""
    draw = np.random.default_rng(0)
    if not by_campaign:
        return draw.integers(len(judged), size=(n, len(judged)))
    campaign = np.array([one.campaign for one in judged])
    groups = [np.flatnonzero(campaign == name) for name in np.unique(campaign)]
    # A campaign keeps its size, so the rows are filled in turn and cut to one length.
    rows = []
    for _ in range(n):
        row: list[int] = []
        while len(row) < len(judged):
            group = groups[draw.integers(len(groups))]
            row.extend(draw.choice(group, len(group)))
        rows.append(row[: len(judged)])
    return np.array(rows)


def summarise(judged: list[Judged], by_campaign: bool) -> None:
    """Print median error, score and coverage, with 90 % bootstrap intervals."""
    rows = resamples(judged, by_campaign)
    print(
        "  summary                       median |ln est/W|    mean score       inside"
    )
    for title, which in (
        ("jblast fit, Laplace", "laplace"),
        ("jblast fit, emcee", "emcee"),
        ("by quadrature", "exact"),
        ("  from the impulse alone", "exact_of_impulse"),
    ):
        told: list[MassEstimate] = [getattr(one, which) for one in judged]
        pairs = list(zip(judged, told, strict=True))
        error = np.array([abs(t.mean - one.log_mass) for one, t in pairs])
        score = np.array([t.log_density_at_truth for t in told])
        held = sum(inside(*pair) for pair in pairs)
        e = np.quantile(np.median(error[rows], axis=1), (0.05, 0.95))
        s = np.quantile(score[rows].mean(axis=1), (0.05, 0.95))
        print(
            f"  {title:27s} {np.median(error):.3f} ({e[0]:.3f} to {e[1]:.3f})"
            f"  {score.mean():+.3f} ({s[0]:+.3f} to {s[1]:+.3f})"
            f"  {held} of {len(judged)}"
        )


def compare(judged: list[Judged]) -> None:
    """Print how far both methods lie from the quadrature at most."""
    print("  less quadrature, largest [its sd]    mean      sd     5 %    95 %   score")
    for title, which in (("Laplace", "laplace"), ("emcee", "emcee")):
        told: list[MassEstimate] = [getattr(one, which) for one in judged]
        away = np.array(
            [
                [
                    *(np.array(of[:4]) - np.array(one.exact[:4])) / one.exact.sd,
                    of.log_density_at_truth - one.exact.log_density_at_truth,
                ]
                for one, of in zip(judged, told, strict=True)
            ]
        )
        worst = away[np.argmax(np.abs(away), axis=0), range(away.shape[1])]
        print(f"    {title:31s}" + "".join(f"{x:+8.3f}" for x in worst))
