"""The tables of `leave_out.py`: shots weighed by laws that have not seen them."""

from typing import NamedTuple

import numpy as np

from calibration.mass_posterior import MassEstimate


class Judged(NamedTuple):
    """A shot estimated from the others: what `jblast fit` says, and two checks."""

    shot: str
    campaign: str
    n_records: int
    scaled_height: float
    log_mass: float
    fitted: MassEstimate
    valid: bool
    exact: MassEstimate
    exact_of_impulse: MassEstimate


def inside(one: Judged, told: MassEstimate) -> bool:
    """Return whether the 90 % interval holds the true mass."""
    return told.q05 <= one.log_mass <= told.q95


def show(judged: list[Judged]) -> None:
    """Print one line a shot."""
    print(
        "  shot   records  h/W^1/3   W kg  est kg  ln est/W     sd  90 %  score  mark"
    )
    for one in judged:
        told = one.fitted
        print(
            f"  {one.shot:6s} {one.n_records:7d} {one.scaled_height:8.2f} "
            f"{np.exp(one.log_mass):6.0f} {np.exp(told.mean):7.0f} "
            f"{told.mean - one.log_mass:+9.3f} {told.sd:6.3f} "
            f"{'in' if inside(one, told) else 'OUT':>5s} "
            f"{told.log_density_at_truth:+6.2f}{'' if one.valid else ' outside'}"
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
        ("jblast fit", "fitted"),
        ("by quadrature, not Laplace", "exact"),
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
    """Print how far Laplace's approximation lies from the quadrature at most."""
    mean = [(one.fitted.mean - one.exact.mean) / one.exact.sd for one in judged]
    sd = [one.fitted.sd / one.exact.sd - 1 for one in judged]
    worst = max(mean, key=abs), max(sd, key=abs)
    print(
        f"  fit less quadrature, largest: mean {worst[0]:+.2f} sd, "
        f"sd {100 * worst[1]:+.1f} %"
    )
