"""The senses of a world, each by the code of its own verb: flight, sound, film."""

import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from jblast.cli.arguments.film_files import FilmWriter
from jblast.cli.arguments.film_outputs import FilmOutputs, cleared
from jblast.files import write_text
from jblast.report.listen import listening_document
from jblast.report.listen_files import provenance, write_tracks
from jblast.report.words import comma_separated
from jblast.scene import UncertainScene
from jblast.scene.reader.schema import INSTRUMENT_KINDS
from jblast.sensors import Track
from jblast.sensors.camera import landscape
from jblast.sensors.camera.film import Film
from jblast.sensors.camera.geometry.camera_path import CameraPath
from jblast.sensors.camera.image.behind import BACKGROUND
from jblast.sensors.listening.plan import plan
from jblast.study.flights.encounter import Encounter
from jblast.study.flights.fly import fly
from jblast.study.flights.records import Flights, Options
from jblast.study.flights.statistics import trajectory_of
from jblast.vehicle import Trajectory
from jblast.waves.fireball import fireball_duration
from jblast.world import DrawnWorld, with_nevers

BEFORE = 2
"""Frames that are kept before each flash."""


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
    if not kinds & set(INSTRUMENT_KINDS):
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
