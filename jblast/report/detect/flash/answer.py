"""What was seen in a film or a stream of events, as `--json` prints it, key by key."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

from jblast.detect.flash.search import Flash, FlashDetections
from jblast.detect.threshold import in_decibels
from jblast.json_values import entries

if TYPE_CHECKING:  # it brings JAX
    from jblast.detect.flash.directions import Direction

Kind = Literal["frames", "video", "events"]


@dataclass(frozen=True)
class Arrival:
    """A flash in a line.

    Attributes:
        time_s: First light, since frame 0 or the first event.
        snr_db: Of the test's statistic, when it was told.
        sigma_s: Of the time.
        pixel: Where the burst is, x and y.
        frame: The first that shows it; of events the millisecond.
    """

    time_s: float
    snr_db: float
    sigma_s: float
    pixel: tuple[float, float]
    frame: int


@dataclass(frozen=True)
class GrownTo:
    """A silhouette.

    Attributes:
        time_s: When.
        radius_px: Of the disc or half disc whose columns spread as much.
        x_px: Mean column.
        y_px: Mean row.
        cut: Whether an edge of the image cuts it.
    """

    time_s: float
    radius_px: float
    x_px: float
    y_px: float
    cut: bool


@dataclass(frozen=True)
class FlashSeen:
    """All that is known of a flash.

    Attributes:
        time_s: First light, since frame 0 or the first event.
        sigma_s: Its standard deviation.
        frame: The first that shows it; of events the millisecond.
        told_s: When it was told.
        statistic: Of the test then.
        x_px: The burst in the image.
        x_sigma_px: Its standard deviation.
        y_px: Down from the top.
        y_sigma_px: Its standard deviation.
        radius_px: Of the fireball when it has grown; null where it is not told.
        radius_sigma_px: Its standard deviation.
        growth_s: Time constant of its growth; null where it is not told.
        growth_sigma_s: Its standard deviation.
        direction: From the camera; null without a scene.
        growth: Its silhouettes.
    """

    time_s: float
    sigma_s: float
    frame: int
    told_s: float
    statistic: float
    x_px: float
    x_sigma_px: float
    y_px: float
    y_sigma_px: float
    radius_px: float | None
    radius_sigma_px: float | None
    growth_s: float | None
    growth_sigma_s: float | None
    direction: "DirectionSeen | None"
    growth: tuple[GrownTo, ...]


@dataclass(frozen=True)
class DirectionSeen:
    """From the camera to the burst, by the scene's pose and lens.

    Attributes:
        bearing_rad: Clockwise from north.
        bearing_sd_rad: Its standard deviation, of the place in the image alone.
        elevation_rad: Above the horizon.
        elevation_sd_rad: Its standard deviation, likewise.
    """

    bearing_rad: float
    bearing_sd_rad: float
    elevation_rad: float
    elevation_sd_rad: float


@dataclass(frozen=True)
class Searched:
    """What was searched.

    Attributes:
        path: Folder or file.
        kind: Of which kind.
        width: In pixels.
        height: In pixels.
        frames: How many; of events milliseconds.
        frames_hz: A second.
        seconds: How long.
    """

    path: str
    kind: Kind
    width: int
    height: int
    frames: int
    frames_hz: float
    seconds: float


@dataclass(frozen=True)
class Method:
    """How it was searched.

    Attributes:
        name: The test.
        false_alarms_per_hour: Of scenes that look like a blast.
        threshold: Of the statistic.
    """

    name: Literal["growth_cusum"]
    false_alarms_per_hour: float
    threshold: float


@dataclass(frozen=True)
class FlashAnswer:
    """What was seen.

    Attributes:
        detected: Whether anything was.
        arrivals: In order of time.
        threshold_snr_db: The same of the threshold as `snr_db`.
        latency_s: From first light to being told, of the slowest; the least there can
            be where nothing was seen.
        method: How it was searched.
        recording: What was searched.
        flashes: All that is known of each arrival.
        warnings: What to know.
    """

    detected: bool
    arrivals: tuple[Arrival, ...]
    threshold_snr_db: float
    latency_s: float
    method: Method
    recording: Searched
    flashes: tuple[FlashSeen, ...]
    warnings: tuple[str, ...]

    def to_dict(self) -> dict[str, Any]:
        """Return what JSON can hold of it."""
        return {"schema": 1} | entries(self)


def flash_answer(
    watched: FlashDetections,
    searched: Searched,
    false_alarms: float,
    directions: "Sequence[Direction]" = (),
    warnings: Sequence[str] = (),
) -> FlashAnswer:
    """Return what is told of a film.

    Args:
        watched: What was seen in it.
        searched: What it is.
        false_alarms: For how many an hour the threshold was set.
        directions: Of each flash; none without a scene.
        warnings: What to know.
    """
    late = [f.told_s - f.growth.time_s for f in watched.flashes]
    return FlashAnswer(
        detected=bool(watched.flashes),
        arrivals=tuple(_arrival(flash) for flash in watched.flashes),
        threshold_snr_db=in_decibels(watched.threshold),
        latency_s=max(late, default=watched.latency_s),
        method=Method("growth_cusum", false_alarms, watched.threshold),
        recording=searched,
        flashes=tuple(
            _seen(flash, DirectionSeen(*directions[i]) if directions else None)
            for i, flash in enumerate(watched.flashes)
        ),
        warnings=tuple(warnings),
    )


def _arrival(flash: Flash) -> Arrival:
    grown = flash.growth
    decibels = in_decibels(flash.statistic)
    pixel = grown.x_px, grown.y_px
    return Arrival(grown.time_s, decibels, grown.sigma_s, pixel, flash.frame)


def _seen(flash: Flash, direction: DirectionSeen | None) -> FlashSeen:
    grown = flash.growth
    return FlashSeen(
        time_s=grown.time_s,
        sigma_s=grown.sigma_s,
        frame=flash.frame,
        told_s=flash.told_s,
        statistic=flash.statistic,
        x_px=grown.x_px,
        x_sigma_px=grown.x_sigma_px,
        y_px=grown.y_px,
        y_sigma_px=grown.y_sigma_px,
        radius_px=grown.radius_px,
        radius_sigma_px=grown.radius_sigma_px,
        growth_s=grown.growth_s,
        growth_sigma_s=grown.growth_sigma_s,
        direction=direction,
        growth=tuple(
            GrownTo(s.time_s, s.radius_px, s.x_px, s.y_px, s.cut)
            for s in flash.silhouettes
        ),
    )
