"""Files of a run: blasts, perceptions, readings, records of sensors, and film.

`record_files` passes the packets of a run to a writer and to further subscribers.
Sensors with sampling options have their readings picked from their finished files
(`world.picked`).
"""

import contextlib
import os
import queue
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Generic, Literal, TypeVar

import numpy as np
from jaxtyping import Int

from jblast.files import save, table_text, write_text, writing
from jblast.observations import Observations, write
from jblast.observations.records.formats import Scaling, open_record
from jblast.results import AMONG
from jblast.sensors.camera.explosion import shown_for_s
from jblast.sensors.camera.files.event_files import Written, write_events
from jblast.sensors.camera.files.images import write_values
from jblast.sensors.camera.film import RUN_ERROR, Film
from jblast.sensors.camera.film_writer import (
    clear_film,
    film_files,
    frame_name,
    sheet_frames,
    write_contact_sheet,
)
from jblast.sensors.camera.pixel import Events
from jblast.sensors.record_writer import (
    TRUTH,
    RecordWriter,
    record_comments,
    record_writers,
    truth_csv,
)
from jblast.study.flight_tables import flight_csv
from jblast.study.run_detectors import RunDetectors
from jblast.study.running import (
    CameraEvents,
    Frames,
    Packet,
    Run,
    RunDetection,
    Subscriber,
    record_run,
)
from jblast.world import DrawnWorld, ImuRecord, picked_jolts, readings_of
from jblast.world.drawn import CAMERA
from jblast.world.perceived import camera_path
from jblast.world.picked import (
    Reading,
    picked_readings,
    sampled_sensors,
    with_picked,
)

Item = TypeVar("Item")
BLASTS, PERCEIVED, READINGS = "blasts.csv", "perceived.csv", "observations.csv"
FLIGHT, DETECTIONS, SOUND, FILM = "flight.csv", "detections.csv", "sound", "camera"
BEFORE = 2
"""Frames stored before each flash: the detector takes a difference of two."""
SEARCHED = {("microphone", "sound"), (CAMERA, "flash")}
"""Kinds of sensors and senses that the detectors of a run search."""


@dataclass(frozen=True)
class BlastDrawn:
    """A blast of the world.

    Attributes:
        shot: Name of the charge; for a random one the number of its draw.
        time_s: Time of detonation on the common clock.
        position_m: East, north, up.
        mass_kg: Mass of the charge.
    """

    shot: str
    time_s: float
    position_m: tuple[float, float, float]
    mass_kg: float


@dataclass(frozen=True)
class ImuWritten:
    """Record of an inertial measurement unit.

    Attributes:
        file: Its table, in the folder of the run.
        rate_hz: Sampling rate [1/s].
        samples: Number of samples.
        clipped: Whether a sample is clipped.
    """

    file: str
    rate_hz: float
    samples: int
    clipped: bool


@dataclass(frozen=True)
class FilmMade:
    """Film of a world's camera.

    Attributes:
        frames: Number of stored frames: those with a fireball in view, or all.
        filmed: Number of frames of the film.
        width: Width of a frame [px].
        height: Height of a frame [px].
        written: Numbers of events.
        stamps: Computation of the events' times.
        stamp_error_s: Bound of the error of 99 % of the times.
    """

    frames: int
    filmed: int
    width: int
    height: int
    written: Written = field(metadata=AMONG)
    stamps: Literal["interpolated"]
    stamp_error_s: float


@dataclass(frozen=True)
class Detections:
    """Blasts that the detectors of a run reported while it was recorded.

    Attributes:
        detected: Number of detected waves and flashes.
        false_alarms: Number of detections without a wave or flash.
        missed: Number of perceived flashes and air shocks at searched sensors without a
            detection.
        median_latency_s: Median delay after the wave reached the sensor; null without a
            detection.
        max_latency_s: Longest such delay.
    """

    detected: int
    false_alarms: int
    missed: int
    median_latency_s: float | None
    max_latency_s: float | None


@dataclass(frozen=True)
class RecordedRun:
    """A run with what was written of it.

    Attributes:
        run: The run.
        readings: Readings of the sensors; None without any.
        records: Records of the sampling sensors.
        imu: Record of each inertial measurement unit; None without one.
        camera: Film of the camera; None without one.
        detections: Summary of the detections; None without detectors.
        warnings: Warnings on the use of the run, as sentences.
    """

    run: Run
    readings: Observations | None
    records: tuple[RecordWriter, ...]
    imu: Mapping[str, ImuWritten] | None
    camera: FilmMade | None
    detections: Detections | None
    warnings: tuple[str, ...]

    @property
    def world(self) -> DrawnWorld:
        """The sampled world."""
        return self.run.world


def record_files(
    run: Run,
    directory: Path,
    *,
    detect: bool = False,
    every_frame: bool = False,
    watched: Sequence[Subscriber] = (),
) -> RecordedRun:
    """Record a run, and write its files; on an error the written ones stay.

    Args:
        run: The run.
        directory: Folder of the files; tables of an earlier run are removed.
        detect: Whether detectors search sound and frames while they are recorded.
        every_frame: Whether frames without a fireball in view are stored, too.
        watched: Further subscribers of the packets.

    Raises:
        InputError: A record cannot be made, or a file cannot be written.
    """
    world, head = run.world, run_comments(run.world)
    with writing(directory):
        writer = RunWriter(run, directory, every_frame=every_frame)
        detectors = None
        if detect:
            names = [charge.name for charge in world.scene.charges]
            path = None if run.flight is None else camera_path(run.flight)
            detectors = RunDetectors(world.scene, run.arrivals, names, path=path)
        record_run(run, [writer, *watched], detectors)
        imu = _write_imus(run.imus, directory, head)
        readings, more = _readings(run, writer, directory / SOUND)
        if readings is not None:
            write(directory / READINGS, readings, comments=head)
    return RecordedRun(
        run=run,
        readings=readings,
        records=tuple(writer.records),
        imu=imu,
        camera=writer.film,
        detections=summary_of(run, writer.detections) if detect else None,
        warnings=(*run.notes, *more),
    )


def earlier_tables(directory: Path) -> list[Path]:
    """Return the tables of an earlier run that a new one may not have."""
    named = [directory / name for name in (READINGS, FLIGHT, DETECTIONS)]
    named += [directory / "imu.csv", *directory.glob("imu_*.csv")]
    return [file for file in named if file.exists()]


def run_comments(world: DrawnWorld) -> list[str]:
    """Return the provenance of a world, for the comments of every table."""
    return [f"SIMULATED, not measured: {world.source}, seed {world.seed}"]


def _readings(
    run: Run, writer: "RunWriter", directory: Path
) -> tuple[Observations | None, list[str]]:
    """Return the readings, picked and detected ones among them, and warnings."""
    world, records = run.world, writer.records
    sampled = sampled_sensors(world) if records else ()
    names = [sensor.name for sensor in sampled]
    names += [one.sensor.name for one in run.imus if one.sensor.imu is not None]
    readings, late = readings_of(world, run.arrivals, run.seconds, names)
    rows, missed = picked_jolts(world, run.arrivals, run.imus)
    rows += _flashes(run, writer.detections)
    if run.listening is not None and sampled:
        of = {record.sensor.name: record for record in records}
        recordings = {}
        for name in [sensor.name for sensor in sampled]:
            scaling = Scaling(of[name].full_scale_pa, None)
            (recordings[name],) = open_record(directory / of[name].file, scaling)
        seconds = run.listening.seconds
        picks, poor = picked_readings(world, run.arrivals, recordings, seconds)
        rows, missed = rows + picks, missed + poor
    readings = with_picked(readings, rows)
    return readings, [*_warnings(run, readings is None, late, missed)]


def _flashes(run: Run, found: Sequence[RunDetection]) -> list[Reading]:
    """Return time and direction of each detected flash."""
    rows: list[Reading] = []
    names = [charge.name for charge in run.world.scene.charges]
    for one in found:
        if one.kind == "flash" and one.shot:
            values = {"flash_time_s": (one.time_s, one.sigma_s)}
            if one.direction is not None:
                values |= {"bearing_rad": one.direction[:2]}
                values |= {"elevation_rad": one.direction[2:]}
            row = run.arrivals.entities.index(CAMERA), names.index(one.shot)
            place = run.arrivals.places_m["flash_time_s"][row]
            rows += [Reading(CAMERA, q, *x, one.shot, place) for q, x in values.items()]
    return rows


def _warnings(run: Run, no_readings: bool, late: int, missed: int) -> Iterator[str]:
    """Yield warnings on the use of a run and of its readings."""
    shots = len(run.world.shots)
    for sensor in run.world.scene.sensors:
        if sensor.instrument is not None and not sensor.kind:
            yield f"{sensor.name}: no kind is specified, so it writes no samples"
    if not shots:
        yield "no blast was sampled"
    if no_readings and shots:
        yield "no sensor has records, so there is no observations.csv"
    numbers = {
        "air shocks at sampling sensors, without or with a poor pick": missed,
        f"blasts outside the camera's image, of {shots}": len(run.unseen),
        f"perceptions after the end at {run.seconds:g} s": run.late,
        "waves at sensors after the end, without readings": late,
    }
    yield from (f"{what}: {number}" for what, number in numbers.items() if number)


class Fed(Generic[Item]):
    """A function of an iterator that runs in a thread of its own, fed item by item.

    The writers of files pull their input; here it is pushed. At most two items wait.
    """

    def __init__(self, consume: Callable[[Iterator[Item]], Any]):
        """Start the function."""
        self._items: queue.Queue[Item | None] = queue.Queue(2)
        self._pool = ThreadPoolExecutor(1)
        self._result = self._pool.submit(consume, self._pulled())

    def _pulled(self) -> Iterator[Item]:
        while (item := self._items.get()) is not None:
            yield item

    def put(self, item: Item | None) -> None:
        """Pass an item, or None at the end; an error of the function is raised here."""
        # a function that has ended takes no more: waiting for it would last for ever
        while not self._result.done():
            with contextlib.suppress(queue.Full):
                return self._items.put(item, timeout=0.1)
        return self._result.result()

    def end(self) -> Any:
        """End the input, and return the result of the function."""
        self.put(None)
        self._pool.shutdown()
        return self._result.result()


class RunWriter:
    """Writer of a run's files: a subscriber of its packets.

    Attributes:
        records: Records of the sampling sensors.
        film: The film, after the end; None without a camera.
        detections: Detections so far.
    """

    def __init__(self, run: Run, directory: Path, *, every_frame: bool = False):
        """Write all tables that are known before the first packet."""
        self.directory, self._run, head = directory, run, run_comments(run.world)
        self.detections: list[RunDetection] = []
        directory.mkdir(parents=True, exist_ok=True)
        # next to new tables they would mislead
        for file in earlier_tables(directory):
            file.unlink()
        save(directory / BLASTS, blasts_csv(run.world, head))
        clock = "times are on the common clock, of the laws, without errors"
        columns = ("shot", "entity", "sense", "time_s")
        save(directory / PERCEIVED, _csv(run.perceived, columns, [*head, clock]))
        if run.flown is not None:
            save(directory / FLIGHT, flight_csv(run.flown))
        self.records: list[RecordWriter] = []
        if run.listening is not None:
            self._comments = record_comments(
                run.listening, run.world.source, run.world.seed
            )
            self.records = record_writers(
                run.listening, directory / SOUND, self._comments
            )
        self._fed = {one.sensor.name: Fed(one.write) for one in self.records}
        self._film = None
        if run.film is not None:
            stored = np.arange(len(run.film.times))
            if not every_frame:
                stored = frames_in_view(run, run.film)
            self._film = _FilmOfRun(run.film, stored, directory / FILM)
        self.film: FilmMade | None = None

    def take(self, packet: Packet) -> None:
        """Write the samples and images of a packet."""
        for name, fed in self._fed.items():
            if name in packet.samples:
                fed.put(packet.samples[name].values)
        if self._film is not None and packet.frames and packet.events:
            self._film.take(packet.frames, packet.events)
        self.detections += packet.detections

    def finish(self) -> None:
        """Complete the files."""
        for fed in self._fed.values():
            fed.end()
        if self._run.listening is not None:
            table = truth_csv(self._run.listening, self.records, self._comments)
            write_text(self.directory / SOUND / TRUTH, table)
        if self.detections:
            columns = ("sensor", "kind", "shot", "time_s", "sigma_s", "reported_s")
            columns += ("latency_s", "statistic")
            table = _csv(self.detections, columns, run_comments(self._run.world))
            save(self.directory / DETECTIONS, table)
        if self._film is not None:
            self.film = self._film.finish()


class _FilmOfRun:
    """Writer of the frames and camera events of a run."""

    def __init__(self, film: Film, stored: Int[np.ndarray, " frame"], directory: Path):
        """Create the folder, and remove files of an earlier run.

        Args:
            film: The film.
            stored: Numbers of the frames that are stored, counted from 0 at 0 s.
            directory: Folder of the film.
        """
        self._camera, self._hz = film.camera, float(film.camera.frames_hz)
        self._files = film_files(directory)
        clear_film(self._files, force=True)
        self._filmed = len(film.times)
        self._places = {number: n for n, number in enumerate(stored.tolist())}
        self._times = film.times[stored]
        bursts = [float(charge.time_s) for charge in film.scene.charges]
        self._first = min(bursts)
        self._wanted = {*sheet_frames(self._times, bursts)}
        self._shown: dict[float, np.ndarray] = {}
        self._pool = ThreadPoolExecutor(os.cpu_count())
        path, lasts = directory / "events.h5", float(film.times[-1])
        size = film.camera.width, film.camera.height
        self._events: Fed[Events] = Fed(
            lambda blocks: write_events(path, blocks, *size, duration_s=lasts)
        )

    def take(self, frames: Frames, events: CameraEvents) -> None:
        """Write the frames and events of a packet."""
        numbers = [round(time * self._hz) for time in frames.time_s.tolist()]
        images = {
            self._places[number]: frames.images[n]
            for n, number in enumerate(numbers)
            if number in self._places
        }
        paths = [Path(self._files.frames or "") / self._name(n) for n in images]
        # consumed, so that an error of writing is raised
        list(self._pool.map(write_values, paths, images.values()))
        for place in self._wanted & images.keys():
            self._shown[self._times[place] - self._first] = images[place]
        count, lost = np.asarray(events.time_s.size), np.asarray(0)
        columns = events.x, events.y, events.time_s, events.polarity
        self._events.put(Events(*columns, count, lost))

    def _name(self, place: int) -> str:
        return frame_name(place, len(self._times))

    def finish(self) -> FilmMade:
        """Complete the files."""
        self._pool.shutdown()
        written = self._events.end()
        shown = dict(sorted(self._shown.items()))
        write_contact_sheet(self._files.contact_sheet, shown)
        rows = [["file", "time_s"]]
        rows += [[self._name(n), f"{t:.12g}"] for n, t in enumerate(self._times)]
        table = Path(self._files.contact_sheet).with_name("frames.csv")
        write_text(table, table_text(rows))
        return FilmMade(
            frames=len(self._times),
            filmed=self._filmed,
            width=self._camera.width,
            height=self._camera.height,
            written=written,
            stamps="interpolated",
            stamp_error_s=RUN_ERROR,
        )


def frames_in_view(run: Run, film: Film) -> Int[np.ndarray, " frame"]:
    """Return the numbers of the frames with a fireball in view, and some before.

    The first two are stored in any case, so that each film has a frame.
    """
    hz, numbers = float(film.camera.frames_hz), np.arange(len(film.times))
    kept = numbers < BEFORE
    for charge in run.world.charges:
        if charge.name not in run.unseen:
            life = shown_for_s(charge, film.views)
            since = numbers - float(charge.time_s) * hz
            kept |= (since > -1 - BEFORE) & (since < life * hz + 1)
    return np.flatnonzero(kept)


def _write_imus(
    records: Sequence[ImuRecord], directory: Path, head: Sequence[str]
) -> dict[str, ImuWritten] | None:
    """Write the samples of every unit; return their entries."""
    entries: dict[str, ImuWritten] = {}
    columns = [f"a{axis}_m_s2" for axis in "xyz"] + [f"g{axis}_rad_s" for axis in "xyz"]
    for record in records:
        name, rate = record.sensor.name, record.imu.rate
        file = "imu.csv" if len(records) == 1 else f"imu_{name}.csv"
        rows = np.column_stack(
            [record.stamps_s, record.samples.force, record.samples.rate]
        )
        comments = [
            *head,
            f"{name}: {rate:g} Hz, each row the mean from its time stamp on, on its "
            "own clock; specific force and body rates along its own axes",
        ]
        cells = ([f"{x:.9g}" for x in row] for row in rows.tolist())
        table = table_text([["time_s", *columns], *cells], comments)
        save(directory / file, table)
        entries[name] = ImuWritten(file, rate, len(rows), record.clipped)
    return entries or None


def summary_of(run: Run, found: Sequence[RunDetection]) -> Detections:
    """Return the summary of the detections of a run."""
    real = [one for one in found if one.shot]
    known = {(one.sensor, one.shot) for one in real}
    # sensors that are searched: those of the microphones, and the camera
    kinds = {s.name: s.kind for s in run.world.scene.sensors} | {CAMERA: CAMERA}
    sought = {
        (one.entity, one.shot)
        for one in run.perceived
        if (kinds.get(one.entity), one.sense) in SEARCHED
    }
    delays = sorted(one.latency_s for one in real)
    return Detections(
        detected=len(known),
        false_alarms=len(found) - len(real),
        missed=len(sought - known),
        median_latency_s=float(np.median(delays)) if delays else None,
        max_latency_s=delays[-1] if delays else None,
    )


def drawn_blasts(world: DrawnWorld) -> tuple[BlastDrawn, ...]:
    """Return the blasts of a world in order of time."""
    return tuple(
        BlastDrawn(charge.name, float(charge.time_s), (east, north, up), mass)
        for charge in world.charges
        for mass, east, north, up in [
            map(float, (charge.mass_kg, *np.asarray(charge.position_m)))
        ]
    )


def blasts_csv(world: DrawnWorld, comments: Sequence[str]) -> str:
    """Return a row for each blast, in order of time, with 12 digits."""
    rows = [["shot", "time_s", "east_m", "north_m", "up_m", "mass_kg"]]
    for one in drawn_blasts(world):
        numbers = (one.time_s, *one.position_m, one.mass_kg)
        rows.append([one.shot, *(f"{x:.12g}" for x in numbers)])
    return table_text(rows, comments)


def _csv(rows: Iterable[Any], columns: Sequence[str], comments: Sequence[str]) -> str:
    """Return attributes of results as a table, numbers with 12 digits."""
    cells = ([getattr(row, name) for name in columns] for row in rows)
    shown = ([x if isinstance(x, str) else f"{x:.12g}" for x in row] for row in cells)
    return table_text([columns, *shown], comments)
