"""The answers of `jblast render` and `jblast events`."""

from dataclasses import dataclass, field
from typing import Literal

from jblast.results import ABSENT, AMONG, Answer
from jblast.sensors.camera.files.event_files import Written

Switch = Literal["on", "off"]


@dataclass(frozen=True)
class FilmEvents:
    """The events of a film.

    Attributes:
        threshold: Changes of the logarithm of light that give an event, brighter and
            darker.
        noise: Whether the camera has its imperfections.
        written: Numbers of events.
        stamps: How their times were found.
        stamp_error_s: Bound of the times' error; of 99 in 100 where interpolated.
    """

    threshold: tuple[float, float]
    noise: Switch
    written: Written = field(metadata=AMONG)
    stamps: Literal["solved for", "interpolated", "of the frame"]
    stamp_error_s: float


@dataclass(frozen=True)
class FilmFiles:
    """Where a film's files are.

    Attributes:
        frames: The directory of frames; absent with `--mode events`.
        events: The file of events; absent with `--mode rgb`.
        video: The video; absent without `--video`.
        contact_sheet: Some of the frames on one page.
    """

    frames: str | None = field(metadata=ABSENT)
    events: str | None = field(metadata=ABSENT)
    video: str | None = field(metadata=ABSENT)
    contact_sheet: str


@dataclass(frozen=True)
class FilmAnswer(Answer):
    """A film that was written.

    Attributes:
        scene: The file.
        mode: What was written of it.
        frames: How many there are.
        width: Of a frame, in pixels.
        height: Of a frame, in pixels.
        fps: Frames a second.
        video_fps: Frames of the video a second; absent without `--video`.
        start_s: When the first frame stands, on the scene's clock.
        duration_s: From the first frame to the last.
        seed: Of noise and priors.
        found: Its events; None with `--mode rgb`.
        lifted_m: How far above the ground a set of pictures stands that shows a burst
            on the ground; absent where it stands on it, or there is none.
        files: Where they are.
    """

    scene: str
    mode: Literal["rgb", "events", "both"]
    frames: int
    width: int
    height: int
    fps: float
    video_fps: float | None = field(metadata=ABSENT)
    start_s: float
    duration_s: float
    seed: int
    found: FilmEvents | None = field(metadata=AMONG)
    lifted_m: float | None = field(metadata=ABSENT)
    files: FilmFiles


def film_text(answer: FilmAnswer) -> str:
    """Return how much was written, how exact it is, and where it is."""
    summary = (
        f"{answer.frames:,} frames of {answer.width} x {answer.height} "
        f"pixels at {answer.fps:g} Hz from {answer.start_s:g} s"
    )
    if found := answer.found:
        summary += (
            f": {_counts(found.written)}; times {found.stamps}, "
            f"within {1e6 * found.stamp_error_s:g} us"
        )
        if found.stamps != "solved for":
            summary += " for 99 in 100"
    if answer.lifted_m is not None:
        summary += (
            ".\nThe pictures show a burst on the ground; this one is higher than half "
            f"its fireball's radius, and they hover at {answer.lifted_m:.3g} m"
        )
    files = answer.files
    where = (files.frames, files.events, _video(answer), files.contact_sheet)
    return "\n".join([summary, *filter(None, where), ""])


def _counts(written: Written) -> str:
    return (
        f"{written.events:,} events, {written.brighter:,} brighter and "
        f"{written.darker:,} darker"
    )


def _video(answer: FilmAnswer) -> str | None:
    """Return where the video is, and how fast it runs."""
    if answer.video_fps is None:
        return None
    slower = answer.fps / answer.video_fps
    if abs(slower - 1) < 5e-3:
        pace = "as fast as"
    elif slower > 1:
        pace = f"{slower:.3g} times slower than"
    else:
        pace = f"{1 / slower:.3g} times faster than"
    return f"{answer.files.video} ({answer.video_fps:g} Hz, {pace} the blast)"


def dark_film(share: float, darkest: float) -> str:
    """Return the warning of a film with pixels below the floor of the light."""
    return (
        f"{100 * share:.2g} % of the pixel values are darker than {darkest:.3g} of "
        "full scale; changes below that level give no events (--darkest sets it)"
    )


@dataclass(frozen=True)
class EventsAnswer(Answer):
    """The events of frames, as they were written.

    Attributes:
        frames: How many were read.
        width: Of a frame, in pixels.
        height: Of a frame, in pixels.
        fps: Frames a second.
        duration_s: From the first frame to the last.
        threshold: Changes of the logarithm of light that give an event, brighter and
            darker.
        srgb: Whether grey values were taken for sRGB.
        noise: Whether the camera has its imperfections.
        seed: Of the noise; null without.
        written: Numbers of events.
        bits: Bit depth of the values of the frames; null of floats.
        darkest: Linear light, as a fraction of full scale, below which changes give no
            events.
        below_darkest: Share of the pixel values that are darker than that.
        warnings: Limitations of this answer.
        out: The file.
    """

    frames: int
    width: int
    height: int
    fps: float
    duration_s: float
    threshold: tuple[float, float]
    srgb: bool
    noise: Switch
    seed: int | None
    written: Written = field(metadata=AMONG)
    bits: int | None
    darkest: float
    below_darkest: float
    warnings: tuple[str, ...]
    out: str


def events_text(answer: EventsAnswer) -> str:
    """Return how many events there were, and where they are."""
    return (
        f"{answer.frames:,} frames of {answer.width} x {answer.height} pixels "
        f"over {answer.duration_s:g} s: {_counts(answer.written)}\n"
        f"{answer.out}\n"
    )
