"""Output files of `jblast world`: truth, perception, readings, flight, sound and film.

`run_world` draws a world and writes one sense after another. Sensors with sampling
options have their readings picked from their files (`world.picked`).
"""

import contextlib
import math
import os
import queue
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import Any, Generic, TypeVar

import numpy as np

from jblast.files import save_text, write_text, writing
from jblast.observations import Observations, write
from jblast.observations.records.formats import Scaling, open_record
from jblast.observations.records.recording import Recording
from jblast.progress import stages
from jblast.report.film_files import (
    FilmOutputs,
    cleared,
    sheet_frames,
    time_label,
    write_contact_sheet,
)
from jblast.report.fit.files import check_directory
from jblast.report.listen import (
    Recordings,
    SensorRecord,
    recordings_answer,
    truth_csv,
)
from jblast.report.listen_files import TRUTH, provenance, started_tracks
from jblast.report.provenance import provenance_of
from jblast.report.words import comma_separated, commented
from jblast.report.world import (
    FilmMade,
    ImuWritten,
    WorldRun,
    blasts_csv,
    detections_csv,
    perceived_csv,
    world_answer,
)
from jblast.scene import Sensor
from jblast.sensors.camera.events.ideal import Events
from jblast.sensors.camera.files.event_files import write_events
from jblast.sensors.camera.files.images import write_values
from jblast.sensors.camera.film import Film
from jblast.study.flight_tables import flight_csv
from jblast.study.run_detectors import RunDetectors
from jblast.study.running import (
    CameraEvents,
    Frames,
    Packet,
    Run,
    RunDetection,
    Subscriber,
    prepare_run,
    record_run,
)
from jblast.waves.fireball import fireball_duration
from jblast.world import DrawnWorld, ImuRecord, picked_jolts, readings_of
from jblast.world.picked import joined, picked_readings, sampled_sensors

Item = TypeVar("Item")
BLASTS, PERCEIVED, READINGS = "blasts.csv", "perceived.csv", "observations.csv"
FLIGHT, RUN, SOUND, CAMERA = "flight.csv", "run.json", "sound", "camera"
DETECTIONS = "detections.csv"
BEFORE = 2
"""Frames stored before each flash: the detector takes a difference of two."""
COLUMNS = (
    "time_s",
    *(f"a{axis}_m_s2" for axis in "xyz"),
    *(f"g{axis}_rad_s" for axis in "xyz"),
)
INTERPOLATED = (
    "its samples are interpolated linearly between the rows of the flight, {row:g} s "
    "apart"
)


def run_world(
    scene: str | os.PathLike[str],
    out: str | os.PathLike[str],
    *,
    seconds: float | None = None,
    seed: int = 0,
    estimator: str = "",
    controllers: Sequence[str] | None = None,
    detect: bool = False,
    watched: Callable[[Run], Sequence[Subscriber]] = lambda run: (),
    force: bool = False,
    command: Sequence[str] = (),
    begin: Callable[[str], object] | None = None,
) -> WorldRun:
    """Run a world of blasts, and write what its senses record of them.

    Args:
        scene: File of the scene, with [world] or [charge].
        out: Output directory.
        seconds: Duration; default: as in `study.running.prepare_run`.
        seed: Seed of all draws.
        estimator: "ekf" for control by a state estimate; "" for the true state.
        controllers: Names of controllers; the first one flies the recorded flight.
        detect: Whether detectors search sound and frames while they are recorded.
        watched: Returns further subscribers of the packets, such as a viewer.
        force: Whether an earlier run in the directory may be overwritten.
        command: Words for the provenance.
        begin: Called with the name of each stage; default: progress is reported.

    Returns:
        The world with perceptions and readings; on an error written files stay.

    Raises:
        InputError: The scene, an argument or the directory cannot be used.

    Example:
        `jblast.report.run_world("scene.toml", "run", seed=3)`
    """
    directory, source = Path(out), os.fspath(scene)
    check_directory(directory, force, "the world's run")
    begin = begin or stages({"flying": 6.0, "recording": 9.0})
    made = provenance_of((), source, tuple(command))
    begin("flying")
    run = prepare_run(
        source,
        seconds=seconds,
        seed=seed,
        estimator=estimator,
        controllers=controllers,
    )
    world = run.world
    head = [f"SIMULATED, not measured: {source}, seed {seed}"]
    begin("recording")
    with writing(directory):
        writer = FolderWriter(run, directory, head)
        detectors = None
        if detect:
            names = [charge.name for charge in world.scene.charges]
            detectors = RunDetectors(world.scene, run.arrivals, names)
        record_run(run, [writer, *watched(run)], detectors)
        imu, straight = write_imus(run.imus, directory, head)
    readings, late_readings, missed = _readings(run, writer)
    notes = [*run.notes, *straight, *_missed_words(missed)]
    notes += [
        f"{sensor.name}: no kind is specified, so it writes no samples"
        for sensor in world.scene.sensors
        if sensor.instrument is not None and not sensor.kind
    ]
    if run.unseen:
        notes.append(
            f"{len(run.unseen)} of {len(world.shots)} blasts are outside the camera's "
            "image: it does not perceive them"
        )
    if readings is not None:
        with writing(directory):
            write(directory / READINGS, readings, comments=head)
    came = WorldRun(
        run=run,
        readings=readings,
        late_readings=late_readings,
        made=made,
        sound=writer.sound,
        imu=imu,
        film=writer.film,
        detections=None if detectors is None else tuple(writer.detections),
        warnings=notes,
    )
    save_text(world_answer(came).to_json(), directory / RUN)
    return came


def _readings(run: Run, writer: "FolderWriter") -> tuple[Observations | None, int, int]:
    """Return the readings, and the numbers of late waves and of missing picks."""
    world, sound = run.world, writer.sound
    by_samples = () if sound is None else sampled_sensors(world)
    names = [sensor.name for sensor in by_samples]
    names += [one.sensor.name for one in run.imus if one.sensor.imu is not None]
    readings, late = readings_of(world, run.arrivals, run.seconds, names)
    jolts, missed = picked_jolts(world, run.arrivals, run.imus)
    readings = joined(readings, jolts)
    if sound is not None and by_samples:
        recordings = _recordings(sound, by_samples, writer.directory / SOUND)
        found = picked_readings(world, run.arrivals, recordings, sound.seconds)
        readings = joined(readings, found.readings)
        missed += found.missed
    return readings, late, missed


def _recordings(
    sound: Recordings, sensors: Sequence[Sensor], directory: Path
) -> dict[str, Recording]:
    """Open the files of sensors whose readings are picked."""
    recordings = {}
    for sensor in sensors:
        entry = sound.sensors[sensor.name]
        scaling = Scaling(entry.full_scale_pa, None)
        (recordings[sensor.name],) = open_record(directory / entry.file, scaling)
    return recordings


def _missed_words(missed: int) -> list[str]:
    """Return the sentence on picks that are not among the readings."""
    if not missed:
        return []
    return [
        f"{missed} air shocks at sampling sensors have no readings: no pick, or a poor "
        "one"
        if missed > 1
        else "one air shock at a sampling sensor has no reading: no pick, or a poor one"
    ]


class Fed(Generic[Item]):
    """A function of an iterator that runs in a thread of its own, fed item by item.

    The writers of files pull their input; here it is pushed. At most two items wait.
    """

    def __init__(self, consume: Callable[[Iterator[Item]], Any]):
        """Start the function."""
        self._items: queue.Queue[tuple[Item, ...]] = queue.Queue(2)
        self._pool = ThreadPoolExecutor(1)
        self._result = self._pool.submit(consume, self._pulled())

    def _pulled(self) -> Iterator[Item]:
        while one := self._items.get():
            yield one[0]

    def put(self, item: Item) -> None:
        """Pass an item; an error of the function is raised here."""
        self._give((item,))

    def _give(self, one: tuple[Item, ...]) -> None:
        # a function that has ended takes no more: waiting for it would last for ever
        while not self._result.done():
            with contextlib.suppress(queue.Full):
                return self._items.put(one, timeout=0.1)
        return self._result.result() if one else None

    def end(self) -> Any:
        """End the input, and return the result of the function."""
        self._give(())
        self._pool.shutdown()
        return self._result.result()


class FolderWriter:
    """Writer of a run's files: a subscriber of its packets.

    Attributes:
        directory: The folder.
        sound: The records of samples, after the end; None without any.
        film: The film, after the end; None without a camera.
        detections: Detections so far.
    """

    def __init__(self, run: Run, directory: Path, head: Sequence[str]):
        """Write all tables that are known before the first packet.

        Args:
            run: The run.
            directory: The folder.
            head: Comments above each table.
        """
        self.directory, self._run, self._head = directory, run, head
        self.sound: Recordings | None = None
        self.film: FilmMade | None = None
        self.detections: list[RunDetection] = []
        directory.mkdir(parents=True, exist_ok=True)
        # tables of an earlier run next to new ones would mislead
        names = (BLASTS, PERCEIVED, READINGS, FLIGHT, RUN, DETECTIONS)
        stale = [directory / name for name in names]
        for file in (*stale, *directory.glob("imu*.csv")):
            file.unlink(missing_ok=True)
        save_text(blasts_csv(run.world, head), directory / BLASTS)
        if run.flown is not None:
            save_text(flight_csv(run.flown), directory / FLIGHT)
        clock = "times are on the common clock, of the laws, without errors"
        table = perceived_csv(run.perceived, [*head, clock])
        save_text(table, directory / PERCEIVED)
        self._records: dict[str, SensorRecord] = {}
        self._fed: dict[str, Fed[np.ndarray]] = {}
        if run.listening is not None:
            listening = run.listening
            comments = provenance(listening, run.world.source, run.world.seed)
            for record, write in started_tracks(listening, directory / SOUND, comments):
                self._records[record.sensor.name] = record
                self._fed[record.sensor.name] = Fed(write)

        self._film = None
        if run.film is not None:
            self._film = FilmFiles(run, run.film, directory / CAMERA)

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
        run = self._run
        for fed in self._fed.values():
            fed.end()
        if run.listening is not None:
            records, folder = [*self._records.values()], self.directory / SOUND
            comments = provenance(run.listening, run.world.source, run.world.seed)
            write_text(folder / TRUTH, truth_csv(run.listening, records, comments))
            self.sound = recordings_answer(run.listening, records)
        if self.detections:
            table = detections_csv(self.detections, self._head)
            save_text(table, self.directory / DETECTIONS)
        if self._film is not None:
            self.film = self._film.finish()


class FilmFiles:
    """Writer of the frames and camera events of a run.

    Of the frames only those with a fireball, and the two before, are stored.
    """

    def __init__(self, run: Run, film: Film, directory: Path):
        """Create the folder, and remove files of an earlier run."""
        self._film, self._directory = film, directory
        self._hz = float(film.camera.frames_hz)
        self._outputs = FilmOutputs(directory, "both", ".h5", None, self._hz)
        cleared(self._outputs, force=True)
        numbers = _frames(run.world, len(film.times), self._hz).tolist()
        self._places = {number: place for place, number in enumerate(numbers)}
        self._times = film.times[numbers]
        bursts = [float(charge.time_s) for charge in film.scene.charges]
        self._wanted = {*sheet_frames(self._times, bursts)}
        self._shown: dict[int, np.ndarray] = {}
        self._pool = ThreadPoolExecutor(os.cpu_count())
        self._written: list[Future[None]] = []
        size = film.camera.width, film.camera.height
        lasts = float(film.times[-1])
        self._events: Fed[Events] = Fed(
            lambda blocks: write_events(
                self._outputs.events, blocks, *size, duration_s=lasts
            )
        )

    def take(self, frames: Frames, events: CameraEvents) -> None:
        """Write the frames and events of a packet."""
        for future in self._written:
            future.result()
        self._written = []
        for time, image in zip(frames.time_s, frames.images, strict=True):
            place = self._places.get(round(float(time) * self._hz))
            if place is None:
                continue
            path = self._outputs.frames / self._name(place)
            self._written.append(self._pool.submit(write_values, path, image))
            if place in self._wanted:
                self._shown[place] = image
        count, lost = np.asarray(events.time_s.size), np.asarray(0)
        columns = events.x, events.y, events.time_s, events.polarity
        self._events.put(Events(*columns, count, lost))

    def _name(self, place: int) -> str:
        return f"{place:0{max(4, len(str(len(self._times) - 1)))}}.png"

    def finish(self) -> FilmMade:
        """Complete the files."""
        self._pool.shutdown()
        written = self._events.end()
        film, camera = self._film, self._film.camera
        first = min(float(charge.time_s) for charge in film.scene.charges)
        places = sorted(self._shown)
        labels = [time_label(float(self._times[n]) - first) for n in places]
        shown = [self._shown[n] for n in places]
        write_contact_sheet(self._outputs.sheet, shown, labels)
        rows = [["file", "time_s"]]
        rows += [[self._name(n), f"{t:.12g}"] for n, t in enumerate(self._times)]
        write_text(self._directory / "frames.csv", comma_separated(rows))
        return FilmMade(
            frames=len(self._times),
            width=camera.width,
            height=camera.height,
            written=written,
            stamps="interpolated",
            stamp_error_s=1.0 / self._hz,
        )


def _frames(world: DrawnWorld, count: int, hz: float) -> np.ndarray:
    """Return the numbers of the stored frames, counted from 0 at 0 s."""
    kept = {0, 1}
    for charge in world.charges:
        begin = float(charge.time_s)
        life = float(fireball_duration(charge.tnt_mass("fireball_radius_m")))
        first = max(math.floor(begin * hz) - BEFORE, 0)
        kept |= set(range(first, math.ceil((begin + life) * hz) + 1))
    return np.array(sorted(number for number in kept if number < count))


def write_imus(
    records: Sequence[ImuRecord], directory: Path, head: Sequence[str]
) -> tuple[dict[str, ImuWritten] | None, list[str]]:
    """Write the samples of every unit; return their entries and warnings.

    Args:
        records: Records of the units.
        directory: Folder of the run.
        head: Comments above each table.
    """
    entries: dict[str, ImuWritten] = {}
    notes = []
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
        text = [COLUMNS, *([f"{x:.9g}" for x in row] for row in rows.tolist())]
        save_text(commented(comments) + comma_separated(text), directory / file)
        entries[name] = ImuWritten(file, rate, len(rows), record.clipped)
        if record.row_s > 1.5 / rate:
            notes.append(f"{name}: {INTERPOLATED.format(row=record.row_s)}")
    return entries or None, notes
