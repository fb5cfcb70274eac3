"""A vehicle without dynamics, served to a client: it is where its set point is."""

import threading
from collections.abc import Iterator
from contextlib import contextmanager

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jblast.autopilot.ground_station import BLOCK, Craft, GroundStation
from jblast.autopilot.lockstep import PERIOD_S, flight_of
from jblast.autopilot.mavlink import Link
from jblast.scene import Charge, Place, Scene, VehicleSpec
from jblast.vehicle import State, blast_load, hold_of

HOME = Place(47.0, 8.0, 500.0)


@eqx.filter_jit
def glided(guidance, now, state):
    def turn(carried, _):
        now, state = carried
        aim, now = guidance(state, now, jnp.asarray(PERIOD_S))
        up = jnp.maximum(aim.position_m, jnp.array([-jnp.inf, -jnp.inf, 0.0]))
        falls = jnp.where(aim.position_m[2] < 0, 0.0, aim.velocity_m_s)
        moved = State(up, falls, state.quaternion, *[0 * up, state.rotor_speed_rad_s])
        return (now, moved), None

    return jax.lax.scan(turn, (now, state), None, length=BLOCK)[0]


class Gliding(Craft):
    def _move(self):
        integral, now = self._memory
        now, self.state = jax.tree.map(
            np.asarray, glided(self._control.guidance, now, self.state)
        )
        self._memory = integral, now


def craft_at(*position: float, kind: type[Craft] = Gliding) -> Craft:
    spec = VehicleSpec("iris", position=jnp.array(position))
    scene = Scene(Charge(1.0, time_s=1000.0), vehicle=spec)
    steps, start = flight_of(scene, spec, blast_load(scene))
    return kind(steps, start, hold_of(spec, integral=True))


def station_of(
    link: Link, plan=None, speed=20.0, kind: type[Craft] = Gliding, **options
) -> GroundStation:
    """A station whose vehicle stands at home."""
    craft = craft_at(0, 0, 0, kind=kind)
    return GroundStation(link, craft, HOME, plan, speed=speed, **options)


@contextmanager
def served(kind: str, where: str, **options) -> Iterator[GroundStation]:
    """Serve a vehicle; the end of the client ends the service."""
    link = Link(kind, where, "ground_station", (1, 1))
    station = station_of(link, **options)
    station.compile()
    other = threading.Thread(target=station.serve, args=(60.0,))
    other.start()
    try:
        yield station
    finally:
        other.join()
        link.close()
    assert station.ended
