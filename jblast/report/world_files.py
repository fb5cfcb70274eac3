"""Output files of `jblast world`: truth, perception, readings, flight, sound and film.

`run_world` draws a world and writes one sense after another. Sensors with sampling
options have their readings picked from their files (`world.picked_records`).
"""

import math
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from jblast.files import save_text, write_text, writing
from jblast.observations import write
from jblast.observations.records.formats import Scaling, open_record
from jblast.observations.records.recording import Recording
from jblast.progress import stages
from jblast.report.film_files import FilmOutputs, FilmWriter, cleared
from jblast.report.fit.files import check_directory
from jblast.report.flight_files import flight_csv
from jblast.report.flights import flights_answer
from jblast.report.listen import Recordings, recordings_answer
from jblast.report.listen_files import provenance, write_tracks
from jblast.report.provenance import provenance_of
from jblast.report.words import comma_separated, commented
from jblast.report.world import (
    FilmMade,
    ImuWritten,
    WorldRun,
    blasts_csv,
    perceived_csv,
    preset_words,
    world_answer,
)
from jblast.scene import Sensor, UncertainScene
from jblast.scene.sensor_kinds import sampling_kinds
from jblast.sensors import Track
from jblast.sensors.camera import landscape
from jblast.sensors.camera.film import Film
from jblast.sensors.camera.geometry import CameraPath
from jblast.sensors.camera.image import BACKGROUND
from jblast.sensors.listening import plan, with_ambient
from jblast.study.flight_results import Encounter, Flights, Options, trajectory_of
from jblast.study.flights import fly
from jblast.vehicle import Trajectory
from jblast.waves.fireball import fireball_duration
from jblast.world import (
    Arrivals,
    DrawnWorld,
    ImuRecord,
    arrivals_in,
    draw_world,
    imu_records,
    perceived,
    picked_jolts,
    preset_named,
    read_world_by,
    readings_of,
    tracks_of,
    with_nevers,
)
from jblast.world.perceived import out_of_view
from jblast.world.picked_records import joined, picked_readings, sampled_sensors

BLASTS, PERCEIVED, READINGS = "blasts.csv", "perceived.csv", "observations.csv"
FLIGHT, RUN, SOUND, CAMERA = "flight.csv", "run.json", "sound", "camera"
AFTER_S, AFTER_FLIGHT_S = 0.5, 5.0
"""Duration after the last wave [s] without and with a vehicle, which needs time to
recover."""
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
    preset: str | None = None,
    force: bool = False,
    command: Sequence[str] = (),
    begin: Callable[[str], object] | None = None,
) -> WorldRun:
    """Draw a world of random blasts and write what its senses perceive of them.

    Args:
        scene: File of the scene, with [world].
        out: Output directory.
        seconds: Duration; default: until 5 s after the last wave, without a vehicle
            0.5 s.
        seed: Seed of all draws.
        preset: Name in `world.PRESETS`; default: the laws.
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
    begin = begin or stages({"flying": 6.0, "listening": 4.0, "filming": 9.0})
    made = provenance_of((), source, tuple(command))
    by = preset_named(preset)
    uncertain, spec = read_world_by(source, by)
    uncertain, notes = with_ambient(uncertain)
    until = math.inf if seconds is None else seconds
    world = draw_world(uncertain, spec, seed, until_s=until, preset=by)
    arrivals = None
    if seconds is None:
        arrivals = arrivals_in(world)
        seconds = _seconds(world, arrivals)
    head = [f"SIMULATED, not measured: {source}, seed {seed}"]
    head += [] if by is None else [preset_words(by)]
    with writing(directory):
        directory.mkdir(parents=True, exist_ok=True)
        # tables of an earlier run next to new ones would mislead
        stale = [directory / n for n in (BLASTS, PERCEIVED, READINGS, FLIGHT, RUN)]
        for file in (*stale, *directory.glob("imu*.csv")):
            file.unlink(missing_ok=True)
    save_text(blasts_csv(world, head), directory / BLASTS)
    begin("flying")
    flights = flown(world, seconds)
    tracks, flight, answer = {}, None, None
    if flights is not None:
        # the scene's controller, or that with integral action
        flight = trajectory_of(flights, next(iter(flights.holds)))
        tracks = tracks_of(world.scene, flight)
        save_text(flight_csv(flights), directory / FLIGHT)
        answer = flights_answer(flights, scene=source, seed=seed)
    if arrivals is None or tracks:
        arrivals = arrivals_in(world, tracks)
    unseen = out_of_view(world.scene, flight)
    seen, late = perceived(world.scene, arrivals, seconds, unseen)
    clock = "times are on the common clock, of the laws, without errors"
    save_text(perceived_csv(seen, [*head, clock]), directory / PERCEIVED)
    begin("listening")
    with writing(directory):
        sound = listened(world, seconds, tracks, directory / SOUND)
    records = imu_records(world, flight, seconds)
    with writing(directory):
        imu, straight = write_imus(records, directory, head)
    by_samples = () if sound is None else sampled_sensors(world)
    names = [sensor.name for sensor in by_samples]
    names += [one.sensor.name for one in records if one.sensor.imu is not None]
    readings, late_readings = readings_of(world, arrivals, seconds, names)
    jolts, missed = picked_jolts(world, arrivals, records)
    readings = joined(readings, jolts)
    if sound is not None and by_samples:
        recordings = _recordings(sound, by_samples, directory / SOUND)
        found = picked_readings(world, arrivals, recordings, sound.seconds)
        readings = joined(readings, found.readings)
        missed += found.missed
    notes += [*straight, *_missed_words(missed)]
    notes += [
        f"{sensor.name}: no kind is specified, so it writes no samples"
        for sensor in world.scene.sensors
        if sensor.instrument is not None and not sensor.kind
    ]
    if unseen:
        notes.append(
            f"{len(unseen)} of {len(world.shots)} blasts are outside the camera's "
            "image: it does not perceive them"
        )
    if readings is not None:
        with writing(directory):
            write(directory / READINGS, readings, comments=head)
    with writing(directory):
        begin("filming")
        film = filmed(world, seconds, flight, directory / CAMERA)
    came = WorldRun(
        world,
        seconds,
        seen,
        late,
        readings,
        late_readings,
        flights,
        made,
        answer,
        sound,
        imu,
        film,
        notes,
    )
    save_text(world_answer(came).to_json(), directory / RUN)
    return came


def _seconds(world: DrawnWorld, arrivals: Arrivals) -> float:
    """Return the duration of a world: until after its last wave, in tenths of seconds.

    With a flight it is whole seconds, as each duration compiles another program.
    """
    last = arrivals.last_s()
    if world.scene.vehicle is None:
        return math.ceil(10.0 * (last + AFTER_S)) / 10.0
    return float(math.ceil(last + AFTER_FLIGHT_S))


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


def flown(world: DrawnWorld, seconds: float) -> Flights | None:
    """Fly the vehicle of a world through its blasts; None without vehicle or blast."""
    if world.scene.vehicle is None or not world.shots:
        return None
    padded = UncertainScene(with_nevers(world.scene), source=world.source)
    by = "laws" if world.preset is None else world.preset.load
    flights = fly(padded, Options(seconds=seconds, load=by), seed=world.seed)
    # `with_nevers` pads the charges, so that one program serves several counts
    count = len(world.scene.charges)
    holds = {
        name: replace(
            hold, encounter=Encounter(*(x[..., :count] for x in hold.encounter))
        )
        for name, hold in flights.holds.items()
    }
    blasts, places = flights.blasts[:count], flights.places_m[..., :count, :]
    return replace(flights, blasts=blasts, places_m=places, holds=holds)


def listened(
    world: DrawnWorld,
    seconds: float,
    tracks: Mapping[str, Track],
    directory: Path,
) -> Recordings | None:
    """Write the record of every sampling sensor; None without such a sensor."""
    kinds = {sensor.kind for sensor in world.scene.sensors}
    if not kinds & set(sampling_kinds()):
        return None
    uncertain = UncertainScene(world.scene, source=world.source)
    scene_of = None if world.preset is None else world.preset.scene_of
    listening = plan(uncertain, world.seed, seconds, tracks, scene_of)
    comments = provenance(listening, world.source, world.seed)
    records = write_tracks(listening, directory, comments)
    return recordings_answer(listening, records)


def filmed(
    world: DrawnWorld, seconds: float, flight: Trajectory | None, directory: Path
) -> FilmMade | None:
    """Write frames and events of the camera of a world.

    Frame 0 and the events begin at 0 on the common clock. Of the other frames only
    those with a fireball, and the two before, are stored.
    """
    scene, camera = world.scene, world.scene.camera
    if camera is None or not world.shots:
        return None
    path, background = None, BACKGROUND
    if camera.mount and flight is not None:
        known = np.isfinite(np.asarray(flight.position_m)).all(axis=-1)
        rows = (flight.time_s, flight.position_m, flight.quaternion)
        path = CameraPath(*(row[known] for row in rows))
        background = landscape()
        seconds = min(seconds, float(path.time[-1]))
    hz = float(camera.frames_hz)
    numbers = _frames(world, seconds - float(camera.exposure_s), hz)
    film = Film(scene, camera, numbers / hz, background, path=path)
    outputs = FilmOutputs(directory, "both", ".h5", None, hz)
    cleared(outputs, force=True)
    writer = FilmWriter(film, outputs)
    writer.write_frames()
    if world.preset is not None and world.preset.frame_differences:
        written, stamps = writer.write_frame_differences()
    else:
        written, stamps = writer.write_events(False, world.seed)
    writer.write_sheet()
    digits = max(4, len(str(len(numbers) - 1)))
    rows = [["file", "time_s"]]
    rows += [[f"{n:0{digits}}.png", f"{t:.12g}"] for n, t in enumerate(film.times)]
    write_text(directory / "frames.csv", comma_separated(rows))
    size = camera.width, camera.height
    return FilmMade(len(numbers), *size, written, stamps.how, stamps.error_s)


def _frames(world: DrawnWorld, seconds: float, hz: float) -> np.ndarray:
    """Return the numbers of the stored frames, counted from 0 at 0 s."""
    kept = {0, 1}
    for charge in world.scene.charges:
        begin = float(charge.time_s)
        life = float(fireball_duration(charge.tnt_mass("fireball_radius_m")))
        first = max(math.floor(begin * hz) - BEFORE, 0)
        kept |= set(range(first, math.ceil((begin + life) * hz) + 1))
    return np.array(sorted(number for number in kept if number / hz <= seconds))


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
