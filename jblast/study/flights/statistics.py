"""What flights amount to: their distribution, who flies on, what to beware of."""

import numpy as np
from jaxtyping import Bool, Float
from scipy.stats import binomtest

from jblast.scene import VehicleSpec
from jblast.study.flights.exposure import Exposure
from jblast.study.flights.records import Flights, Flown
from jblast.vehicle import Trajectory
from jblast.vehicle.metrics import THRESHOLDS

METRICS = (
    "error_before_m",
    "error_at_blast_m",
    "error_after_m",
    "peak_deviation_m",
    "peak_time_s",
    "recovery_time_s",
)
"""Numbers of a flight: those of `vehicle.FlightMetrics`, and one of `Flown`."""
EXPOSURES = Exposure._fields
QUANTILES = (0.05, 0.5, 0.95)
HOLD_WORDS = {
    "with_integral": "with integral action",
    "without_integral": "without integral action",
    "cascade": "by a cascade as PX4's",
    "observer": "with an observer",
}


def metric(flown: Flown, name: str) -> Float[np.ndarray, "*batch"]:
    """Return one of `METRICS` or of `EXPOSURES`."""
    owner = flown if name == "error_at_blast_m" else flown.metrics
    return np.asarray(getattr(flown.exposure if name in EXPOSURES else owner, name))


def quantiles(
    values: Float[np.ndarray, " vehicle"], shares: tuple[float, ...] = QUANTILES
) -> list[float]:
    """Return quantiles, each one of the values, as some may be infinite.

    What is NaN, as of a vehicle lost before its blast, is left out.
    """
    known = values[~np.isnan(values)]
    if not known.size:
        return [float("nan")] * len(shares)
    return [float(np.quantile(known, s, method="inverted_cdf")) for s in shares]


def flies_on(flown: Flown) -> Bool[np.ndarray, "*batch"]:
    """Return who neither crashed nor was lost; no more is asked of them."""
    return np.asarray(~flown.metrics.crashed)


def past_threshold(
    model: str, flown: Flown
) -> dict[str, Bool[np.ndarray, "*batch"] | None]:
    """Return who is past a threshold of its model, by exposure; None: not known."""
    found: dict[str, Bool[np.ndarray, "*batch"] | None] = {}
    for name in EXPOSURES:
        limit, values = THRESHOLDS[model][name].value, metric(flown, name)
        unknown = limit is None or np.isnan(values).all()
        found[name] = None if unknown else np.asarray(values > limit)
    return found


def share_interval(flags: Bool[np.ndarray, " vehicle"]) -> tuple[float, float]:
    """Return the 90 % interval of a chance of which so many flags are known.

    The exact one of a binomial share (Clopper and Pearson 1934).
    """
    found = binomtest(int(flags.sum()), flags.size).proportion_ci(0.90, method="exact")
    return float(found.low), float(found.high)


def warnings_of(flights: Flights) -> list[str]:
    """Return sentences on what the numbers do not tell by themselves."""
    said = list(flights.notes)
    encounter = next(iter(flights.holds.values())).encounter
    outside = np.mean(~encounter.in_range.all(axis=-1))
    if outside:
        whose = (
            "" if flights.count == 1 else f" of {100 * outside:.3g} % of the flights"
        )
        known = "laws hold" if flights.options.profile is None else "profile has cases"
        said.append(
            f"a blast{whose} comes from where no {known}: its load is finite, no more"
        )
    arrival = np.asarray(encounter.arrival_s)
    never = np.isposinf(arrival).any(axis=-1)
    if never.any():
        said.append("a blast never happens: the time of its charge is infinite")
    late = np.mean(((arrival > flights.seconds) & (arrival < np.inf)).any(axis=-1))
    if late:
        said.append("a blast comes after the end of the flight")
    for name, flown in flights.holds.items():
        away = np.mean(flown.error_at_blast_m > flights.options.tolerance_m)
        if away:
            whose = (
                "" if flights.count == 1 else f" in {100 * away:.3g} % of the flights"
            )
            said.append(
                f"{hold_words(name)}: outside the tolerance{whose} already as the "
                "first blast comes; what start and wind did is in the numbers after it "
                "(a later time_s of the charge leaves time to settle)"
            )
        lost = np.flatnonzero(flown.lost)
        if lost.size:
            which = ""
            if flights.count > 1:
                more = f" and {lost.size - 10} more" if lost.size > 10 else ""
                which = f": {', '.join(map(str, lost[:10]))}{more}"
            said.append(
                f"{hold_words(name)}: lost {lost.size} of {flights.count}, whose "
                f"numbers ran away{which}"
            )
    return said


def target_of(vehicle: VehicleSpec) -> Float[np.ndarray, "3"]:
    """Return the place a vehicle holds: east, north, up [m]."""
    return np.asarray(vehicle.held)


def trajectory_of(flights: Flights, name: str) -> Trajectory:
    """Return the path of a single flight by one hold."""
    trajectory = flights.holds[name].trajectory
    assert trajectory is not None, "a batch keeps no trajectories"
    return trajectory


def hold_words(name: str) -> str:
    """Return a controller in words."""
    return HOLD_WORDS[name]
