"""Columns of events as AEDAT4."""

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from jblast.sensors.camera.files.events.recorded import Columns

LARGEST = 1 << 15
"""Columns or rows that have a number [px]."""

EVENT = np.dtype(
    {
        "names": ["t", "x", "y", "p"],
        "formats": ["<i8", "<i2", "<i2", "u1"],
        "itemsize": 16,
    }
)
"""An event as the schema's struct: the time first, three empty bytes at the end."""

PACKET = 1 << 16
"""Events of a packet: a reader holds one at a time."""

STREAM = 0
NO_TABLE = -1


class Packet(NamedTuple):
    """What the index at the file's end says of a packet.

    Attributes:
        place: Where its events begin, behind stream and length.
        length: In bytes.
        events: How many.
        first: Time of the first [us].
        last: Time of the last [us].
    """

    place: int
    length: int
    events: int
    first: int
    last: int


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


def write_aedat4(
    path: Path, blocks: Iterable[Columns], size: tuple[int, int], last_ms: int
) -> None:
    """Write columns of events block by block.

    Args:
        path: An empty file.
        blocks: Columns of events, none empty.
        size: Width and height.
        last_ms: Of no use here.
    """
    del last_ms
    with path.open("wb") as file:
        file.write(_header(*size, NO_TABLE))
        packets = []
        for events in _packets(blocks):
            data = _packet(events)
            file.write(np.array([STREAM, len(data)], "<i4").tobytes())
            times = [int(t) for t in events["t"][[0, -1]]] if len(events) else [0, 0]
            packets.append(Packet(file.tell(), len(data), len(events), *times))
            file.write(data)
        table = file.tell()
        file.write(_table(packets))
        file.seek(0)
        file.write(_header(*size, table))


def _packets(blocks: Iterable[Columns]) -> Iterator[np.ndarray]:
    """Return events as the schema's structs, and an empty packet if there are none."""
    some = False
    for block in blocks:
        some = True
        events = np.zeros(len(block["t"]), EVENT)
        for name in EVENT.names or ():
            events[name] = block[name]
        for start in range(0, len(events), PACKET):
            yield events[start : start + PACKET]
    if not some:  # dv-processing takes no file without packets
        yield np.zeros(0, EVENT)


def _header(width: int, height: int, table: int) -> bytes:
    """Return the first line and the table IOHeader: where the index is, and the tree.

    Nothing is compressed. The length is the same for every place of the index.
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
    for entry in reversed(entries):
        builder.PrependUOffsetTRelative(entry)
    vector = builder.EndVector()
    builder.StartObject(1)
    builder.PrependUOffsetTRelativeSlot(0, vector, 0)
    builder.FinishSizePrefixed(builder.EndObject(), b"FTAB")
    return bytes(builder.Output())
