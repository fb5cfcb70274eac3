"""The answers of `jblast render` and `jblast events`."""

from dataclasses import dataclass, field
from typing import Literal

from jblast.report.view import Facts, Lines, View
from jblast.results import ABSENT, AMONG, Document, filled
from jblast.sensors.camera.files.event_files import Written
from jblast.sensors.camera.film import ConvertedFilm, Film
from jblast.sensors.camera.film_writer import FilmEvents, FilmFiles, Mode, WrittenFilm
from jblast.study.filming import lifted


@dataclass(frozen=True)
class FilmAnswer(Document):
    """The answer of `jblast render`.

    Attributes:
        scene: The scene's file.
        mode: Kind of the output.
        frames: Number of frames.
        width: Width of a frame [px].
        height: Height of a frame [px].
        fps: Frames per second.
        video_fps: Frames per second of the video; absent without `--video`.
        start_s: Time of the first frame, on the scene's clock.
        duration_s: Time from the first frame to the last.
        seed: Seed of noise and priors.
        found: Its events; None with `--mode rgb`.
        lifted_m: Height above the ground of pictures of a surface burst; absent if
            they stand on the ground, or if there are none.
        files: Paths of the files.
    """

    scene: str
    mode: Mode
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


@dataclass(frozen=True)
class EventsAnswer(Document):
    """The answer of `jblast events`.

    Attributes:
        frames: Number of frames that were read.
        width: Width of a frame [px].
        height: Height of a frame [px].
        fps: Frames per second.
        duration_s: Time from the first frame to the last.
        threshold: Contrast thresholds of events, brighter and darker (change of the
            logarithm of light).
        srgb: Whether grey values were read as sRGB.
        noise: Whether the camera's noise is included.
        seed: Seed of the noise; null without noise.
        written: Numbers of events.
        bits: Bit depth of the frames; null for floats.
        darkest: Linear light, as a fraction of full scale, below which changes give no
            events.
        below_darkest: Share of the pixel values that are darker than that.
        warnings: Limitations, as sentences.
        out: File of the events.
    """

    frames: int
    width: int
    height: int
    fps: float
    duration_s: float
    threshold: tuple[float, float]
    srgb: bool
    noise: Literal["on", "off"]
    seed: int | None
    written: Written = field(metadata=AMONG)
    bits: int | None
    darkest: float
    below_darkest: float
    warnings: tuple[str, ...]
    out: str


def film_answer(
    film: Film, made: WrittenFilm, *, scene: str, mode: Mode, seed: int
) -> FilmAnswer:
    """Return the answer on a film that was written."""
    return filled(
        FilmAnswer,
        made,
        film.camera,
        scene=scene,
        mode=mode,
        frames=len(film.times),
        fps=float(film.camera.frames_hz),
        start_s=float(film.times[0]),
        duration_s=float(film.times[-1] - film.times[0]),
        seed=seed,
        lifted_m=lifted(film),
    )


def film_view(answer: FilmAnswer) -> View:
    """Return size and accuracy of a film."""
    times, lifted_by = "", ""
    if found := answer.found:
        error = f"error below {1e6 * found.stamp_error_s:g} us for 99 % of them"
        times = f"{found.stamps}, {error}"
    if answer.lifted_m is not None:
        lifted_by = (
            "The pictures show a burst on the ground, but this burst is higher than "
            "half its fireball's radius; they are drawn at a height of "
            f"{answer.lifted_m:.3g} m."
        )
    counts = _counts(found.written) if found else ""
    return View(
        f"{_frames(answer)} at {answer.fps:g} Hz from {answer.start_s:g} s",
        [
            Facts([("events", counts), ("event times", times)]),
            Lines("Warnings", [lifted_by]),
        ],
    )


def film_lines(answer: FilmAnswer) -> list[str]:
    """Return the files of a film, and the speed of its video."""
    files, pace = answer.files, ""
    if answer.video_fps is not None:
        # a video plays slower than the camera runs: both rates are reported
        pace = f" ({answer.video_fps:g} Hz, {_pace(answer.fps / answer.video_fps)})"
    paths = (files.frames, files.events, files.contact_sheet)
    video = [f"Written: {files.video}{pace}"] if files.video else []
    return [*(f"Written: {path}" for path in paths if path), *video]


def _pace(slower: float) -> str:
    """Return the speed of a video relative to the blast."""
    # below half a per cent the ratio prints as 1, to three digits
    if abs(slower - 1) < 5e-3:
        return "in real time"
    if slower > 1:
        return f"{slower:.3g} times slower than real time"
    return f"{1 / slower:.3g} times faster than real time"


def events_answer(
    made: ConvertedFilm, *, srgb: bool, noise: bool, seed: int, out: str
) -> EventsAnswer:
    """Return the answer on the events of a converted film."""
    dark = (
        f"{100 * made.below_darkest:.2g} % of the pixel values are darker than "
        f"{made.darkest:.3g} of full scale; changes below that level give no events "
        "(--darkest sets it)"
    )
    return filled(
        EventsAnswer,
        made,
        fps=made.frames_hz,
        duration_s=made.seconds,
        srgb=srgb,
        noise="on" if noise else "off",
        # the ideal camera has no random numbers: a seed would suggest otherwise
        seed=seed if noise else None,
        warnings=(dark,) if made.below_darkest else (),
        out=out,
    )


def events_view(answer: EventsAnswer) -> View:
    """Return the number of events."""
    counts = _counts(answer.written)
    return View(
        f"{_frames(answer)} over {answer.duration_s:g} s: {counts}",
        [Lines("Warnings", answer.warnings)],
    )


def _frames(answer: FilmAnswer | EventsAnswer) -> str:
    return f"{answer.frames:,} frames of {answer.width} x {answer.height} pixels"


def _counts(written: Written) -> str:
    return (
        f"{written.events:,} events, {written.brighter:,} brighter and "
        f"{written.darker:,} darker"
    )
