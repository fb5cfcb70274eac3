"""AEDAT4, the event files of iniVation's cameras.

A line names the format. A header (a FlatBuffer), whose text in XML names the streams,
and the packets follow: stream, length, and a FlatBuffer of events, 16 bytes each.

Files are read by dv-processing, which decompresses packets. They are written here,
uncompressed: dv-processing takes events from Python one at a time.

References:
    iniVation, AEDAT 4.0 file format; dv-processing, its FlatBuffers schemas.
"""

import json
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from jblast.errors import InputError, child_output, needed
from jblast.sensors.camera.files.recorded_events import (
    TYPES,
    Columns,
    RecordedEvents,
    recorded,
)

MAX_SIDE = 1 << 15
"""Largest number of columns or rows [px]: coordinates have 16 bits with a sign."""
EVENT = np.dtype(
    {
        "names": ["t", "x", "y", "p"],
        "formats": ["<i8", "<i2", "<i2", "u1"],
        "itemsize": 16,
    }
)
"""An event as the schema's struct: the time first, three empty bytes at the end."""
READER = """
import json, sys
import dv_processing as dv
import numpy as np
kind = np.dtype({"names": ["t", "x", "y", "p"], "formats": ["<i8", "<i2", "<i2", "u1"],
                 "itemsize": 16})
parts, answer = [], {}
try:
    file = dv.io.MonoCameraRecording(sys.argv[1])
    answer["all"] = file.getStreamNames()
    answer["streams"] = [n for n in answer["all"] if file.isStreamOfEventType(n)]
    if len(answer["streams"]) == 1:
        (name,) = answer["streams"]
        answer["size"] = file.getEventResolution(name)
        while file.isRunning(name):
            batch = file.getNextEventBatch(name)
            if batch is not None:
                some = batch.numpy()
                part = np.zeros(len(some), kind)
                names = {"t": "timestamp", "x": "x", "y": "y", "p": "polarity"}
                for ours, theirs in names.items():
                    part[ours] = some[theirs]
                parts.append(part)
except IndexError:
    answer["no_packets"] = True
except (RuntimeError, MemoryError) as error:
    # the first line of a message is a position in the source of the library
    lines = str(error).splitlines() or ["MemoryError"]
    sys.exit(lines[min(1, len(lines) - 1)].partition(" - Error info")[0])
sys.stdout.buffer.write(json.dumps(answer).encode() + b"\\n")
for part in parts:  # concatenated, they would lose the empty bytes of the type
    sys.stdout.buffer.write(part.tobytes())
"""
"""Program of `child_output` that reads a file: dv-processing ends with a segmentation
fault, or never, for damaged files."""
PACKET = 1 << 16
"""Events of a packet, 1 MB: a reader has one in memory at a time."""
# Number of the one stream in the header below; a file without a table of packets states
# -1 for its position.
STREAM = 0
NO_TABLE = -1
TREE = """<dv version="2.0">
    <node name="outInfo" path="/outInfo/">
        <node name="0" path="/outInfo/0/">
            <attr key="compression" type="string">NONE</attr>
            <attr key="originalModuleName" type="string">jblast</attr>
            <attr key="originalOutputName" type="string">events</attr>
            <attr key="typeDescription" type="string">Array of events.</attr>
            <attr key="typeIdentifier" type="string">EVTS</attr>
            <node name="info" path="/outInfo/0/info/">
                <attr key="sizeX" type="int">{width}</attr>
                <attr key="sizeY" type="int">{height}</attr>
                <attr key="source" type="string">jblast</attr>
            </node>
        </node>
    </node>
</dv>
"""


def read_aedat4(path: Path, size: tuple[int, int] | None) -> RecordedEvents:
    """Read the stream of events of an AEDAT4 file.

    Raises:
        InputError: dv-processing is not installed or cannot read the file; it has no
            events, or those of several cameras.
    """
    needed("dv_processing", "aedat4", path, "AEDAT4 is read")
    with path.open("rb") as begun:
        begin = begun.read(12)
    if begin != b"#!AER-DAT4.0":
        raise InputError(f"{path}: expected an AEDAT4 file, got none of that format")
    output = child_output(path, READER, "dv-processing", "a complete AEDAT4 file")
    head, _, data = output.partition(b"\n")
    answer = json.loads(head)
    if "no_packets" in answer:  # from dv-processing's own empty files, too
        raise InputError(
            f"{path}: expected an AEDAT4 file with packets of events, got none"
        )
    if len(answer["streams"]) != 1:
        names = ", ".join(answer["all"]) or "nothing"
        raise InputError(
            f"{path}: expected one stream of events, got {len(answer['streams'])} of "
            f"{names}"
        )
    events = np.frombuffer(data, EVENT)
    columns = {name: events[name] for name in TYPES}
    return recorded(path, columns, tuple(answer["size"]) if answer["size"] else size)


class Packet(NamedTuple):
    """Entry of a packet in the index at the file's end.

    Attributes:
        place: Position of its events in the file, after stream and length.
        length: Length [bytes].
        events: Number of events.
        first: Time of the first event [us].
        last: Time of the last event [us].
    """

    place: int
    length: int
    events: int
    first: int
    last: int


def write_aedat4(
    path: Path, blocks: Iterable[Columns], size: tuple[int, int], last_ms: int
) -> None:
    """Write columns of events block by block.

    Args:
        path: An empty file.
        blocks: Columns of events, none empty.
        size: Width and height.
        last_ms: Not used by this format.
    """
    del last_ms
    with path.open("wb") as file:
        file.write(_header(*size, NO_TABLE))
        packets = []
        for events in _packets(blocks):
            data = _packet(events)
            file.write(np.array([STREAM, len(data)], "<i4").tobytes())
            # the index finds packets by their first and last time
            times = [int(t) for t in events["t"][[0, -1]]] if len(events) else [0, 0]
            packets.append(Packet(file.tell(), len(data), len(events), *times))
            file.write(data)
        table = file.tell()
        file.write(_table(packets))
        # the header is written again, with the position of the table
        file.seek(0)
        file.write(_header(*size, table))


def _packets(blocks: Iterable[Columns]) -> Iterator[np.ndarray]:
    """Yield events as the schema's structs; an empty packet if there are none."""
    some = False
    for block in blocks:
        some = True
        events = np.zeros(len(block["t"]), EVENT)
        for name in EVENT.names or ():
            events[name] = block[name]
        for start in range(0, len(events), PACKET):
            yield events[start : start + PACKET]
    if not some:  # dv-processing rejects a file without packets
        yield np.zeros(0, EVENT)


def _header(width: int, height: int, table: int) -> bytes:
    """Return the first line and the table IOHeader: index position, and the tree.

    Nothing is compressed. The length does not depend on the position of the index, so
    the header can be written again once that is known.
    """
    import flatbuffers

    builder = flatbuffers.Builder(4096)
    tree = builder.CreateString(TREE.format(width=width, height=height))
    builder.StartObject(3)
    builder.PrependInt32Slot(0, 0, 1)
    builder.PrependInt64Slot(1, table, 0)
    builder.PrependUOffsetTRelativeSlot(2, tree, 0)
    builder.FinishSizePrefixed(builder.EndObject(), b"IOHE")
    return b"#!AER-DAT4.0\r\n" + bytes(builder.Output())


def _packet(events: np.ndarray) -> bytes:
    """Return the table EventPacket of some events."""
    import flatbuffers

    data = events.tobytes()
    builder = flatbuffers.Builder(len(data) + 256)
    # The events are one block of bytes: appending them through the builder's own calls
    # would go number by number.
    builder.StartVector(EVENT.itemsize, len(events), 8)
    builder.head = builder.head - len(data)
    builder.Bytes[builder.head : builder.head + len(data)] = data
    vector = builder.EndVector()
    builder.StartObject(1)
    builder.PrependUOffsetTRelativeSlot(0, vector, 0)
    builder.FinishSizePrefixed(builder.EndObject(), b"EVTS")
    return bytes(builder.Output())


def _table(packets: Sequence[Packet]) -> bytes:
    """Return the table FileDataTable of all packets."""
    import flatbuffers

    builder = flatbuffers.Builder(64 * len(packets) + 256)
    entries = []
    for packet in packets:
        builder.StartObject(5)
        builder.PrependInt64Slot(0, packet.place, 0)
        builder.Prep(4, 8)
        builder.PrependInt32(packet.length)
        builder.PrependInt32(STREAM)
        builder.PrependStructSlot(1, builder.Offset(), 0)
        builder.PrependInt64Slot(2, packet.events, 0)
        builder.PrependInt64Slot(3, packet.first, 0)
        builder.PrependInt64Slot(4, packet.last, 0)
        entries.append(builder.EndObject())
    builder.StartVector(4, len(entries), 4)
    # FlatBuffers are built from the end
    for entry in reversed(entries):
        builder.PrependUOffsetTRelative(entry)
    vector = builder.EndVector()
    builder.StartObject(1)
    builder.PrependUOffsetTRelativeSlot(0, vector, 0)
    builder.FinishSizePrefixed(builder.EndObject(), b"FTAB")
    return bytes(builder.Output())
