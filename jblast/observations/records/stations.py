"""Stations: positions, clocks and start times of recorders, from a table or a map.

A station is identified by the name of its channel: the stem of the file, or
stem.channel with the channel's name or number. Its position is east, north, up [m] or
latitude, longitude, altitude. The column `start_utc` gives the time of the first sample
and must be the same for all channels of a file; it replaces a time stamp in the file.

Points of KML and GeoJSON are stations; of the maps that jblast writes, the sensors.
StationXML of the FDSN gives positions of channels of pressure and their sensitivities.
"""

import json
import os
from collections.abc import Mapping
from dataclasses import replace
from datetime import datetime
from pathlib import PurePath
from typing import NamedTuple

from jblast.errors import InputError, argument, needed, reading, shown
from jblast.observations.instants import EXAMPLE, NotAnInstant, instant
from jblast.observations.names import read_header
from jblast.observations.places import Frame
from jblast.observations.positions import positions
from jblast.observations.records.recording import Recording
from jblast.observations.rows import converted_columns
from jblast.observations.rules import Rows, Rule
from jblast.observations.sources import table_of
from jblast.observations.text_table import Row, table_of_rows, take_decimal_commas
from jblast.results import Note
from jblast.units import sample_unit

PLACE = ("east_m", "north_m", "up_m")
DEGREES = ("lat_deg", "lon_deg", "alt_m")
START = "start_utc"
KML = "{http://www.opengis.net/kml/2.2}"
MAX_FAULTS = 20
"""Largest number of faults that one message lists."""
COLUMNS = ("sensor", *PLACE, *DEGREES, "clock", START)


class Station(NamedTuple):
    """Position and clock of a microphone.

    Attributes:
        position: East, north, up [m].
        clock: Clock of its recorder; "" for the common clock.
        frame: Origin of the position on the Earth, for a table in degrees.
        start: UTC of the first sample of its record; None if unknown.
        sensitivity: Pascals per count of its recorder; None if unknown.
    """

    position: tuple[float, float, float]
    clock: str
    frame: Frame | None = None
    start: datetime | None = None
    sensitivity: float | None = None


def read_stations(
    path: str | os.PathLike[str], understood: list[Note] | None = None
) -> dict[str, Station]:
    """Return the stations of a table by name.

    Columns are `sensor,east_m,north_m,up_m`, or `sensor,lat_deg,lon_deg,alt_m`, and
    optionally `clock` and `start_utc`, the time of the first sample of a file without a
    time stamp (2020-08-04T15:08:18.310Z). A sensor is the stem of a file's name, or
    stem.channel, with the name or number of the channel. `note` columns and lines that
    begin with # are comments. Dialects and units of length are those of a log (`read`).

    Args:
        path: Text, a spreadsheet or Parquet; KML, GeoJSON or StationXML.
        understood: Conversions are appended here.

    Raises:
        InputError: The file is not as described; the message has position and fault,
            of all faults.
    """
    within = f"a header {','.join(COLUMNS[:4])} and a station a row"
    sensitivities: dict[str, float] = {}
    suffix = PurePath(path).suffix.lower()
    if suffix in MAPS:
        with reading(path, f"stations as {suffix}"):
            found = MAPS[suffix](os.fspath(path))
        sensitivities = {row[0]: float(row[4]) for row in found if row[4:]}
        head = ("sensor", *DEGREES)
        cells = [Row(n, list(row[:4])) for n, row in enumerate([head, *found])]
        table = table_of_rows(os.fspath(path), cells)
    else:
        table = table_of(path, f"a table of stations: {within}")
    header = read_header(table, COLUMNS)
    degrees = bool({*DEGREES} & {*table.header})
    needed = ("sensor", *(DEGREES[:2] if degrees else PLACE))
    missing = [name for name in needed if name not in table.header]
    if missing:
        where = table.at(table.header_line)
        table.faults.append(InputError(f"{where}: missing column {', '.join(missing)}"))
    elif not len(table.lines):
        fault = f"{path}: expected {within}, got the header alone"
        table.faults.append(InputError(fault))
    # these leave nothing to check
    if missing or not len(table.lines):
        _raise(path, table.faults)
    numbers = [at for at, name in enumerate(table.header) if name in PLACE + DEGREES]
    take_decimal_commas(table, numbers)
    rows = Rows(table, header)
    sensors = rows.text("sensor")
    starts: list[datetime | None] = []
    for text in rows.text(START):
        try:
            starts.append(instant(text, None, None) if text else None)
        except NotAnInstant:
            starts.append(None)
    rows.refuse(
        [
            Rule(
                "sensor",
                [not x or x in sensors[:row] for row, x in enumerate(sensors)],
                lambda row: (
                    "expected a new name, got "
                    + (f"{shown(sensors[row])} twice" if sensors[row] else "nothing")
                ),
            ),
            *(Rule(name, ~rows.given(name), "a number") for name in needed[1:]),
            Rule(
                START,
                rows.given(START) & [start is None for start in starts],
                f"a day, a time and a zone, as {EXAMPLE}",
            ),
        ]
    )
    placed = positions(rows)
    _raise(path, table.faults)
    if understood is not None:
        understood += [*table.notes, *converted_columns(rows), *placed.notes]
    return {
        name: Station(
            (float(x), float(y), float(z)),
            clock,
            placed.frame,
            start,
            sensitivities.get(name),
        )
        for name, (x, y, z), clock, start in zip(
            sensors, placed.enu, rows.text("clock"), starts, strict=True
        )
    }


def _kml(path: str) -> list[tuple[str, ...]]:
    """Return name, latitude, longitude and height of the points of KML."""
    from xml.etree import ElementTree

    root = ElementTree.parse(path).getroot()
    ours = [
        folder
        for folder in root.iter(f"{KML}Folder")
        if folder.findtext(f"{KML}name") == "Sensors"
    ]
    rows: list[tuple[str, ...]] = []
    for mark in (ours[0] if ours else root).iter(f"{KML}Placemark"):
        text = mark.findtext(f"{KML}Point/{KML}coordinates")
        if text is not None:
            lon, lat, *height = text.strip().split(",")
            name = (mark.findtext(f"{KML}name") or "").strip()
            rows.append((name, lat, lon, height[0] if height else ""))
    return rows


def _geojson(path: str) -> list[tuple[str, ...]]:
    """Return name, latitude, longitude and height of the points of GeoJSON."""
    rows: list[tuple[str, ...]] = []
    with open(path, encoding="utf-8-sig") as file:
        features = json.load(file)["features"]
    kinds = {one["properties"].get("kind") for one in features}
    for one in features:
        of, geometry = one["properties"], one["geometry"]
        is_sensor = "sensor" not in kinds or of.get("kind") == "sensor"
        if is_sensor and geometry and geometry["type"] == "Point":
            lon, lat, *height = map(str, geometry["coordinates"])
            name = str(of.get("sensor") or of.get("name") or of.get("title") or "")
            rows.append((name, lat, lon, height[0] if height else ""))
    return rows


def _station_xml(path: str) -> list[tuple[str, ...]]:
    """Return name, position and sensitivity of the channels of pressure."""
    obspy = needed("obspy", "seismic", path, "StationXML is read")
    rows: dict[str, tuple[str, ...]] = {}
    for network in obspy.read_inventory(path, format="STATIONXML"):
        for station in network:
            for channel in station:
                of = channel.response and channel.response.instrument_sensitivity
                dimension, factor, _ = sample_unit(of.input_units if of else "")
                if dimension != "pressure":
                    continue
                codes = network.code, station.code, channel.location_code, channel.code
                height = channel.elevation - channel.depth
                numbers = channel.latitude, channel.longitude, height, factor / of.value
                # a later response replaces an earlier one
                rows[".".join(codes)] = (
                    ".".join(codes),
                    *map(repr, map(float, numbers)),
                )
    return list(rows.values())


MAPS = {
    ".kml": _kml,
    ".geojson": _geojson,
    ".json": _geojson,
    ".xml": _station_xml,
}
"""Readers of other files than tables, by suffix."""


def _raise(path: str | os.PathLike[str], faults: list[InputError]) -> None:
    """Raise one error for all faults of a table, if there are any."""
    if len(faults) == 1:
        raise faults[0]
    if faults:
        texts = [fault.worded(argument).removeprefix(f"{path}: ") for fault in faults]
        more = " ..." * (len(faults) > MAX_FAULTS)
        listed = "; ".join(texts[:MAX_FAULTS])
        raise InputError(f"{path}: {len(faults)} faults: {listed}{more}")


def started(
    recording: Recording, stations: Mapping[str, Station], later_s: float = 0.0
) -> Recording:
    """Return a recording with the start time and sensitivity of its stations.

    Args:
        recording: Recording of a file, with the names of stations.
        stations: Stations by name.
        later_s: Time from the first sample of the file to that of the recording [s].

    Raises:
        InputError: Its channels have several start times or sensitivities.
    """
    own = [stations[name] for name in recording.names if name in stations]
    common = {(station.start, station.sensitivity) for station in own}
    if len(common) > 1:
        raise InputError(
            f"{recording.source}: expected one {START} and one sensitivity for all "
            "channels of a file, got several"
        )
    start, sensitivity = next(iter(common), (None, None))
    if sensitivity is not None and not recording.calibrated:
        of = recording
        recording = replace(
            of,
            calibrated=True,
            read=lambda begin, end: sensitivity * of.read(begin, end),
            full_scale=of.full_scale and sensitivity * of.full_scale,
        )
    if start is None:
        return recording
    notes = recording.notes
    if recording.epoch is not None:
        notes += (f"time of day by {START} of the table of stations",)
    return replace(
        recording,
        epoch=start.replace(microsecond=0),
        start_s=start.microsecond / 1e6 + later_s,
        clock_is_set=True,
        notes=notes,
    )
