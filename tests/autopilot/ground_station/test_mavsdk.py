"""A client nobody here wrote: MAVSDK finds, checks, loads and flies the vehicle."""

import asyncio

import numpy as np
import pytest

from tests.autopilot.ground_station.gliding import HOME, served

pytest.importorskip("mavsdk")

from tests.autopilot.ground_station.mavsdk_client import (
    connected,
    free_port,
    plan_of,
    refused,
)


async def exchange(port: int) -> dict:
    """Check, load, arm, start and disarm; return what MAVSDK received."""
    got: dict = {"progress": []}
    async with connected(port) as client:
        await client.until("health_all_ok", bool)
        got["battery"] = await client.until("battery", lambda x: True)
        got["home"] = await client.until("home", lambda x: True)
        got["params"] = await client.param.get_all_params()
        await client.action.set_takeoff_altitude(8.0)
        got["height"] = await client.action.get_takeoff_altitude()
        await client.action.set_return_to_launch_altitude(9.0)
        got["return"] = await client.action.get_return_to_launch_altitude()
        got["reboot"] = await refused(client.action.reboot())
        got["disarmed"] = await refused(client.action.takeoff())
        await client.telemetry.set_rate_position(5.0)
        await client.mission.set_return_to_launch_after_mission(True)
        await client.mission.upload_mission(plan_of(2))
        got["plan"] = (await client.mission.download_mission()).mission_items
        await client.action.arm()
        await client.until("armed", bool)
        await client.mission.start_mission()
        async for now in client.mission.subscribe_mission_progress():
            got["progress"].append((now.current, now.total))
            if now.current == now.total:
                break
        got["in flight"] = (await client.until("flight_mode", lambda x: True)).name
        await client.until("armed", lambda armed: not armed)
        await client.action.disarm()
    return got


@pytest.mark.slow
def test_mavsdk_checks_loads_arms_starts_and_disarms_it():
    port = free_port()
    with served("udp", f"127.0.0.1:{port}"):
        got = asyncio.run(exchange(port))
    assert got["battery"].remaining_percent == 100
    assert (got["home"].latitude_deg, got["home"].longitude_deg) == HOME[:2]
    floats = {one.name: one.value for one in got["params"].float_params}
    assert floats["RTL_RETURN_ALT"] == 30
    assert (got["height"], got["return"]) == (8.0, 9.0)
    assert (got["reboot"], got["disarmed"]) == ("UNSUPPORTED", "COMMAND_DENIED")
    np.testing.assert_allclose(
        [one.latitude_deg for one in got["plan"]], [47.0001, 47.0002], atol=1e-9
    )
    assert got["progress"][-1] == (2, 2)
    assert got["in flight"] == "MISSION"
