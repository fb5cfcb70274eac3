"""Recordings and templates named on the command line: read, checked, at one rate."""

from argparse import Namespace
from collections.abc import Callable, Sequence
from functools import cache, partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from jblast.errors import InputError
from jblast.observations.records.sound import SoundRecord, read_sound, resampled
from jblast.observations.records.stations import START, Station, read_stations
from jblast.progress import each
from jblast.signals.search import (
    DURATIONS,
    OTHER_FRONT,
    SAME_FRONT,
    Channel,
    Searched,
    bank_of_pulses,
    search,
    search_as_stream,
    search_bank,
)

Shapes = list[np.ndarray]


def channels_of(files: Sequence[str]) -> tuple[list[Channel], list[str]]:
    """Read recordings; return their channels, and the names of those that are dead.

    A dead channel holds one value throughout, as an unplugged microphone does.

    Raises:
        InputError: A recording cannot be read, two would have one name, or no channel
            is alive.
    """
    alive: list[Channel] = []
    dead: list[str] = []
    stems = [Path(file).stem for file in files]
    for file, stem in zip(each(files, "recordings"), stems, strict=True):
        if stems.count(stem) > 1:
            raise InputError(
                f"{file}: expected recordings of names that differ, got {stem} twice"
            )
        sound = read_sound(file)
        for number, samples in enumerate(sound.samples, start=1):
            name = stem if len(sound.samples) == 1 else f"{stem}.{number}"
            if not np.ptp(samples) > 0:
                dead.append(name)
                continue
            alive.append(Channel(name, file, number, samples, float(sound.rate_hz)))
    if not alive:
        raise InputError(
            f"{', '.join(files)}: expected sound, got one value throughout"
        )
    return alive, dead


def template_of(file: str) -> SoundRecord:
    """Read a template.

    Raises:
        InputError: It cannot be read, is silent, or has several channels.
    """
    sound = read_sound(file)
    if len(sound.samples) > 1:
        raise InputError(
            f"{file}: expected a template of one channel, got {len(sound.samples)}"
        )
    if not np.ptp(sound.samples) > 0:
        raise InputError(
            f"{file}: expected a template that can be heard, got one value throughout"
        )
    return sound


def at_rate(sound: SoundRecord, rate_hz: float) -> Float[np.ndarray, " tap"]:
    """Return a template's samples at the rate of a recording."""
    return resampled(sound.samples[0], sound.rate_hz, rate_hz)


class Method(NamedTuple):
    """What was looked for.

    Attributes:
        words: As a message names it.
        keys: As keys of the document.
    """

    words: str
    keys: dict[str, Any]


def stations_of(
    file: str | None, channels: Sequence[Channel]
) -> dict[str, Station] | None:
    """Read where the microphones stood; None where no file says so.

    Raises:
        InputError: It cannot be read, a channel has no station, or it tells when files
            began.
    """
    if file is None:
        return None
    stations = read_stations(file)
    if any(station.start is not None for station in stations.values()):
        raise InputError(
            f"{file}: column {START}: expected nothing, as detect counts from the "
            "first sample of each file; jblast pick takes it"
        )
    for channel in channels:
        if channel.sensor not in stations:
            raise InputError(
                f"{file}: expected a station for {channel.sensor} of {channel.record}, "
                f"got {', '.join(stations)}"
            )
    return stations


def searched_for(
    asked: Namespace, channels: Sequence[Channel]
) -> tuple[list[Searched], Method]:
    """Search each channel for what is asked for; say what that was.

    Raises:
        InputError: It cannot be looked for, or is longer than a recording.
    """
    look = partial(
        search_as_stream if asked.stream else search,
        front_samples=SAME_FRONT if asked.template else OTHER_FRONT,
    )
    sought, method = _sought(asked)
    shapes_at = cache(sought)  # channels mostly have one rate
    searched = []
    for channel in each(channels, "channels"):
        templates = shapes_at(channel.rate_hz)
        for template in templates:
            _check_length(channel, template.size, method.words)
        if len(templates) == 1:
            searched.append(look(channel, templates[0], asked.false_alarms))
            continue
        found = search_bank(
            channel,
            templates,
            asked.false_alarms,
            look,
            any_form=not asked.blast_form,
        )
        searched.append(found)
    return searched, method


def _sought(asked: Namespace) -> tuple[Callable[[float], Shapes], Method]:
    """Return what gives the templates at a rate, and what they are."""
    if asked.template:
        sound = template_of(asked.template)
        words = f"the template {Path(asked.template).name}"
        keys = {"name": "matched_filter", "template": asked.template}
        return lambda rate_hz: [at_rate(sound, rate_hz)], Method(words, keys)
    from jblast.cli.jax_start import start_jax

    start_jax(quick=True)
    from jblast.signals.templates import blast_template

    if asked.charge:
        words = f"the pulse of {asked.charge:g} kg of TNT at {asked.range:g} m"
        keys = {"name": "matched_filter"}
        keys |= {"charge_mass_kg": asked.charge, "range_m": asked.range}
        return lambda rate_hz: [
            blast_template(asked.charge, asked.range, rate_hz)
        ], Method(words, keys)
    low, high = 1e3 * DURATIONS[0], 1e3 * DURATIONS[-1]
    words = f"a bank of {len(DURATIONS)} blast pulses of {low:.2g} to {high:.2g} ms"
    keys = {"name": "bank_of_pulses", "durations_s": list(DURATIONS)}
    return bank_of_pulses, Method(words, keys)


def _check_length(channel: Channel, samples: int, what: str) -> None:
    """Refuse a template that is longer than a recording."""
    if samples > channel.samples.size:
        raise InputError(
            f"{channel.record}: expected a recording at least as long as {what}, "
            f"{samples / channel.rate_hz:.6g} s; got "
            f"{channel.samples.size / channel.rate_hz:.6g} s"
        )
