"""A ground station that MAVSDK runs, on a free port of this machine."""

import asyncio
import contextlib
import socket
import time
from collections.abc import AsyncIterator, Awaitable
from typing import Any

from mavsdk.asyncio import ComponentType, Configuration, Mavsdk
from mavsdk.asyncio.plugins.action import ActionAsync, ActionError
from mavsdk.asyncio.plugins.mission import MissionAsync, MissionItem, MissionPlan
from mavsdk.asyncio.plugins.telemetry import TelemetryAsync

WAIT_S = 400.0
"""Longest wait for a state of the vehicle: flights compile for minutes."""


def free_port() -> int:
    """Return a free UDP port."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one:
        one.bind(("127.0.0.1", 0))
        return one.getsockname()[1]


class Client:
    """MAVSDK's plugins for one vehicle."""

    def __init__(self, system):
        self.action = ActionAsync(system)
        self.mission = MissionAsync(system)
        self.telemetry = TelemetryAsync(system)

    async def until(self, name: str, wanted) -> Any:
        """Return the first value of a telemetry subscription that is wanted."""

        async def first():
            async for value in getattr(self.telemetry, f"subscribe_{name}")():
                if wanted(value):
                    return value
            return None

        return await asyncio.wait_for(first(), WAIT_S)


async def refused(request: Awaitable) -> str:
    """Return the name of the result of a refused action."""
    try:
        await request
    except ActionError as error:
        return error.args[0].name
    return ""


def plan_of(count: int, up_m: float = 10.0, step_deg: float = 1e-4) -> MissionPlan:
    """Return waypoints towards north, 11 m from one another by default."""
    return MissionPlan(
        [
            MissionItem(
                latitude_deg=47 + n * step_deg,
                longitude_deg=8.0,
                relative_altitude_m=up_m,
                speed_m_s=5.0,
                is_fly_through=True,
            )
            for n in range(1, count + 1)
        ]
    )


@contextlib.asynccontextmanager
async def connected(port: int) -> AsyncIterator[Client]:
    """Wait for the vehicle that sends to a port."""
    kind = ComponentType.GROUND_STATION
    async with Mavsdk(Configuration.create_with_component_type(kind)) as sdk:
        await sdk.add_any_connection(f"udpin://127.0.0.1:{port}")
        system = await sdk.first_autopilot(timeout_s=WAIT_S)
        assert system is not None
        yield Client(system)


async def gaps(client: Client, seconds: list[float]) -> None:
    """Record the times between two heartbeats of the vehicle."""
    last = time.monotonic()
    async for _ in client.telemetry.subscribe_flight_mode():
        seconds.append(time.monotonic() - last)
        last = time.monotonic()
