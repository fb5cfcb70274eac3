"""The answer of `jblast detect` for sound, film and clips."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from itertools import groupby, zip_longest
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import numpy as np

from jblast.files import Content
from jblast.observations import Observations
from jblast.observations.log_io import log_text
from jblast.observations.records.sound import write_sound
from jblast.report.colours import BLUE, INK, MUTED, VERMILLION
from jblast.report.messages import sentence
from jblast.report.numbers import joined, printed_number, rounded
from jblast.report.output import NOT_FOUND, Answer
from jblast.report.view import Block, Column, Facts, Lines, Picture, Table, View
from jblast.results import AMONG, Document, among, filled
from jblast.signals.arrival_log import ArrayFinding
from jblast.signals.detect_files import (
    ClipDetections,
    Film,
    FilmDetections,
    SoundDetections,
)
from jblast.signals.detection import Detection, PulseFit
from jblast.signals.flash.fireball import Direction, Growth, Silhouette
from jblast.signals.flash.search import SLOW_HZ, Candidate, Flash
from jblast.signals.matched_filter import in_decibels
from jblast.signals.sound_watch import Searched

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

PICTURE, LOG, FILTERED = "detection.png", "observations.csv", "filtered.wav"
CAUSES = {
    "faint": "below the threshold",
    "grows_on": "its growth did not slow down as a fireball's of up to 1 t does",
    "flicker": "its size changed without an order, as on glittering water",
}
"""Reasons for which a bright spot is not reported as a blast."""
MAX_LISTED = 5
"""Largest number of such spots in the text; the document has all of them."""
MAX_FLASHES, MAX_CHANNELS = 4, 8
"""Largest number of flashes in a figure, and of channels (8 are 29 inches high)."""
OTHERS = (
    "{others:sound} without the form of a blast, such as doors, clicks, thunder, or "
    "reverberant blasts{option}"
)
ECHO = (
    "{sensor}: the arrival at {arrival_s:6} is not in the log: weaker than another one "
    "of the same bang, possibly an echo"
)
SLOW = (
    "{rate:g} frames/s: a fireball grows within a few milliseconds, and the test is "
    "calibrated at 1,000 frames/s; at lower rates a lamp looks like a blast, and the "
    "false-alarm rate is not the requested one"
)
SPOT = (
    "frame {frame} ({seconds:.5g} s) at x {x_px:.0f}, y {y_px:.0f} px: {why}, "
    "statistic {statistic:.3g}"
)


@dataclass(frozen=True)
class SoundArrival:
    """An arrival in a channel.

    Attributes:
        found: The arrival.
        channel: Number of the channel in its file, from 1.
        sensor: Name of the sensor.
        form: Test of its form; absent in a search with a template.
    """

    found: Detection = field(metadata=among("time_s", "snr_db", "sigma_s"))
    channel: int
    sensor: str
    form: PulseFit | None = field(metadata=AMONG)


@dataclass(frozen=True)
class SearchedChannel:
    """A searched channel.

    Attributes:
        sensor: Name of the sensor.
        record: Name of the record.
        channel: Number of the channel in its file, from 1.
        rate_hz: Sampling rate [1/s].
        seconds: Length [s].
        threshold_snr_db: Detection threshold [dB].
    """

    sensor: str
    record: str
    channel: int
    rate_hz: float
    seconds: float
    threshold_snr_db: float


@dataclass(frozen=True)
class ArrayDirection:
    """Direction of the source by an array.

    Attributes:
        layout: Arrangement of the microphones.
        bearing_rad: Bearing, clockwise from north.
        bearing_sd_rad: Its standard deviation.
        elevation_rad: Elevation.
        elevation_sd_rad: Its standard deviation.
        undetermined: Angles that are not identified.
        mirror_rad: Bearing and elevation of an equally possible direction; null for
            none.
        p_plane_wave: Probability of a larger chi-squared for a plane wave.
    """

    layout: str
    bearing_rad: float
    bearing_sd_rad: float
    elevation_rad: float
    elevation_sd_rad: float
    undetermined: tuple[str, ...]
    mirror_rad: tuple[float, float] | None
    p_plane_wave: float


@dataclass(frozen=True)
class ArrayAnswer:
    """A bang at an array.

    Attributes:
        array: Name of its recorder.
        bang: Number of the bang, from 1.
        in_log: Whether the log has one row for the array.
        direction: Direction of the source; absent without a common wave.
    """

    array: str
    bang: int
    in_log: bool
    direction: ArrayDirection | None = field(metadata=AMONG)


@dataclass(frozen=True)
class DetectionAnswer(Document):
    """The answer of `jblast detect` for sound.

    Attributes:
        detected: Whether a blast was detected.
        arrivals: Arrivals in order of time; the keys on the form of the pulse are
            absent in a search with a template.
        threshold_snr_db: Detection threshold, maximum over all channels [dB].
        latency_s: Time from the first sample of a blast to its report, maximum over all
            channels.
        method: Search target.
        channels: The searched channels.
        dead_channels: Names of constant channels, which were skipped.
        arrays: Bangs at arrays, in a search with positions; the keys on the direction
            are absent without a common wave.
        other_sounds: Number of sounds above the threshold that do not have the form of
            a blast pulse, or have equally loud noise before them.
        rejected_arrivals: These sounds; with `--all-sounds` they are among the
            arrivals.
    """

    detected: bool
    arrivals: tuple[SoundArrival, ...]
    threshold_snr_db: float
    latency_s: float
    method: Mapping[str, Any]
    channels: tuple[SearchedChannel, ...]
    dead_channels: tuple[str, ...]
    arrays: tuple[ArrayAnswer, ...]
    other_sounds: int
    rejected_arrivals: tuple[SoundArrival, ...]


@dataclass(frozen=True)
class Arrival:
    """A flash, in short.

    Attributes:
        time_s: First light, since frame 0 or the first event.
        snr_db: Test statistic at the detection.
        sigma_s: Standard error of the time.
        pixel: Position of the burst, x and y [px].
        frame: First frame with the flash; for events the millisecond.
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
        silhouette: The silhouette.
    """

    silhouette: Silhouette = field(
        metadata=among("time_s", "radius_px", "x_px", "y_px", "cut")
    )


@dataclass(frozen=True)
class FlashSeen:
    """A flash, in full.

    Attributes:
        grown: First light, position and growth.
        alarm: First frame and alarm.
        direction: Direction from the camera; null without a scene.
        growth: Its silhouettes.
    """

    grown: Growth = field(
        metadata=among(
            *("time_s", "sigma_s", "x_px", "x_sigma_px", "y_px", "y_sigma_px"),
            *("radius_px", "radius_sigma_px", "growth_s", "growth_sigma_s"),
        )
    )
    alarm: Flash = field(metadata=among("frame", "alarm_s", "statistic"))
    direction: Direction | None
    growth: tuple[GrownTo, ...]


@dataclass(frozen=True)
class FlashAnswer(Document):
    """The answer of `jblast detect` for film.

    Attributes:
        detected: Whether a flash was detected.
        arrivals: Flashes in order of time.
        threshold_snr_db: The threshold, in the unit of `snr_db`.
        latency_s: Largest delay from first light to detection; without a flash the
            least possible one.
        method: Name of the test, accepted false alarms per hour in scenes that look
            like a blast, and threshold of the statistic.
        recording: The searched film.
        flashes: Each flash in full.
        warnings: Warnings, as sentences.
        sound_arrivals: Arrivals in the sound track of a video, from the first frame.
        bang_s: Time of the loudest arrival after the flash; null without one.
        candidates: Bright spots that are not reported as blasts, in order of time.
    """

    detected: bool
    arrivals: tuple[Arrival, ...]
    threshold_snr_db: float
    latency_s: float
    method: Mapping[str, Any]
    recording: Film
    flashes: tuple[FlashSeen, ...]
    warnings: tuple[str, ...]
    sound_arrivals: tuple[SoundArrival, ...] = ()
    bang_s: float | None = None
    candidates: tuple[Candidate, ...] = ()


@dataclass(frozen=True)
class ClipsAnswer(Document):
    """The answer of `jblast detect` for several videos.

    Attributes:
        detected: Whether any clip has a flash or a bang.
        clips: The answer for each clip.
    """

    detected: bool
    clips: tuple[FlashAnswer, ...]


def detect_answer(found: SoundDetections | FilmDetections | ClipDetections) -> Answer:
    """Return document, view and files of detections."""
    files: dict[str, Content] = {}
    log = found.log
    if isinstance(found, SoundDetections):
        document = _sound_document(found)
        view = _sound_view(found, document)
        files |= _filtered(found.searched)
        log = found.log and found.log.observations
    elif isinstance(found, ClipDetections):
        each = [_film_document(clip) for clip in found.clips]
        document = ClipsAnswer(found.detected, tuple(each))
        blocks: list[Block] = []
        for clip, one in zip(found.clips, each, strict=True):
            path = Path(clip.film.path)
            of = _film_view(clip, one, f"{path.stem}.{PICTURE}")
            blocks += [Lines("", [f"{path.name}: {of.title}"]), *of.blocks]
        view = View(f"{len(each)} clips", blocks)
    else:
        document = _film_document(found)
        view = _film_view(found, document, PICTURE)
    if isinstance(log, Observations) and len(log):
        files[LOG] = log_text(log)
    return Answer(document, view, files, code=0 if found.detected else NOT_FOUND)


def _filtered(searched: Sequence[Searched]) -> dict[str, Content]:
    """Return the filter output of channels of sound, one file a recording."""
    groups = [[*of] for _, of in groupby(searched, lambda one: one.channel.record)]
    found: dict[str, Content] = {}
    for members in groups:
        name = f"{Path(members[0].channel.record).stem}.{FILTERED}"
        outputs = np.array([one.statistic for one in members])
        # a sound file is written by its suffix, which a temporary file does not have
        with TemporaryDirectory() as folder:
            file = Path(folder, FILTERED)
            write_sound(file, outputs, members[0].channel.rate_hz)
            found[name if len(groups) > 1 else FILTERED] = file.read_bytes()
    return found


def _sound_document(found: SoundDetections) -> DetectionAnswer:
    searched, dead, target, log = found
    arrivals = _arrivals(searched)
    return DetectionAnswer(
        detected=bool(arrivals),
        arrivals=arrivals,
        threshold_snr_db=max(one.threshold_snr_db for one in searched),
        latency_s=max(one.latency_s for one in searched),
        method=target.keys,
        channels=tuple(
            filled(
                SearchedChannel, one.channel, one,
                channel=one.channel.number, seconds=_seconds(one),
            )
            for one in searched
        ),
        dead_channels=dead,
        arrays=tuple(map(_array, log.arrays)) if log else (),
        other_sounds=_other_sounds(searched),
        rejected_arrivals=_arrivals(searched, others=True),
    )  # fmt: skip


def _seconds(one: Searched) -> float:
    return one.channel.samples.size / one.channel.rate_hz


def _other_sounds(searched: Sequence[Searched]) -> int:
    """Return the number of sounds above the threshold that are no blasts."""
    sounds = [found for one in searched for found in one.detections + one.others]
    return sum(not found.is_blast for found in sounds)


def _arrivals(
    searched: Sequence[Searched], *, others: bool = False
) -> tuple[SoundArrival, ...]:
    """Return the arrivals of all channels, or the other sounds, in order of time."""
    arrivals = [
        SoundArrival(found, one.channel.number, one.channel.sensor, found.fit)
        for one in searched
        for found in (one.others if others else one.detections)
    ]
    return tuple(sorted(arrivals, key=lambda arrival: arrival.found.time_s))


def _array(finding: ArrayFinding) -> ArrayAnswer:
    came, direction = finding.direction, None
    if came is not None:
        bearing_sd, elevation_sd = came.covariance.diagonal() ** 0.5
        direction = filled(
            ArrayDirection, came,
            bearing_rad=came.bearing,
            bearing_sd_rad=bearing_sd,
            elevation_rad=came.elevation,
            elevation_sd_rad=elevation_sd,
            mirror_rad=came.mirror,
            p_plane_wave=finding.probability,
        )  # fmt: skip
    return ArrayAnswer(finding.array, finding.bang + 1, finding.used, direction)


ARRIVALS = [
    Column("sensor", lambda a: a.sensor),
    Column(
        "arrival [s]", lambda a: rounded(a.found.time_s, a.found.sigma_s), right=True
    ),
    Column("sigma [s]", lambda a: f"{a.found.sigma_s:.2g}", right=True),
    Column("SNR [dB]", lambda a: f"{a.found.snr_db:.1f}", right=True),
    Column("misfit", lambda a: f"{a.form.misfit:.2f}" if a.form else "", right=True),
    Column(
        "ln LR",
        lambda a: f"{a.form.log_likelihood_ratio:.1f}" if a.form else "",
        right=True,
    ),
]
ARRAYS = [
    Column("array", lambda one: one.array),
    Column("bang", lambda one: f"{one.bang}", right=True),
    Column("layout", lambda one: one.direction.layout if one.direction else "no wave"),
    Column("bearing [deg]", lambda one: _angle("bearing", one.direction), right=True),
    Column(
        "elevation [deg]", lambda one: _angle("elevation", one.direction), right=True
    ),
    Column(
        "p of a plane wave",
        lambda one: f"{one.direction.p_plane_wave:.2g}" if one.direction else "",
        right=True,
    ),
    Column("in the log", lambda one: "one row" if one.in_log else "a row each"),
]


def _angle(name: str, found: Any) -> str:
    """Return an angle with its standard error [degrees]; "" if not identified."""
    radians = getattr(found, f"{name}_rad", math.nan)
    if math.isnan(radians):
        return ""
    return _with_sd(
        math.degrees(radians), math.degrees(getattr(found, f"{name}_sd_rad"))
    )


def _delay(answer: DetectionAnswer | FlashAnswer) -> str:
    return printed_number("_s", answer.latency_s, 3)


def _with_sd(value: float, sd: float) -> str:
    return f"{rounded(value, sd)} ± {sd:.2g}"


def _sound_view(found: SoundDetections, answer: DetectionAnswer) -> View:
    searched, dead, target, log = found
    option = " (--all-sounds)" * bool(answer.rejected_arrivals)
    others = sentence(OTHERS, others=answer.other_sounds, option=option)
    title = sentence(
        "{arrivals:arrival} in {channels:channel}, {seconds:.6g} s of sound",
        arrivals=len(answer.arrivals),
        channels=len(searched),
        seconds=sum(one.seconds for one in answer.channels),
    )
    left_out = log.left_out if log else ()
    return View(
        title,
        [
            Table(ARRIVALS, answer.arrivals),
            Facts(
                [
                    ("search target", target.words),
                    ("threshold", f"{answer.threshold_snr_db:.1f} dB (2E/N0)"),
                    (
                        "delay",
                        f"{_delay(answer)} from the first sample",
                    ),
                    ("skipped", f"{joined(dead)}: constant" if dead else ""),
                ]
            ),
            Table(ARRAYS, answer.arrays, "Directions"),
            Lines(
                "",
                [
                    others * bool(answer.other_sounds),
                    *(
                        sentence(ECHO, sensor=sensor, arrival_s=one.time_s)
                        for sensor, one in left_out
                    ),
                ],
            ),
            Picture(
                PICTURE,
                partial(_sound_figure, searched),
                caption="Each recording above the output of its filter.",
                alt="Recordings and outputs of the filter with the arrivals",
            ),
        ],
    )


def _film_document(found: FilmDetections) -> FlashAnswer:
    watched, bang = found.flashes, found.bang
    late = [f.alarm_s - f.growth.time_s for f in watched.flashes]
    slow = (sentence(SLOW, rate=found.film.frames_hz),)
    return FlashAnswer(
        detected=found.detected,
        arrivals=tuple(
            filled(
                Arrival, one.growth, one,
                snr_db=in_decibels(one.statistic),
                pixel=(one.growth.x_px, one.growth.y_px),
            )
            for one in watched.flashes
        ),
        threshold_snr_db=in_decibels(watched.threshold),
        latency_s=max(late, default=watched.latency_s),
        method={
            "name": "growth_cusum",
            "false_alarms_per_hour": found.false_alarms_per_hour,
            "threshold": watched.threshold,
        },
        recording=found.film,
        flashes=tuple(
            FlashSeen(flash.growth, flash, to, tuple(map(GrownTo, flash.silhouettes)))
            for flash, to in zip_longest(watched.flashes, found.directions)
        ),
        warnings=slow * (found.film.frames_hz < SLOW_HZ) + found.notes,
        sound_arrivals=_arrivals(found.sound.searched) if found.sound else (),
        bang_s=None if bang is None else bang.time_s,
        candidates=watched.candidates,
    )  # fmt: skip


def _film_view(found: FilmDetections, answer: FlashAnswer, picture: str) -> View:
    film, blasts = answer.recording, answer.flashes
    title = sentence(
        "{blasts:blast} detected in {seconds:.6g} s of {kind}, {width} x {height} "
        "pixels at {frames_hz:g} Hz",
        film,
        blasts=len(blasts),
    )
    bang = "" if answer.bang_s is None else f"{answer.bang_s:.4f} s in the sound track"
    if answer.bang_s and blasts:
        later = answer.bang_s - answer.arrivals[0].time_s
        bang += f", {later:.4f} s after the first light"
    spots = sorted(answer.candidates, key=lambda one: -one.statistic)
    return View(
        title,
        [
            *(
                Facts(_flash(flash), f"Blast {number}" if len(blasts) > 1 else "")
                for number, flash in enumerate(blasts, 1)
            ),
            Facts(
                [
                    ("bang", bang),
                    ("search target", "a bright spot that grows in all directions"),
                    ("threshold", f"{answer.method['threshold']:.3g} (statistic)"),
                    (
                        "delay",
                        f"{_delay(answer)} from the first light",
                    ),
                ]
            ),
            Lines(
                "Other bright spots",
                [
                    sentence(SPOT, one, seconds=one.time_s, why=CAUSES[one.cause])
                    for one in spots
                ],
                most=MAX_LISTED,
            ),
            Lines("", [f"Warning: {warning}" for warning in answer.warnings]),
            Picture(
                picture,
                partial(_film_figure, found),
                caption="Each flash and its growth, above the statistic of the search.",
                alt="Flashes, their radii over time and the statistic of the search",
            ),
        ],
    )


def _flash(flash: FlashSeen) -> list[tuple[str, str]]:
    """Return the facts on a flash."""
    grown, seen_from = flash.grown, flash.direction
    direction = radius = ""
    if seen_from:
        angles = (_angle(name, seen_from) for name in ("bearing", "elevation"))
        direction = "bearing {}, elevation {} degrees".format(*angles)
    # both are identified, or none
    if grown.radius_px and grown.radius_sigma_px and grown.growth_s:
        radius = (
            f"{grown.radius_px:.1f} ± {grown.radius_sigma_px:.1f} px, time constant "
        )
        radius += (
            f"{_with_sd(1e3 * grown.growth_s, 1e3 * (grown.growth_sigma_s or 0))} ms"
        )
    return [
        (
            "first light",
            f"{_with_sd(grown.time_s, grown.sigma_s)} s, frame {flash.alarm.frame}",
        ),
        (
            "position",
            f"x {grown.x_px:.1f} ± {grown.x_sigma_px:.1f} px, "
            f"y {grown.y_px:.1f} ± {grown.y_sigma_px:.1f} px",
        ),
        ("direction", direction),
        ("radius", radius),
    ]


def _sound_figure(searched: Sequence[Searched]) -> "Figure":
    """Draw the recording of each channel above its filter output."""
    from jblast.report import figures as of

    shown = searched[:MAX_CHANNELS]
    figure = of.new_figure(10.0, 0.4 + 3.6 * len(shown))
    grid = figure.subplots(2 * len(shown), 1, sharex=True, squeeze=False)[:, 0]
    for one, above, below in zip(shown, grid[::2], grid[1::2], strict=True):
        rate = one.channel.rate_hz
        of.envelope(above, one.channel.samples, rate, colour=MUTED)
        of.envelope(below, one.statistic, rate)
        for found in one.detections:
            above.axvline(found.time_s, color=VERMILLION, linewidth=0.9, zorder=0)
            below.plot(found.time_s, found.statistic, "v", color=VERMILLION, ms=6)
        below.axhline(one.threshold, color=INK, linewidth=0.9, linestyle="--")
        of.quiet(above)
        of.quiet(below)
        above.set_ylabel("recording")
        below.set_ylabel("output [sigma]")
        note = f"dashed: threshold, {one.threshold_snr_db:.1f} dB"
        of.titled(above, one.channel.sensor, note)
    grid[-1].set_xlabel("time of the recording [s]")
    return figure


def _film_figure(found: FilmDetections) -> "Figure":
    """Draw each flash and its growth, and the statistic of the search below."""
    from jblast.report import figures as of

    watched = found.flashes
    shown = watched.flashes[:MAX_FLASHES]
    figure = of.new_figure(10.0, 2.4 + 3.4 * len(shown))
    ratios = [*([1.4] * len(shown)), 1.0]
    grid = figure.add_gridspec(len(shown) + 1, 2, height_ratios=ratios)
    axes = figure.add_subplot(grid[-1, :])
    for row, flash in enumerate(shown):
        _draw_flash(figure.add_subplot(grid[row, 0]), flash, found.film)
        _draw_growth(figure.add_subplot(grid[row, 1]), flash)
        axes.axvline(flash.growth.time_s, color=VERMILLION, linewidth=0.9, zorder=0)
    axes.plot(watched.times, watched.statistic, color=BLUE, linewidth=1.0)
    axes.axhline(watched.threshold, color=INK, linewidth=0.9, linestyle="--")
    axes.set(xlabel="time [s]", ylabel="statistic", ylim=(0, None))
    of.quiet(axes)
    of.titled(axes, "search", f"dashed: threshold, {watched.threshold:.1f}")
    return figure


def _draw_flash(axes: "Axes", flash: Flash, film: Film) -> None:
    from matplotlib.patches import Circle

    from jblast.report.figures import titled

    extent = (-0.5, film.width - 0.5, film.height - 0.5, -0.5)
    if flash.picture is not None:
        # linear light is drawn with the gamma of a display, 1 / 2.2
        shown = np.clip(flash.picture, 0.0, 1.0) ** 0.45
        axes.imshow(shown, cmap="gray", vmin=0.0, vmax=1.0, extent=extent)
    last = flash.silhouettes[:16][-1]
    middle = (last.x_px, flash.growth.y_px)
    axes.add_patch(Circle(middle, last.radius_px, fill=False, ec=VERMILLION))
    axes.set(xlim=extent[:2], ylim=extent[2:], aspect="equal")
    axes.set(xlabel="x [px]", ylabel="y [px]")
    late = 1e3 * (last.time_s - flash.growth.time_s)
    titled(axes, f"{late:.0f} ms after first light")


def _draw_growth(axes: "Axes", flash: Flash) -> None:
    from jblast.report.figures import quiet, titled

    grown = flash.growth
    for one in flash.silhouettes:
        face = "white" if one.cut else INK
        since = 1e3 * (one.time_s - grown.time_s)
        axes.plot(since, one.radius_px, "o", color=INK, mfc=face, ms=3)
    if grown.radius_px is not None and grown.growth_s is not None:
        fine = np.linspace(0.0, axes.get_xlim()[1], 200)
        law = -grown.radius_px * np.expm1(-1e-3 * fine / grown.growth_s)
        axes.plot(fine, law, color=BLUE, linewidth=1.2)
    axes.set(xlabel="since first light [ms]", ylabel="radius [px]", ylim=(0, None))
    quiet(axes)
    first = _with_sd(grown.time_s, grown.sigma_s)
    titled(axes, f"first light {first} s", "open: cut by an edge")
