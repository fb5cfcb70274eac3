"""AEDAT4, the event files of iniVation's cameras, by faery.

References:
    iniVation, AEDAT 4.0 file format.
"""

import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from jblast.errors import child_output, needed, require
from jblast.sensors.camera.files.recorded_events import TYPES, Columns, Content, NewFile

MAX_SIDE = (1 << 15) - 1
"""Largest number of columns or rows [px]: coordinates have 16 bits with a sign."""
EVENT = np.dtype([("t", "=u8"), ("x", "=u2"), ("y", "=u2"), (("p", "on"), "?")])
"""An event of faery; the sign is named on, and p."""
PACKET = 1 << 16
"""Events of a packet, 1 MB: a reader has one in memory at a time."""
READER = """
import json, os, sys
os.environ["RUST_BACKTRACE"] = "0"
from faery import aedat
try:
    with aedat.Decoder(sys.argv[1]) as file:
        sizes = [t.dimensions for t in file.tracks() if t.data_type == "events"]
        packets = [packet for track, packet in file if track.data_type == "events"]
except BaseException as error:  # the type of Rust's errors is not an Exception
    sys.exit(" ".join(str(error).split()))
sys.stdout.buffer.write(json.dumps(sizes).encode() + b"\\n")
for packet in packets:
    sys.stdout.buffer.write(packet.tobytes())
"""
"""Program of `child_output` that reads a file: faery ends the process for some damaged
files."""


def read_aedat4(path: Path) -> Content:
    """Read the stream of events of an AEDAT4 file.

    Raises:
        InputError: faery is not installed or cannot read the file; it has no events, or
            those of several cameras.
    """
    needed("faery", "aedat4", path, "AEDAT4 is read")
    output = child_output(path, READER, "faery", "a complete AEDAT4 file")
    head, _, data = output.partition(b"\n")
    sizes = json.loads(head)
    require(len(sizes) == 1, path, "one stream of events", f"{len(sizes)}")
    events = np.frombuffer(data, EVENT)
    return Content({name: events[name] for name in TYPES}, tuple(sizes[0]))


def write_aedat4(file: NewFile, blocks: Iterable[Columns]) -> None:
    """Write columns of events block by block, uncompressed.

    Raises:
        InputError: faery is not installed.
    """
    aedat = needed("faery", "aedat4", file.path, "AEDAT4 is written").aedat
    node, attribute = aedat.DescriptionNode, aedat.DescriptionAttribute

    def described(path: str, values: Mapping[str, str | int], *children: Any) -> Any:
        kinds = {str: "string", int: "int"}
        stated = {key: attribute(kinds[type(v)], v) for key, v in values.items()}
        return node(path.split("/")[-2], path, stated, [*children])

    text = {
        "compression": "NONE",
        "originalOutputName": "events",
        "typeIdentifier": "EVTS",
    }
    size = {"sizeX": file.width, "sizeY": file.height, "source": "jblast"}
    stream = described("/outInfo/0/", text, described("/outInfo/0/info/", size))
    tree = described("/outInfo/", {}, stream)
    with aedat.Encoder(file.path, [tree], None) as encoder:
        for block in blocks:
            events = np.empty(len(block["t"]), EVENT)
            for name in TYPES:
                events[name] = block[name]
            for start in range(0, len(events), PACKET):
                encoder.write(0, events[start : start + PACKET])
