"""MAVSDK flies a mission that `jblast serve` simulates, and lands."""

import asyncio
import json
import threading

import numpy as np
import pytest

pytest.importorskip("mavsdk")

from tests.autopilot.mavsdk_client import (
    connected,
    free_port,
    gaps,
    plan_of,
    refused,
)

STEP_DEG = 4e-4
"""Distance of two waypoints: 44 m, 3 s of the wall clock at the speed of the test."""
MISSION = """
[charge]
mass_kg = 1.0
position_m = [30, 5, 0]
time_s = 20.0
[vehicle]
model = "iris"
position_m = [0, 0, 0]
[place]
lat_deg = 47.0
lon_deg = 8.0
alt_m = 500.0
"""


async def whole_flight(port: int) -> dict:
    """Take off, start a mission, pause, continue, land and disarm."""
    got: dict = {"gaps": [], "places": []}
    async with connected(port) as client:

        async def places():
            async for now in client.telemetry.subscribe_position():
                got["places"].append(
                    (now.latitude_deg, now.longitude_deg, now.relative_altitude_m)
                )

        watched = [asyncio.create_task(gaps(client, got["gaps"]))]
        watched += [asyncio.create_task(places())]
        await client.until("health_all_ok", bool)
        await client.action.set_takeoff_altitude(6.0)
        await client.action.arm()
        await client.action.takeoff()
        await client.until("position", lambda now: now.relative_altitude_m > 5.5)
        await client.until("flight_mode", lambda mode: mode.name == "HOLD")
        await client.mission.upload_mission(plan_of(3, step_deg=STEP_DEG))
        await client.mission.start_mission()
        await client.until(
            "position", lambda now: now.latitude_deg > 47 + 1.2 * STEP_DEG
        )
        await client.mission.pause_mission()
        await client.until("flight_mode", lambda mode: mode.name == "HOLD")
        got["disarm in flight"] = await refused(client.action.disarm())
        await client.until("velocity_ned", lambda now: abs(now.north_m_s) < 0.1)
        got["paused"] = got["places"][-1]
        await client.mission.start_mission()
        async for now in client.mission.subscribe_mission_progress():
            if now.current == now.total == 3:
                break
        got["end"] = got["places"][-1]
        await client.action.land()
        await client.until("armed", lambda armed: not armed)
        got["landed"] = await client.until("in_air", lambda now: not now)
        got["rest"] = got["places"][-1]
        await client.action.disarm()
        for task in watched:
            task.cancel()
    return got


@pytest.mark.slow
def test_mavsdk_flies_a_whole_mission_and_lands(jblast):
    port, flown = free_port(), {}

    def fly():
        flown.update(asyncio.run(whole_flight(port)))

    client = threading.Thread(target=fly)
    client.start()
    address = f"udp:127.0.0.1:{port}"
    words = ["--ground-station", address, "--speed", "3", "--json"]
    code, out, _ = jblast("serve", jblast.file("scene.toml", MISSION), *words)
    client.join()
    assert (code, json.loads(out)["flights"]) == (0, 1)
    assert flown["disarm in flight"] == "COMMAND_DENIED"
    # Past the first waypoint and before the third.
    assert 47 + 1.2 * STEP_DEG < flown["paused"][0] < 47 + 2.9 * STEP_DEG
    np.testing.assert_allclose(flown["end"][:2], (47 + 3 * STEP_DEG, 8.0), atol=1e-5)
    np.testing.assert_allclose(flown["rest"][:2], (47 + 3 * STEP_DEG, 8.0), atol=1e-5)
    assert abs(flown["rest"][2]) < 0.2
    # 15 m in a second of the wall clock: a new path continues the present one.
    steps = np.diff(np.array(flown["places"]) * (111_195, 75_900, 1), axis=0)
    assert np.linalg.norm(steps, axis=1).max() < 15.0
    # The other tests of a busy machine delay some; 20 to 120 s was a compilation.
    assert max(flown["gaps"]) < 5.0
