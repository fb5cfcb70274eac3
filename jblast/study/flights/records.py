"""What a flight through blasts is asked for, and what came of it."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Array, Bool, Float

from jblast.autopilot.estimator import Followed, Thrown
from jblast.scene import VehicleSpec
from jblast.study.flights.encounter import Encounter, LoadLaw, Profile
from jblast.study.flights.exposure import Exposure
from jblast.vehicle import STEP_S, FlightMetrics, Trajectory

TOLERANCE_M = 0.05


@dataclass(frozen=True)
class Options:
    """How to fly.

    Attributes:
        seconds: Duration; None: from the blasts and the vehicle (`duration.py`).
        step_s: Of the integrator.
        integrator: "rk4" or "euler".
        backend: As `vehicle.simulate` takes it.
        tolerance_m: Of the path error, within which a vehicle has recovered.
        profile: In place of the laws' load.
        load: By which laws blasts push; "laws" are jblast's own.
        estimator: By what a vehicle flies: "ekf", a filter of what its instruments
            say; "": the truth.
    """

    seconds: float | None = None
    step_s: float = STEP_S
    integrator: str = "rk4"
    backend: str = "auto"
    tolerance_m: float = TOLERANCE_M
    profile: Profile | None = None
    load: LoadLaw = "laws"
    estimator: str = ""


@dataclass(frozen=True)
class Flown:
    """What one controller made of it. Leading axes are the batch's.

    Attributes:
        metrics: From the first blast's arrival on.
        encounter: How each blast came to it.
        exposure: What they did to it beside moving it.
        error_at_blast_m: Path error as the first blast comes.
        lost: Whether a vehicle diverged.
        trajectory: Of a single flight; None of a batch.
        thrown: What the blasts did to its estimate; None: it flew by the truth.
        followed: What a single flight estimated; None of a batch, or by the truth.
    """

    metrics: FlightMetrics
    encounter: Encounter
    exposure: Exposure
    error_at_blast_m: Float[Array, "*batch"]
    lost: Bool[Array, "*batch"]
    trajectory: Trajectory | None
    thrown: Thrown | None = None
    followed: Followed | None = None


@dataclass(frozen=True)
class Flights:
    """Flights through the blasts of a scene.

    Attributes:
        vehicle: What the scene says of it.
        options: How they were flown.
        seconds: How long each was.
        count: How many scenes were drawn; each was flown by each hold.
        drawn: What was drawn, by name of `scene.PARAMETERS`.
        blasts: Names of the charges; "" of one alone.
        places_m: Of the charges, east, north, up.
        wind_m_s: Towards east, north.
        holds: By a name of `vehicle.CONTROLLERS`, in the order flown.
        own: The scene's own hold; None where it does not say.
        notes: What there is to say of the curves that the blasts were taken by.
    """

    vehicle: VehicleSpec
    options: Options
    seconds: float
    count: int
    drawn: dict[str, Float[np.ndarray, "*batch"]]
    blasts: tuple[str, ...]
    places_m: Float[np.ndarray, "*batch blast 3"]
    wind_m_s: Float[np.ndarray, "*batch 2"]
    holds: dict[str, Flown]
    own: str | None
    notes: tuple[str, ...] = ()
