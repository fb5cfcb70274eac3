"""A world from its scene to its folder, one sense after another."""

import argparse
import math
from collections.abc import Callable
from pathlib import Path

from jblast.cli.arguments.flights.files import flight_csv
from jblast.cli.arguments.paths import save_text, writing
from jblast.cli.arguments.world.imus import clear_imus, write_imus
from jblast.cli.arguments.world.picked import Picked, joined, picked, sampled
from jblast.cli.arguments.world.senses import filmed, flight_of, flown, listened
from jblast.observations import write
from jblast.report.flights import flights_answer
from jblast.report.provenance import provenance_of
from jblast.report.world import WorldRun, blasts_csv, perceived_csv, preset_words
from jblast.sensors.listening.ambient import with_ambient
from jblast.world import (
    Arrivals,
    DrawnWorld,
    arrivals_in,
    draw_world,
    imu_records,
    perceived,
    picked_jolts,
    preset_named,
    read_world_by,
    readings_of,
    tracks_of,
)
from jblast.world.perceived import out_of_view

BLASTS, PERCEIVED, READINGS = "blasts.csv", "perceived.csv", "observations.csv"
FLIGHT, RUN, SOUND, CAMERA = "flight.csv", "run.json", "sound", "camera"
AFTER_S, AFTER_FLIGHT_S = 0.5, 5.0
"""What lasts a world after its last wave, and one that is flown through."""


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
