"""Logs of telemetry: written as the flight goes, and read by MAVLink's own tools."""

import struct
from collections import Counter

import pytest

from jblast.autopilot.logs import TelemetryLog
from jblast.autopilot.mavlink import Receiver, Sender
from jblast.autopilot.telemetry import telemetry_log
from jblast.errors import InputError
from tests.autopilot.logs.flights import eastward


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


def test_a_flight_is_told_ten_times_a_second_with_a_heartbeat_each():
    told = rows(telemetry_log(eastward(), has_mission=True))
    count = Counter(name for _, name, _ in told)
    assert count == {
        "ATTITUDE": 41,
        "GLOBAL_POSITION_INT": 41,
        "HEARTBEAT": 5,
        "MISSION_CURRENT": 2,
    }
    last = [values for _, name, values in told if name == "GLOBAL_POSITION_INT"][-1]
    # 4 m east at 47 degrees are 5.26e-5 degrees; it looks east, and stands
    assert last["lon"] == pytest.approx(8e7 + 526, abs=1)
    assert (last["lat"], last["alt"], last["relative_alt"]) == (470_000_000, 510_000, 0)
    assert (last["hdg"], last["vy"]) == (9000, 0)
    armed = [v["base_mode"] & 128 for _, name, v in told if name == "HEARTBEAT"]
    assert armed == [128] * 4 + [0]


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


def test_pymavlink_reads_it(tmp_path):
    tools = pytest.importorskip("pymavlink.mavutil")
    file = tmp_path / "flight.tlog"
    file.write_bytes(telemetry_log(eastward(), has_mission=False))
    log, count = tools.mavlink_connection(str(file), dialect="common"), Counter()
    while (message := log.recv_match()) is not None:
        count[message.get_type()] += 1
    log.close()
    assert count == {"ATTITUDE": 41, "GLOBAL_POSITION_INT": 41, "HEARTBEAT": 5}


def test_a_file_that_cannot_be_written_is_named(tmp_path):
    with pytest.raises(InputError, match="cannot be written: No such file"):
        TelemetryLog(tmp_path / "none" / "a.tlog")
