"""What flights came to as `jblast fly --json` prints it, key by key."""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

from jblast.json_values import plain

EastNorthUpM = tuple[float, float, float]


@dataclass(frozen=True)
class Quantiles:
    """Quantiles of a number over the vehicles; some may be infinite.

    Attributes:
        q05: 5 % quantile.
        q50: Median.
        q95: 95 % quantile.
    """

    q05: float
    q50: float
    q95: float


@dataclass(frozen=True)
class Share:
    """A share of the vehicles as that of a chance.

    Attributes:
        value: The share.
        q05: Where the chance's 90 % interval begins.
        q95: Where it ends.
    """

    value: float
    q05: float
    q95: float


@dataclass(frozen=True)
class BlastMet:
    """A blast as it came to one vehicle.

    Attributes:
        charge: Its name; "" of one alone.
        arrival_s: When, on the scene's clock.
        distance_m: From the charge to the vehicle then.
        scaled_distance: By Sachs [m/kg^(1/3)].
        overpressure_pa: Incident peak there.
        in_range: Whether its laws hold there.
    """

    charge: str
    arrival_s: float
    distance_m: float
    scaled_distance: float
    overpressure_pa: float
    in_range: bool


@dataclass(frozen=True)
class BlastMetBySeveral:
    """A blast as it came to several vehicles; attributes as of `BlastMet`.

    Attributes:
        charge: Its name; "" of one alone.
        arrival_s: When, on the scene's clock.
        distance_m: From the charge to the vehicle then.
        scaled_distance: By Sachs [m/kg^(1/3)].
        overpressure_pa: Incident peak there.
        in_range_share: Of the vehicles, where its laws hold.
    """

    charge: str
    arrival_s: Quantiles
    distance_m: Quantiles
    scaled_distance: Quantiles
    overpressure_pa: Quantiles
    in_range_share: float


@dataclass(frozen=True)
class Outcome:
    """What became of one flight.

    Attributes:
        error_before_m: Path error before the first blast.
        error_at_blast_m: As it comes.
        error_after_m: After it.
        peak_deviation_m: Largest path error after it.
        peak_time_s: When that was, after the arrival.
        recovery_time_s: From the arrival until it stays within the tolerance.
        peak_overpressure_pa: Incident, of the strongest blast.
        peak_acceleration_m_s2: By the blasts alone.
        fireball_time_s: Within a fireball while it glows.
        recovered: Whether it came back within the tolerance.
        settled: Whether it was within it before the blast.
        crashed: Whether it crashed.
        lost: Whether its numbers ran away.
        flies_on: Whether it did neither.
        past_threshold: By exposure; null: not known.
    """

    error_before_m: float
    error_at_blast_m: float
    error_after_m: float
    peak_deviation_m: float
    peak_time_s: float
    recovery_time_s: float
    peak_overpressure_pa: float
    peak_acceleration_m_s2: float
    fireball_time_s: float
    recovered: bool
    settled: bool
    crashed: bool
    lost: bool
    flies_on: bool
    past_threshold: Mapping[str, bool | None]


@dataclass(frozen=True)
class OutcomeOfSeveral:
    """What became of several flights; quantiles are of the attributes of `Outcome`.

    Attributes:
        error_before_m: Path error before the first blast.
        error_at_blast_m: As it comes.
        error_after_m: After it.
        peak_deviation_m: Largest path error after it.
        peak_time_s: When that was, after the arrival.
        recovery_time_s: From the arrival until it stays within the tolerance.
        peak_overpressure_pa: Incident, of the strongest blast.
        peak_acceleration_m_s2: By the blasts alone.
        fireball_time_s: Within a fireball while it glows.
        recovered_share: Of the vehicles.
        settled_share: Of the vehicles.
        crashed_share: Of the vehicles.
        flies_on_share: Of the vehicles, with its interval.
        past_threshold_share: By exposure; null: not known.
        lost: How many ran away.
        lost_vehicles: Numbers of these, the first hundred.
    """

    error_before_m: Quantiles
    error_at_blast_m: Quantiles
    error_after_m: Quantiles
    peak_deviation_m: Quantiles
    peak_time_s: Quantiles
    recovery_time_s: Quantiles
    peak_overpressure_pa: Quantiles
    peak_acceleration_m_s2: Quantiles
    fireball_time_s: Quantiles
    recovered_share: float
    settled_share: float
    crashed_share: float
    flies_on_share: Share
    past_threshold_share: Mapping[str, float | None]
    lost: int
    lost_vehicles: tuple[int, ...]


@dataclass(frozen=True)
class Limit:
    """A threshold of the vehicle.

    Attributes:
        value: Its value; null: nobody knows.
        source: Where it comes from.
    """

    value: float | None
    source: str


@dataclass(frozen=True)
class EstimateThrown:
    """Errors of the vehicle's estimate about one blast; quantiles of several vehicles.

    Attributes:
        charge: Its name; "" of one alone.
        place_before_m: Of position, root mean square in the second before it comes.
        place_m: Greatest until the next blast, 10 s at most.
        moves_before_m_s: Of velocity, before.
        moves_m_s: After.
        turn_before_rad: Of attitude, before.
        turn_rad: After.
    """

    charge: str
    place_before_m: float | Quantiles
    place_m: float | Quantiles
    moves_before_m_s: float | Quantiles
    moves_m_s: float | Quantiles
    turn_before_rad: float | Quantiles
    turn_rad: float | Quantiles


@dataclass(frozen=True)
class FlightsAnswer:
    """How it was flown, what came, and what became of it.

    Attributes:
        scene: The scene's file.
        seed: Of the priors.
        vehicle: What flew.
        vehicles: How many.
        position_m: Where from: east, north, up.
        target_m: What it holds.
        yaw_rad: Its heading.
        seconds: How long.
        step_s: Of the integrator.
        integrator: Which.
        backend: What calculated it.
        tolerance_m: Within which a vehicle has recovered.
        load: "laws", "custom profile" or the preset of a world.
        drawn: What was drawn of priors; quantiles of several.
        blasts: Each as it came.
        thresholds: By exposure.
        scene_hold: Which hold the scene asked for; null: it does not say.
        holds: By hold what became of the flights.
        estimator: "ekf", or "": it flew by the truth.
        estimates: By hold what each blast did to the estimate.
        warnings: Sentences on what the numbers do not tell.
    """

    scene: str
    seed: int
    vehicle: str
    vehicles: int
    position_m: EastNorthUpM
    target_m: EastNorthUpM
    yaw_rad: float
    seconds: float
    step_s: float
    integrator: str
    backend: str
    tolerance_m: float
    load: str
    drawn: Mapping[str, float | Quantiles]
    blasts: tuple[BlastMet | BlastMetBySeveral, ...]
    thresholds: Mapping[str, Limit]
    scene_hold: str | None
    holds: Mapping[str, Outcome | OutcomeOfSeveral]
    estimator: str
    estimates: Mapping[str, tuple[EstimateThrown, ...]]
    warnings: tuple[str, ...]

    def to_dict(self) -> dict[str, Any]:
        """Return it as JSON can hold it; null is what is not a finite number."""
        return {f.name: plain(getattr(self, f.name)) for f in fields(self)}
