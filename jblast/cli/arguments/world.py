"""Output files of `jblast world`: truth, perception, readings, flight, sound and film.

`ran` draws the world and writes one sense after another, each with the code of its own
verb.

A microphone or pressure sensor with sampling options (`rate_hz`, noise, bits) has its
arrivals and peaks picked from its file, as by `jblast pick`, with their errors. The
truth sets the search interval of each blast, up to midway to the blasts before and
after it, and nothing else.

A sample is the mean over its interval, which begins at its stamp. A pick takes it as
the value at the stamp, so half a sampling interval is added to an arrival. The position
of a steep front within its interval is unknown: 1/12 of the squared interval is added
to the variance of an arrival, and to that of a peak the corresponding decay of the
pulse.
"""

import argparse
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from jblast.cli.arguments.film_files import FilmOutputs, FilmWriter, cleared
from jblast.cli.arguments.flight_files import flight_csv
from jblast.cli.arguments.options import save_text, writing
from jblast.files import write_text
from jblast.observations import Observations, observed, write
from jblast.observations.grouping import stacked
from jblast.observations.records.formats import Scaling, open_record
from jblast.observations.records.recording import PressureRecord, Recording
from jblast.report.flights import flights_answer
from jblast.report.listen import listening_document
from jblast.report.listen_files import provenance, write_tracks
from jblast.report.provenance import provenance_of
from jblast.report.words import comma_separated, commented
from jblast.report.world import WorldRun, blasts_csv, perceived_csv, preset_words
from jblast.scene import Sensor, UncertainScene
from jblast.scene.sensor_kinds import SENSOR_KINDS, sampling_kinds
from jblast.sensors import Track
from jblast.sensors.camera import landscape
from jblast.sensors.camera.film import Film
from jblast.sensors.camera.geometry import CameraPath
from jblast.sensors.camera.image import BACKGROUND
from jblast.sensors.listening import plan, with_ambient
from jblast.signals.picks import RecordPick, pick_records
from jblast.signals.picks.pick import LEAST_SAMPLES
from jblast.signals.picks.pick_log import log_value, untold
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
from jblast.world.perceived import out_of_view, stretch_about

BLASTS, PERCEIVED, READINGS = "blasts.csv", "perceived.csv", "observations.csv"
FLIGHT, RUN, SOUND, CAMERA = "flight.csv", "run.json", "sound", "camera"
AFTER_S, AFTER_FLIGHT_S = 0.5, 5.0
"""What lasts a world after its last wave, and one that is flown through."""
AIR, PEAK = TAKEN = ("air_arrival_s", "peak_overpressure_pa")
"""What is taken of a pick."""
BEFORE = 2
"""Frames that are kept before each flash."""
COLUMNS = (
    "time_s",
    *(f"a{axis}_m_s2" for axis in "xyz"),
    *(f"g{axis}_rad_s" for axis in "xyz"),
)
STRAIGHT = (
    "between the rows of the flight, {row:g} s apart, its samples are straight lines"
)


def ran(
    asked: argparse.Namespace, directory: Path, begin: Callable[[str], object]
) -> WorldRun:
    """Draw a world and write what its senses perceive; what is written stays.

    Args:
        asked: The options.
        directory: Where to; made if it is not there.
        begin: Says which stage begins.

    Raises:
        InputError: The scene, or an option, cannot be used.
    """
    made = provenance_of((), asked.scene, asked.words)
    preset = preset_named(asked.preset)
    uncertain, spec = read_world_by(asked.scene, preset)
    uncertain, notes = with_ambient(uncertain)
    until = math.inf if asked.seconds is None else asked.seconds
    world = draw_world(uncertain, spec, asked.seed, until_s=until, preset=preset)
    arrivals, seconds = None, asked.seconds
    if seconds is None:
        arrivals = arrivals_in(world)
        seconds = _seconds(world, arrivals)
    head = [f"SIMULATED, not measured: {asked.scene}, seed {asked.seed}"]
    head += [] if preset is None else [preset_words(preset)]
    with writing(directory):
        directory.mkdir(parents=True, exist_ok=True)
        for name in (BLASTS, PERCEIVED, READINGS, FLIGHT, RUN):  # would mislead
            (directory / name).unlink(missing_ok=True)
        clear_imus(directory)
    save_text(blasts_csv(world, head), directory / BLASTS)
    begin("flying")
    flights = flown(world, seconds)
    tracks, flight, answer = {}, None, None
    if flights is not None:
        flight = flight_of(flights)
        tracks = tracks_of(world.scene, flight)
        save_text(flight_csv(flights), directory / FLIGHT)
        document = flights_answer(flights, scene=asked.scene, seed=asked.seed)
        answer = {"schema": 1} | document.to_dict()
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
    by_samples = () if sound is None else sampled(world)
    names = [sensor.name for sensor in by_samples]
    names += [one.sensor.name for one in records if one.sensor.imu is not None]
    readings, late_readings = readings_of(world, arrivals, seconds, names)
    jolts, missed = picked_jolts(world, arrivals, records)
    readings = joined(readings, jolts)
    if sound is not None and by_samples:
        found = picked(world, arrivals, directory / SOUND, sound)
        readings = joined(readings, found.readings)
        missed += found.missed
    notes += [*straight, *Picked(None, missed).words()]
    notes += [
        f"{sensor.name}: its kind is not said, so it writes no samples"
        for sensor in world.scene.sensors
        if sensor.instrument is not None and not sensor.kind
    ]
    if unseen:
        notes.append(
            f"{len(unseen)} of {len(world.shots)} blasts are outside the camera's "
            "picture as they go off: it does not perceive them"
        )
    if readings is not None:
        with writing(directory):
            write(directory / READINGS, readings, comments=head)
    with writing(directory):
        begin("filming")
        film = filmed(world, seconds, flight, directory / CAMERA)
    return WorldRun(
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


def _seconds(world: DrawnWorld, arrivals: Arrivals) -> float:
    """Return how long a world lasts: until after its last wave, in tenths.

    With a flight in whole seconds, as each other duration is another program.
    """
    last = arrivals.last_s()
    if world.scene.vehicle is None:
        return math.ceil(10.0 * (last + AFTER_S)) / 10.0
    return float(math.ceil(last + AFTER_FLIGHT_S))


class Picked(NamedTuple):
    """What was picked of a world's files.

    Attributes:
        readings: The rows; None: no sensor has a row.
        missed: Air shocks of which nothing was picked, or nothing to be trusted.
    """

    readings: Observations | None
    missed: int

    def words(self) -> list[str]:
        """Return what there is to say of picks that are not among the readings."""
        if not self.missed:
            return []
        return [
            f"air shocks at sensors that sample, {self.missed} of them, were not "
            "picked, or poorly: no reading of them was written"
            if self.missed > 1
            else "an air shock at a sensor that samples was not picked, or poorly: no "
            "reading of it was written"
        ]


def joined(one: Observations | None, other: Observations | None) -> Observations | None:
    """Return both logs as one, the second behind the first."""
    logs = [log for log in (one, other) if log is not None]
    if len(logs) < 2:
        return logs[0] if logs else None
    comments = tuple(line for log in logs for line in log.comments)
    return Observations(**stacked(logs), comments=comments)


def sampled(world: DrawnWorld) -> tuple[Sensor, ...]:
    """Return the sensors whose readings are picked: those that say how they sample."""
    return tuple(
        sensor
        for sensor in world.scene.sensors
        if sensor.instrument is not None
        and sensor.kind
        and SENSOR_KINDS[sensor.kind].is_picked
    )


def picked(
    world: DrawnWorld, arrivals: Arrivals, directory: Path, sound: Mapping[str, Any]
) -> Picked:
    """Pick what the sensors of a world wrote.

    Args:
        world: What is there.
        arrivals: When and where waves come to whom.
        directory: Where the files are.
        sound: The document of the records.
    """
    records: list[PressureRecord] = []
    of: list[tuple[Sensor, int]] = []
    for sensor in sampled(world):
        own = arrivals.times_s[AIR][arrivals.entities.index(sensor.name)]
        comes = own + float(sensor.clock_offset_s)
        entry = sound["sensors"][sensor.name]
        scaling = Scaling(entry.get("full_scale_pa"), None)
        (recording,) = open_record(directory / entry["file"], scaling)
        for shot in np.flatnonzero(comes < sound["seconds"]).tolist():
            records.append(_about(recording, sensor, comes, shot))
            of.append((sensor, shot))
    rows: list[tuple[str, str, float, float, str, bool]] = []
    places: list[np.ndarray] = []
    missed = 0
    for (sensor, shot), one in zip(of, pick_records(records), strict=True):
        lost = [quantity for _, gone in untold(one) for quantity in gone]
        kept = [q for q in TAKEN if one.pick.found and q not in lost]
        missed += not kept
        for quantity in kept:
            value, sigma = _value(one, quantity)
            bound = quantity == PEAK and bool(one.pick.lower_bound)
            name = world.scene.charges[shot].name
            rows.append((sensor.name, quantity, value, sigma, name, bound))
            row = arrivals.entities.index(sensor.name)
            places.append(arrivals.places_m[AIR][row, shot])
    if not rows:
        return Picked(None, missed)
    names, quantities, values, sigmas, shots, bounds = zip(*rows, strict=True)
    readings = observed(
        names,
        quantities,
        values,
        sigmas,
        position=np.stack(places),
        shot=shots,
        lower_bound=np.array(bounds),
        comments=("air shocks at sensors that say how they sample are picked",),
    )
    return Picked(readings, missed)


def _about(
    recording: Recording, sensor: Sensor, comes_s: np.ndarray, shot: int
) -> PressureRecord:
    """Return the stretch of a record about one blast."""
    first, last = stretch_about(comes_s, shot)
    start, stop = (round(recording.rate_hz * t) for t in (max(first, 0.0), last))
    stop = min(max(stop, start + LEAST_SAMPLES), recording.length)
    record = recording.record(0, min(start, stop - LEAST_SAMPLES), stop)
    instrument = sensor.instrument
    if instrument is None or instrument.high_pass is None:
        return record
    return replace(record, high_pass_hz=float(instrument.high_pass))


def _value(one: RecordPick, quantity: str) -> tuple[float, float]:
    """Return a quantity of a pick and its sigma, both for means over samples."""
    value, sigma = log_value(one, quantity)
    step = 1.0 / one.record.rate_hz
    unknown = step / math.sqrt(12.0)
    if quantity == AIR:
        return value + 0.5 * step, math.hypot(sigma, unknown)
    fall = (1.0 + float(one.pick.decay)) / float(one.pick.positive_duration_s)
    return value, math.hypot(sigma, value * fall * unknown)


def flown(world: DrawnWorld, seconds: float) -> Flights | None:
    """Fly the vehicle of a world through its blasts; None where nothing flies."""
    if world.scene.vehicle is None or not world.shots:
        return None
    padded = UncertainScene(with_nevers(world.scene), source=world.source)
    by = "laws" if world.preset is None else world.preset.load
    flights = fly(padded, Options(seconds=seconds, load=by), seed=world.seed)
    return _of_first(flights, len(world.scene.charges))


def _of_first(flights: Flights, count: int) -> Flights:
    """Return flights without the charges after the first ones, which never happen."""
    holds = {
        name: replace(
            hold, encounter=Encounter(*(x[..., :count] for x in hold.encounter))
        )
        for name, hold in flights.holds.items()
    }
    blasts, places = flights.blasts[:count], flights.places_m[..., :count, :]
    return replace(flights, blasts=blasts, places_m=places, holds=holds)


def flight_of(flights: Flights) -> Trajectory:
    """Return the flight by the scene's own hold, or that with integral action."""
    return trajectory_of(flights, next(iter(flights.holds)))


def listened(
    world: DrawnWorld,
    seconds: float,
    tracks: Mapping[str, Track],
    directory: Path,
) -> dict[str, Any] | None:
    """Write what every sensor that samples hears and feels; None where none does."""
    kinds = {sensor.kind for sensor in world.scene.sensors}
    if not kinds & set(sampling_kinds()):
        return None
    uncertain = UncertainScene(world.scene, source=world.source)
    scene_of = None if world.preset is None else world.preset.scene_of
    listening = plan(uncertain, world.seed, seconds, tracks, scene_of)
    comments = provenance(listening, world.source, world.seed)
    records = write_tracks(listening, directory, comments)
    return listening_document(listening, records)


def filmed(
    world: DrawnWorld, seconds: float, flight: Trajectory | None, directory: Path
) -> dict[str, Any] | None:
    """Write what the camera of a world sees: frames, and events.

    Frame 0 and the events begin at 0 on the common clock. Of all other frames those are
    kept that show a fireball, or come just before one.
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
    return {
        "frames": len(numbers),
        "width": camera.width,
        "height": camera.height,
        **written._asdict(),
        "stamps": stamps.how,
        "stamp_error_s": stamps.error_s,
    }


def _frames(world: DrawnWorld, seconds: float, hz: float) -> np.ndarray:
    """Return which frames are kept, counted from 0 at 0 s."""
    kept = {0, 1}
    for charge in world.scene.charges:
        begin = float(charge.time_s)
        life = float(fireball_duration(charge.tnt_mass("fireball_radius_m")))
        first = max(math.floor(begin * hz) - BEFORE, 0)
        kept |= set(range(first, math.ceil((begin + life) * hz) + 1))
    return np.array(sorted(number for number in kept if number / hz <= seconds))


def write_imus(
    records: Sequence[ImuRecord], directory: Path, head: Sequence[str]
) -> tuple[dict[str, Any] | None, list[str]]:
    """Write the samples of every unit, and return what JSON tells, and warnings.

    Args:
        records: What they wrote.
        directory: Of the world.
        head: Comments above each table.
    """
    entries: dict[str, Any] = {}
    notes = []
    for record in records:
        name, rate = record.sensor.name, record.imu.rate
        file = "imu.csv" if len(records) == 1 else f"imu_{name}.csv"
        rows = np.column_stack(
            [record.stamps_s, record.samples.force, record.samples.rate]
        )
        comments = [
            *head,
            f"{name}: {rate:g} Hz, each row the mean from its stamp on, by its own "
            "clock; specific force and body rates along its own axes",
        ]
        text = [COLUMNS, *([f"{x:.9g}" for x in row] for row in rows.tolist())]
        save_text(commented(comments) + comma_separated(text), directory / file)
        entries[name] = {
            "file": file,
            "rate_hz": rate,
            "samples": len(rows),
            "clipped": record.clipped,
        }
        if record.row_s > 1.5 / rate:
            notes.append(f"{name}: {STRAIGHT.format(row=record.row_s)}")
    return entries or None, notes


def clear_imus(directory: Path) -> None:
    """Remove what an earlier run wrote, which would mislead."""
    for file in directory.glob("imu*.csv"):
        file.unlink()
