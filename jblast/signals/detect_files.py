"""Blasts in recordings: sound, frames, video and camera events, as `jblast detect`.

`detect` recognises the kind of a recording. Sound is searched channel by channel with a
template, with the pulse of a charge, or with a bank of pulses; films are searched for a
flash that grows. Arrivals are rows of a log where the positions of the microphones, or
the camera of the scene, are given.
"""

import math
import os
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np

from jblast.errors import InputError, argument, check_declared
from jblast.kept_programs import kept_between_runs
from jblast.observations import Observations, observed
from jblast.observations.records.clips import VIDEOS, created, has_sound
from jblast.observations.records.formats import open_channels, open_record
from jblast.observations.records.sound import SoundRecord, read_sound, resampled
from jblast.observations.records.stations import START, Station, read_stations
from jblast.progress import Progress, counted, each, reported, stages
from jblast.scene import Camera, Scene, UncertainScene, scene_of
from jblast.signals.arrival_log import Log, log_of
from jblast.signals.detect_arguments import Kind, check_arguments, kind_of
from jblast.signals.detection import Detection
from jblast.signals.matched_filter import (
    FALSE_ALARMS_PER_HOUR,
)
from jblast.signals.picked_arrivals import picked_arrivals
from jblast.signals.pulse_fit import has_form
from jblast.signals.sound_watch import Channel, Searched, search
from jblast.signals.templates import DURATIONS, bank_of_pulses, blast_template

# sound does without the search of films
if TYPE_CHECKING:
    from jblast.signals.flash.fireball import Direction
    from jblast.signals.flash.search import FlashDetections

AnyPath = str | os.PathLike[str]
LOSSY_SD_S = 1e-3
"""Standard error of an arrival by the compression of a phone's sound [s]: transients
spread within a block of AAC, of 128 samples or 2.7 ms at 48 kHz."""
CLIP_SIGMAS = (
    "sigma of flash_time_s: that of first light in the picture, and the frame interval "
    "over sqrt(12) for the offset of sound and picture"
)
"""Comment of a log of clips, whose sigmas of flashes are larger than the printed
ones."""
LATE_US, PAUSE_US = 10**6, 60 * 10**6
"""First time of events [us] up to which they are on the clock of the film; later ones
are counted from the first event. Longest accepted time without an event [us]."""
USUAL_STEPS = (0.2, 0.2)
"""Thresholds of an event camera without a scene [ln of the light], those of `jblast
events`. A wrong value scales the changes of light, not the times of flashes."""


class Target(NamedTuple):
    """Search target of sound.

    Attributes:
        words: Its name in messages.
        keys: Its keys in a document.
        at_rate: Its templates at a sampling rate [Hz].
        is_sound: True for a template from a file.
        is_bank: True for a bank of pulses, with whose form arrivals are compared.
    """

    words: str
    keys: Mapping[str, Any]
    at_rate: Callable[[float], list[np.ndarray]]
    is_sound: bool = False
    is_bank: bool = False


class SoundDetections(NamedTuple):
    """Blasts in recordings of sound.

    Attributes:
        searched: Channels with their arrivals.
        dead: Names of constant channels, which were skipped.
        target: Search target.
        log: Rows of the arrivals; None without positions.
    """

    searched: tuple[Searched, ...]
    dead: tuple[str, ...]
    target: Target
    log: Log | None

    @property
    def detected(self) -> bool:
        """True if any channel has an arrival."""
        return any(one.detections for one in self.searched)


class Film(NamedTuple):
    """A searched film.

    Attributes:
        path: Folder or file.
        kind: Kind of the film.
        width: Width of the image [px].
        height: Height of the image [px].
        frames: Number of frames; for events of milliseconds.
        frames_hz: Frame rate [1/s].
        seconds: Length [s].
    """

    path: str
    kind: Literal["frames", "video", "events"]
    width: int
    height: int
    frames: int
    frames_hz: float
    seconds: float


class FilmDetections(NamedTuple):
    """Flashes in a film or in camera events.

    Attributes:
        flashes: The flashes, and other bright spots.
        film: The recording.
        false_alarms_per_hour: Rate of false alarms of the threshold.
        directions: Direction of each flash; empty without a scene.
        log: Rows of the flashes; of a video with `positions`, of the flash and the
            bang. None without a scene or positions.
        sound: Arrivals in the sound track of a video; None without one.
        notes: Warnings, a sentence each.
        own_clock: True for times by the clock of the file, which sound shares; False
            for those by a given frame rate.
    """

    flashes: "FlashDetections"
    film: Film
    false_alarms_per_hour: float
    directions: "Sequence[Direction]" = ()
    log: Observations | None = None
    sound: SoundDetections | None = None
    notes: tuple[str, ...] = ()
    own_clock: bool = True

    @property
    def detected(self) -> bool:
        """True if there is a flash, or an arrival in the sound track."""
        heard = self.sound is not None and self.sound.detected
        return bool(self.flashes.flashes) or heard

    @property
    def bang(self) -> Detection | None:
        """The loudest arrival after the flash; without a flash the loudest."""
        lit = [flash.growth.time_s for flash in self.flashes.flashes]
        searched = self.sound.searched if self.sound else ()
        heard = [found for one in searched for found in one.detections]
        later = [found for found in heard if not lit or found.time_s > min(lit)]
        return max(later, key=lambda found: found.statistic, default=None)


class ClipDetections(NamedTuple):
    """Flashes and bangs in several video clips, each on its own clock.

    Attributes:
        clips: Detections in each clip.
        log: Rows of all clips; None without positions.
    """

    clips: tuple[FilmDetections, ...]
    log: Observations | None

    @property
    def detected(self) -> bool:
        """True if any clip has a flash or a bang."""
        return any(clip.detected for clip in self.clips)


@kept_between_runs()
@reported("detect")
def detect(
    recordings: AnyPath | Sequence[AnyPath],
    *,
    template: AnyPath | None = None,
    mass_kg: float | None = None,
    range_m: float | None = None,
    false_alarms_per_hour: float = FALSE_ALARMS_PER_HOUR,
    all_sounds: bool = False,
    positions: AnyPath | None = None,
    fps: float | None = None,
    scene: Scene | UncertainScene | AnyPath | None = None,
    size: tuple[int, int] | None = None,
    progress: Progress = False,
) -> SoundDetections | FilmDetections | ClipDetections:
    """Find blasts in recordings of sound, in a film, in clips, or in camera events.

    Args:
        recordings: Sound files of one to eight channels; or a folder of PNG frames, a
            file of events, or one or more videos, whose sound tracks are searched, too.
        template: Sound file of one channel to search for; an arrival is the time of its
            first sample.
        mass_kg: TNT mass of a charge on the ground whose pulse is searched for.
        range_m: Its distance.
        false_alarms_per_hour: Accepted false alarms per channel; for films, by scenes
            that resemble a blast.
        all_sounds: In a search without a template or charge, accept impulsive sounds
            of any form.
        positions: Table of stations of the microphones, or of the clips.
        fps: Frame rate [Hz], required for a folder.
        scene: Scene, or its file, whose camera recorded the film.
        size: Width and height of camera events in a file that does not state them.
        progress: As for `jblast.fit`.

    Returns:
        Arrivals of sound, or flashes; for several videos, those of each.

    Raises:
        InputError: A recording cannot be read, an argument does not apply to its kind,
            or arguments exclude each other.

    Example:
        `jblast.detect(["a.wav", "b.wav"], positions="stations.csv").log.observations`
    """
    one = isinstance(recordings, str | os.PathLike)
    files = [os.fspath(f) for f in ([recordings] if one else recordings)]
    given = {
        **{"template": template, "mass_kg": mass_kg, "range_m": range_m},
        **{"all_sounds": all_sounds, "positions": positions},
        **{"fps": fps, "scene": scene, "size": size},
    }
    kind = check_arguments(files, given, _kind_of)
    assert kind is not None
    rate = {"false_alarms_per_hour": false_alarms_per_hour}
    film = partial(_detect_film, kind=kind, fps=fps, scene=scene, size=size, **rate)
    if kind in ("frames", "events"):
        return film(files[0])
    target = _target(template, mass_kg, range_m)
    listen = partial(_detect_sound, target=target, all_sounds=all_sounds, **rate)
    _check_stems(files)
    if kind == "sound":
        return listen(files, positions)
    table = None
    if positions is not None:
        table = _stations(positions, [(Path(f).stem, f) for f in files])
    clips = [_with_sound(film(file), listen) for file in each(files, "clips")]
    log = None if table is None else _clip_log(clips, table)
    if len(clips) == 1:
        return clips[0] if log is None else clips[0]._replace(log=log)
    return ClipDetections(tuple(clips), log)


def _with_sound(
    film: FilmDetections, listen: Callable[[Sequence[str]], SoundDetections]
) -> FilmDetections:
    """Return a clip with the arrivals in its sound track."""
    path, notes, sound = film.film.path, list(film.notes), None
    made = created(Path(path))
    if made is not None:
        notes.append(
            f"the clip states that it was created at {made}, of a phone the start of "
            f"the recording: jblast pick uses it as {START} in the table of positions"
        )
    if has_sound(Path(path)):
        unused = "the sound track was not searched"
        # frames of slow motion are not on the clock of the sound
        if not film.own_clock:
            notes.append(f"{unused}: its clock is not that of the given frame rate")
        else:
            try:
                sound = listen([path])
            except InputError as error:
                notes.append(f"{unused}: {error}")
    return film._replace(sound=sound, notes=tuple(notes))


def _clip_log(
    clips: Sequence[FilmDetections], stations: Mapping[str, Station]
) -> Observations:
    """Return the rows of the first flash and of the bang of each clip."""
    rows: list[tuple[str, str, float, float]] = []
    for clip in clips:
        name = Path(clip.film.path).stem
        for flash in clip.flashes.flashes[:1]:
            # the sigma of first light is that of its time in the picture, and includes
            # the frame interval if growth is not identified; sound and picture of a
            # phone are offset by about a frame, which is another, independent error
            offset_s = 1.0 / clip.film.frames_hz / math.sqrt(12)
            sigma = math.hypot(flash.growth.sigma_s, offset_s)
            rows.append((name, "flash_time_s", flash.growth.time_s, sigma))
        if (bang := clip.bang) is not None:
            rows.append((name, "air_arrival_s", bang.time_s, bang.sigma_s))
    names, quantity, value, sigma = zip(*rows, strict=True) if rows else ((),) * 4
    files = [Path(clip.film.path).name for clip in clips]
    return observed(
        names,
        quantity,
        value,
        sigma,
        position=np.reshape([stations[name].position for name in names], (-1, 3)),
        clock=tuple(stations[name].clock or name for name in names),
        comments=(
            *(f"jblast detect of {f}: flash and bang" for f in files),
            CLIP_SIGMAS,
        ),
        # one table has one frame
        frame=next(iter(stations.values())).frame,
    )


def _kind_of(path: Path) -> Kind:
    if (kind := kind_of(path)) is not None:
        return kind
    from jblast.sensors.camera.files.event_files import EVENT_FORMATS

    return "events" if path.suffix.lower() in EVENT_FORMATS else "sound"


def _detect_sound(
    files: Sequence[str],
    positions: AnyPath | None = None,
    *,
    target: Target,
    false_alarms_per_hour: float,
    all_sounds: bool,
) -> SoundDetections:
    """Find blasts in recordings of sound; arguments as for `detect`."""
    begin = stages({"reading": 1.0, "searching": 4.0})
    begin("reading")
    channels, dead = _channels(files)
    stations = None
    if positions is not None:
        stations = _stations(positions, [(one.sensor, one.record) for one in channels])
    begin("searching")
    # templates cost more than a search; most rates are equal
    at_rate = cache(target.at_rate)
    searched = []
    for channel in each(channels, "channels"):
        one = search(
            channel,
            at_rate(channel.rate_hz),
            false_alarms_per_hour=false_alarms_per_hour,
            forms=target.is_bank,
        )
        arrivals, others = one.detections, one.others
        lossy = Path(channel.record).suffix.lower() in VIDEOS
        if lossy:  # an encoder's echo before a front spoils the pick, not the form
            spoilt = [a for a in others if a.fit and has_form(a.fit)]
            arrivals = tuple(sorted([*arrivals, *spoilt]))
            others = tuple(a for a in others if a not in spoilt)
        if all_sounds:
            arrivals, others = tuple(sorted(arrivals + others)), ()
        # an arrival of a template is that of its first sample, perhaps no front; those
        # of a bank are picked already
        if not (target.is_sound or target.is_bank):
            arrivals = picked_arrivals(arrivals, channel.samples, channel.rate_hz)
        if lossy:
            arrivals = tuple(
                found._replace(sigma_s=math.hypot(found.sigma_s, LOSSY_SD_S))
                for found in arrivals
            )
        searched.append(one._replace(detections=arrivals, others=others))
    log = None
    if stations is not None:
        names = ", ".join(Path(file).name for file in files)
        log = log_of(searched, stations, [f"jblast detect of {names}: {target.words}"])
    return SoundDetections(tuple(searched), tuple(dead), target, log)


def _channels(files: Sequence[str]) -> tuple[list[Channel], list[str]]:
    """Read recordings; return their channels, and the names of constant ones.

    A constant channel is that of an unplugged microphone.

    Raises:
        InputError: A recording cannot be read, or every channel is constant.
    """
    alive: list[Channel] = []
    dead: list[str] = []
    for file in each(files, "recordings"):
        stem, sound = Path(file).stem, _sound(file)
        for number, samples in enumerate(sound.samples, start=1):
            name = stem if len(sound.samples) == 1 else f"{stem}.{number}"
            if not np.ptp(samples) > 0:
                dead.append(name)
                continue
            alive.append(Channel(name, file, number, samples, float(sound.rate_hz)))
    # constant channels alone leave nothing to search, which is an error and no result
    if not alive:
        raise InputError(
            f"{', '.join(files)}: expected sound, got one value throughout"
        )
    return alive, dead


def _check_stems(files: Sequence[str]) -> None:
    """Raise an error for recordings of one name, by which sensors are identified."""
    stems = [Path(file).stem for file in files]
    for file, stem in zip(files, stems, strict=True):
        if stems.count(stem) > 1:
            raise InputError(
                f"{file}: expected recordings with different names, got {stem} twice"
            )


def _sound(file: str) -> SoundRecord:
    """Read a sound file, or the sound track of a clip from its first frame on."""
    if Path(file).suffix.lower() not in VIDEOS:
        sound = read_sound(file)
        for note in sound.notes:
            warnings.warn(f"{file}: {note}", stacklevel=2)
        return sound
    (track,) = open_record(file)
    samples = track.samples(0, track.length)
    # silence before a late track keeps one time zero for sound and picture
    late = round(track.start_s * track.rate_hz)
    # a damaged file can state any start
    check_declared(file, 4 * max(late, 0) * len(samples))
    if -late >= track.length:
        raise InputError(
            f"{file}: expected sound with the picture, got sound that ends before the "
            "first frame"
        )
    samples = np.pad(samples[:, max(-late, 0) :], ((0, 0), (max(late, 0), 0)))
    return SoundRecord(samples, int(track.rate_hz))


def _stations(table: AnyPath, sensors: Sequence[tuple[str, str]]) -> dict[str, Station]:
    """Read the positions of microphones or clips.

    Args:
        table: Table of stations.
        sensors: Name and recording of each.

    Raises:
        InputError: The table cannot be read, lacks a sensor, or has start times.
    """
    file = os.fspath(table)
    stations = read_stations(file)
    if any(station.start is not None for station in stations.values()):
        raise InputError(
            f"{file}: column {START}: expected no values, as times of detect count "
            "from the start of each file; use jblast pick for start times"
        )
    for sensor, recording in sensors:
        if sensor not in stations:
            raise InputError(
                f"{file}: expected a station for {sensor} of {recording}, "
                f"got {', '.join(stations)}"
            )
    return stations


def _target(
    template: AnyPath | None, mass_kg: float | None, range_m: float | None
) -> Target:
    """Return the search target of the arguments.

    Raises:
        InputError: The template cannot be read, is constant, or has several channels.
    """
    if template:
        file = os.fspath(template)
        sound = _sound(file)
        if len(sound.samples) > 1:
            raise InputError(
                f"{file}: expected a template of one channel, got {len(sound.samples)}"
            )
        if not np.ptp(sound.samples) > 0:
            raise InputError(
                f"{file}: expected a template with a sound, got one value throughout"
            )
        return Target(
            f"the template {Path(file).name}",
            {"name": "matched_filter", "template": file},
            lambda rate_hz: [resampled(sound.samples[0], sound.rate_hz, rate_hz)],
            is_sound=True,
        )
    if mass_kg is not None and range_m is not None:
        return Target(
            f"the pulse of {mass_kg:g} kg of TNT at {range_m:g} m",
            {"name": "matched_filter", "charge_mass_kg": mass_kg, "range_m": range_m},
            lambda rate_hz: [blast_template(mass_kg, range_m, rate_hz)],
        )
    low, high = 1e3 * DURATIONS[0], 1e3 * DURATIONS[-1]
    return Target(
        f"a bank of {len(DURATIONS)} blast pulses of {low:.2g} to {high:.2g} ms",
        {"name": "bank_of_pulses", "durations_s": list(DURATIONS)},
        bank_of_pulses,
        is_bank=True,
    )


def _detect_film(
    path: str,
    *,
    kind: Kind,
    fps: float | None,
    scene: Scene | UncertainScene | AnyPath | None,
    size: tuple[int, int] | None,
    false_alarms_per_hour: float,
) -> FilmDetections:
    """Find flashes of blasts in a film or in camera events; arguments as for `detect`.

    Raises:
        InputError: The recording cannot be read, or contradicts the scene's camera.
    """
    from jblast.signals.flash.fireball import direction_of
    from jblast.signals.flash.search import detect_flashes, flash_threshold, log_of

    is_events, camera, source = kind == "events", None, ""
    if scene is not None:
        uncertain = scene_of(scene)
        camera, source = uncertain.scene.camera, uncertain.source or "scene"
        if camera is None:
            raise InputError(f"{source}: expected the [camera] of the film, got none")
    exposure_s = 0.0 if camera is None or is_events else float(camera.exposure_s)
    opened = (
        _events(path, camera, size) if is_events else _frames(path, fps, exposure_s)
    )
    blocks, film, notes, own_clock = opened
    pixels = film.width, film.height
    if camera is not None and pixels != (camera.width, camera.height):
        raise InputError(
            f"{source}: [camera]: expected {film.width} x {film.height} pixels "
            f"as in {path}, got {camera.width} x {camera.height}"
        )
    flashes = detect_flashes(
        blocks,
        film.frames_hz,
        flash_threshold(false_alarms_per_hour),
        changes=is_events,
        exposure_s=exposure_s,
    )
    found = FilmDetections(
        flashes, film, false_alarms_per_hour, notes=notes, own_clock=own_clock
    )
    if camera is None:
        return found
    comment = f"jblast detect of {Path(path).name}: first light, place and growth"
    return found._replace(
        directions=[direction_of(camera, flash.growth) for flash in flashes.flashes],
        log=log_of(flashes.flashes, camera, [comment]),
    )


_Opened = tuple[Iterator[Any], Film, tuple[str, ...], bool]
"""Blocks of images, the film, warnings, and `FilmDetections.own_clock`."""


def _frames(path: str, fps: float | None, exposure_s: float) -> _Opened:
    """Return blocks of frames, at the middle of their exposures."""
    from jblast.sensors.camera.files.recordings import open_recording

    if fps is None and Path(path).is_dir():
        raise InputError(
            f"{path}: expected {argument('fps')} HZ, as PNG frames have no frame rate; "
            "got none"
        )
    film = open_recording(path, fps, srgb=True, varying=True)
    if len(film) < 2:
        raise InputError(f"{path}: expected at least two frames, got {len(film)}")
    through = counted(len(film), "frames")

    def blocks() -> Iterator[Any]:
        done = 0
        for times, light in film.blocks():
            yield times + 0.5 * exposure_s, light
            done += len(times)
            through(done)

    shape = film.width, film.height, len(film)
    seconds = float(film.times[-1] - film.times[0])
    kind = "frames" if Path(path).is_dir() else "video"
    is_unused = fps is not None and film.varying
    note = (
        "the frame rate varies: times are the time stamps of the file, and the given "
        "rate is not used"
    )
    searched = Film(path, kind, *shape, float(film.frames_hz), seconds)
    return blocks(), searched, (note,) * is_unused, fps is None or is_unused


def _events(
    path: str,
    camera: Camera | None,
    size: tuple[int, int] | None,
) -> _Opened:
    """Return blocks of changes of light."""
    from jblast.sensors.camera.files.event_files import read_events
    from jblast.signals.flash.search import STEP_S, event_changes

    if size is None and camera is not None:
        size = camera.width, camera.height
    try:
        events = read_events(path, size=size)
    except InputError as error:
        # some suffixes are those of records of pressure, too
        try:
            open_channels(path)
        except InputError:
            raise error from None
        raise InputError(
            f"{path}: expected sound, a film or camera events, got a record of "
            "pressure; use jblast pick"
        ) from None
    if not len(events.t):
        raise InputError(f"{path}: expected events, got none")
    # times of a recorder may be those of the day, or begin below zero
    first = int(events.t[0]) if not 0 <= events.t[0] <= LATE_US else 0
    events = events._replace(t=events.t - first)
    notes = events.notes
    if first:
        notes += (
            f"times are counted from the first event, at {first / 1e6:.6f} s of the "
            "recorder's clock",
        )
    pauses = np.diff(events.t, prepend=0)
    longest = int(np.argmax(pauses))
    if pauses[longest] > PAUSE_US:
        raise InputError(
            f"{path}: event {longest}: expected at most {PAUSE_US / 1e6:g} s without "
            f"an event, got {pauses[longest] / 1e6:.6g} s; cut the file there"
        )
    threshold = USUAL_STEPS
    if camera is not None:
        brighter, darker = (float(step) for step in camera.threshold)
        threshold = brighter, darker
    last = int(events.t[-1])
    steps = last // round(1e6 * STEP_S) + 1
    shape = events.width, events.height, steps
    film = Film(path, "events", *shape, 1.0 / STEP_S, 1e-6 * last)
    return event_changes(events, threshold), film, notes, True
