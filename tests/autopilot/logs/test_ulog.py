"""Flights as logs of PX4: read back by PX4's own reader, and byte by byte."""

import struct

import numpy as np
import pytest

from jblast.autopilot.logs import MAGIC, Topic, flight_ulog, ulog_bytes
from tests.autopilot.logs.flights import HOME, eastward


def messages(data: bytes) -> list[tuple[str, bytes]]:
    """Kind and content of each message behind the header of 16 bytes."""
    found, at = [], 16
    while at < len(data):
        size, kind = struct.unpack_from("<HB", data, at)
        found.append((chr(kind), data[at + 3 : at + 3 + size]))
        at += 3 + size
    assert at == len(data)
    return found


def test_a_log_is_header_definitions_and_rows_in_order_of_time():
    times = np.array([0.0, 0.5])
    narrow = {"flag": ("bool", np.array([True, False])), "x": ("float", times)}
    other = Topic("b", times + 0.25, {"y": ("double[2]", np.zeros((2, 2)))})
    data = ulog_bytes([Topic("a", times, narrow), other], {"sys_name": "jblast"})
    assert data[:8] == MAGIC
    kinds = "".join(kind for kind, _ in messages(data))
    assert kinds == "BIFFAADDDD"
    formats = [content.decode() for kind, content in messages(data) if kind == "F"]
    assert formats[0] == "a:uint64_t timestamp;float x;bool flag;"
    rows = [content for kind, content in messages(data) if kind == "D"]
    assert [struct.unpack_from("<HQ", row) for row in rows] == [
        (0, 0),
        (1, 250_000),
        (0, 500_000),
        (1, 750_000),
    ]
    assert struct.unpack_from("<f?", rows[2], 10) == (0.5, False)


def test_pyulog_reads_a_flight(tmp_path):
    reader = pytest.importorskip("pyulog")
    file = tmp_path / "flight.ulg"
    file.write_bytes(flight_ulog(eastward()))
    log = reader.ULog(str(file))
    assert log.msg_info_dict["sys_name"] == "jblast"
    local = log.get_dataset("vehicle_local_position").data
    np.testing.assert_allclose(local["timestamp"][[0, -1]], [0, 4_000_000])
    # north, east, down
    np.testing.assert_allclose([local[c][-1] for c in "xyz"], [0, 4, -10], atol=1e-6)
    assert (local["ref_lat"][0], local["xy_valid"][0]) == (HOME[0], 1)
    attitude = log.get_dataset("vehicle_attitude").data
    # level, ahead to the east: a quarter turn from north
    half = np.sqrt(0.5)
    told = [attitude[f"q[{n}]"][0] for n in range(4)]
    np.testing.assert_allclose(told, [half, 0, 0, half], atol=1e-7)
    status = log.get_dataset("vehicle_status").data["arming_state"]
    assert (status[0], status[-1]) == (2, 1)
