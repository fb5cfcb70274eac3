"""What a world came to as `jblast world --json` prints it, key by key."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

from jblast.report.flights.answer import EastNorthUpM, FlightsAnswer


@dataclass(frozen=True)
class BlastDrawn:
    """A blast that happens.

    Attributes:
        shot: Its name: of a random one the number that it was drawn by.
        time_s: When, on the common clock.
        position_m: East, north, up.
        mass_kg: Of the charge.
    """

    shot: str
    time_s: float
    position_m: EastNorthUpM
    mass_kg: float


@dataclass(frozen=True)
class FirstPerceived:
    """A blast as one sense of somebody had it first.

    Attributes:
        shot: Name of the blast.
        entity: Of the sensor; "vehicle" or "camera".
        sense: What was perceived.
        time_s: When, on the common clock.
    """

    shot: str
    entity: str
    sense: str
    time_s: float


@dataclass(frozen=True)
class ImuWritten:
    """What an inertial measurement unit wrote.

    Attributes:
        file: Its table, in the folder of the run.
        rate_hz: Samples a second.
        samples: How many.
        clipped: Whether one stands at the end of its range.
    """

    file: str
    rate_hz: float
    samples: int
    clipped: bool


@dataclass(frozen=True)
class FilmMade:
    """What a world's camera wrote.

    Attributes:
        frames: How many.
        width: Of each [px].
        height: Of each [px].
        events: How many there are.
        brighter: How many of them tell of more light.
        darker: How many tell of less.
        stamps: How their times were found.
        stamp_error_s: Bound of the times' error; of 99 in 100 where interpolated.
    """

    frames: int
    width: int
    height: int
    events: int
    brighter: int
    darker: int
    stamps: Literal["solved for", "interpolated", "of the frame"]
    stamp_error_s: float


@dataclass(frozen=True)
class PresetTaken:
    """By which preset blasts act other than they do.

    Attributes:
        name: As it was asked for.
        mark: What such a run is.
        source: Where the preset comes from.
    """

    name: str
    mark: str
    source: str


@dataclass(frozen=True)
class WorldAnswer:
    """What was drawn, and what was perceived of it.

    Attributes:
        scene: The scene's file.
        seed: Of all that is drawn.
        seconds: When the world ended.
        command: What was typed.
        date: When it ran.
        versions: Of jblast, jax and python.
        scene_sha256: Of the scene's file.
        preset: By which blasts act other than they do; null: none.
        laws: By which law every quantity is made, for all senses alike.
        blasts: Those that happen, in order of time.
        perceived: Each first perception, in order of time.
        not_perceived: How many come after the end.
        readings: Rows of observations.csv.
        flight: As of `jblast fly`; null where nothing flies.
        sound: As of `jblast listen`; null where no sensor samples.
        imu: By name, what each inertial measurement unit wrote; null where none flies.
        camera: What it wrote; null where there is none.
        warnings: Sentences on what to know.
    """

    scene: str
    seed: int
    seconds: float
    command: str
    date: str
    versions: Mapping[str, str]
    scene_sha256: str | None
    preset: PresetTaken | None
    laws: Mapping[str, str]
    blasts: tuple[BlastDrawn, ...]
    perceived: tuple[FirstPerceived, ...]
    not_perceived: int
    readings: int
    flight: FlightsAnswer | None
    sound: Mapping[str, Any] | None
    imu: Mapping[str, ImuWritten] | None
    camera: FilmMade | None
    warnings: tuple[str, ...]
