"""Log of telemetry: written as the flight goes, and read by MAVLink's own tools."""

import struct

import pytest

from jblast.autopilot.mavlink import Receiver, Sender, TelemetryLog
from jblast.errors import InputError


def rows(data: bytes) -> list[tuple[float, str, dict]]:
    """Time, name and values of each message."""
    found = []
    while data:
        (time,) = struct.unpack_from(">Q", data)
        size = 12 + data[9]
        (message,) = Receiver().feed(data[8 : 8 + size])
        found.append((time * 1e-6, message.name, message.values))
        data = data[8 + size :]
    return found


def test_what_was_written_before_the_end_is_there(tmp_path):
    file = tmp_path / "a.tlog"

    def flight() -> None:
        with TelemetryLog(file) as log:
            log.now_s = 1.5
            log.keep(Sender(1, 1).pack("HEARTBEAT", type=2))
            raise RuntimeError

    with pytest.raises(RuntimeError):
        flight()
    ((time, name, values),) = rows(file.read_bytes())
    assert (time, name, values["type"]) == (1.5, "HEARTBEAT", 2)
    log = pytest.importorskip("pymavlink.mavutil").mavlink_connection(
        str(file), dialect="common"
    )
    assert log.recv_match().get_type() == "HEARTBEAT"
    log.close()


def test_a_file_that_cannot_be_written_is_named(tmp_path):
    with pytest.raises(InputError, match="cannot be written: No such file"):
        TelemetryLog(tmp_path / "none" / "a.tlog")
