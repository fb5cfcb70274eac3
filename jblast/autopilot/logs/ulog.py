"""ULog, in which PX4 keeps its flights: topics of rows, written as the format has it.

docs.px4.io/main/en/dev_log/ulog_file_format.html, version 1: a header; definitions
(the formats of topics, facts); then subscriptions and rows. Fields stand from the
widest to the narrowest, so that none needs padding.
"""

import struct
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

MAGIC = b"ULog\x01\x12\x35\x01"
_TYPES = {"float": "<f4", "double": "<f8", "bool": "?", "uint8_t": "u1"}
_WIDTH = {"double": 8, "float": 4, "bool": 1, "uint8_t": 1}


class Topic(NamedTuple):
    """Rows of one kind.

    Attributes:
        name: As PX4 calls it.
        time_s: Of the rows.
        fields: Type, as "float" or "float[4]", and values, by name.
    """

    name: str
    time_s: Float[np.ndarray, " row"]
    fields: Mapping[str, tuple[str, np.ndarray]]


def ulog_bytes(
    topics: Sequence[Topic],
    facts: Mapping[str, str],
    said: Sequence[tuple[float, str]] = (),
) -> bytes:
    """Return the bytes of a log.

    Args:
        topics: Its rows.
        facts: Texts by name, as `sys_name`.
        said: Times [s] and sentences that were said at them.
    """
    parts = [MAGIC, struct.pack("<Q", 0), _message("B", bytes(40))]
    for name, text in facts.items():
        value = text.encode()
        key = f"char[{len(value)}] {name}".encode()
        parts.append(_message("I", bytes([len(key)]) + key + value))
    ordered = [topic._replace(fields=_widest_first(topic)) for topic in topics]
    for topic in ordered:
        text = f"{topic.name}:uint64_t timestamp;"
        text += "".join(f"{kind} {name};" for name, (kind, _) in topic.fields.items())
        parts.append(_message("F", text.encode()))
    for number, topic in enumerate(ordered):
        head = struct.pack("<BH", 0, number)
        parts.append(_message("A", head + topic.name.encode()))
    rows = [row for n, topic in enumerate(ordered) for row in _rows(topic, n)]
    for time_s, text in said:
        stamp = _stamp(time_s)
        logged = struct.pack("<BQ", ord("6"), stamp) + text.encode()
        rows.append((stamp, _message("L", logged)))
    rows.sort(key=lambda row: row[0])
    return b"".join([*parts, *(data for _, data in rows)])


def _widest_first(topic: Topic) -> dict[str, tuple[str, np.ndarray]]:
    def width(item: tuple[str, tuple[str, np.ndarray]]) -> int:
        return -_WIDTH[item[1][0].partition("[")[0]]

    return dict(sorted(topic.fields.items(), key=width))


def _rows(topic: Topic, number: int) -> list[tuple[int, bytes]]:
    """Return each row's time [us] and message."""
    parts: list[tuple] = [
        ("size", "<u2"),
        ("kind", "u1"),
        ("number", "<u2"),
        ("timestamp", "<u8"),
    ]
    for name, (kind, _) in topic.fields.items():
        plain, bracket, count = kind.partition("[")
        shape = (int(count.removesuffix("]")),) if bracket else ()
        parts.append((name, _TYPES[plain], shape))
    layout = np.dtype(parts)
    rows = np.zeros(topic.time_s.size, layout)
    rows["size"], rows["kind"], rows["number"] = layout.itemsize - 3, ord("D"), number
    rows["timestamp"] = [_stamp(t) for t in topic.time_s]
    for name, (_, values) in topic.fields.items():
        rows[name] = values
    whole, size = rows.tobytes(), layout.itemsize
    stamps = rows["timestamp"].tolist()
    return [(t, whole[n * size : (n + 1) * size]) for n, t in enumerate(stamps)]


def _message(kind: str, content: bytes) -> bytes:
    return struct.pack("<HB", len(content), ord(kind)) + content


def _stamp(time_s: float) -> int:
    return round(1e6 * float(time_s))
