r"""Where and when a moving place meets a wave, and how fast the wave passes it.

With $a(\mathbf x)$ the arrival at a place and $\mathbf x(t)$ the track, they meet at
the root of $a(\mathbf x(t)) = t$, and the phase of the wave that the place feels is

$$\varphi(t) = t - a(\mathbf x(t))$$

the time since arrival where the place is just then: exact along any track, its bends
included. So Doppler's shift is not a formula here: near the meeting the phase runs
$1 - \mathrm da/\mathrm dt$ times as fast as the clock. Peak, duration and impulse are
those of the place of meeting; over the length of a pulse they do not change (a wave
30 m long passes in 0.1 s).
"""

from collections.abc import Callable, Mapping

import jax
import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, Float

from jblast.scene import Scene
from jblast.sensors.arrivals.track import Track
from jblast.sensors.arrivals.waves_at import wave_at
from jblast.sensors.arrivals.way import Heard, Way, arrival_time, ways
from jblast.waves.pulse import GroundPulse

STEPS = 30
r"""Of the iteration $t \leftarrow a(\mathbf x(t))$: its error falls each time by
the Mach number, to rounding below 0.3. Newton's last step squares it."""


def meeting_time(
    arrival: Callable[[Float[Array, ""]], Float[Array, ""]], first: Float[Array, ""]
) -> Float[Array, ""]:
    """Return the root of arrival(t) = t, differentiable as an implicit function.

    Args:
        arrival: When the wave comes to where the place is at a time [s].
        first: Where to start [s].
    """
    near = lax.stop_gradient(
        lax.fori_loop(0, STEPS, lambda _, t: lax.stop_gradient(arrival(t)), first)
    )
    late, rate = jax.jvp(arrival, (near,), (jnp.ones_like(near),))
    # Newton's step: the derivative of its value is that of the root
    return near + (late - near) / lax.stop_gradient(1.0 - rate)


def phase(
    scene: Scene,
    track: Track,
    laws: Mapping[str, str],
    wave: Heard,
    time: Float[Array, " edge"],
) -> Float[Array, " edge"]:
    """Return the time since a wave's arrival where the place is, at each time [s].

    Args:
        scene: What is there.
        track: Where the place is.
        laws: By quantity.
        wave: One of `meeting_waves`.
        time: On the common clock [s].
    """
    arrives = jax.vmap(
        lambda place: arrival_time(scene, place, laws, wave.shot, wave.kind)
    )
    return time - arrives(track.at(time))


def meeting_waves(
    scene: Scene,
    track: Track,
    laws: Mapping[str, str],
    reflection: float | Float[Array, ""],
    ground: bool,
) -> tuple[Heard, ...]:
    """Return the waves that a moving place meets, as they are at the place of meeting.

    Args:
        scene: What is there.
        track: Where the place is.
        laws: By quantity.
        reflection: Coefficient of the ground.
        ground: Whether the moving ground is heard, too.
    """
    found = []
    for shot, way in ways(scene, reflection, ground):

        def arrival(time: Array, shot: int = shot, way: Way = way) -> Array:
            return arrival_time(scene, track.at(time), laws, shot, way)

        time = meeting_time(arrival, arrival(track.time[0]))
        found.append(wave_at(scene, track.at(time), laws, shot, way, reflection))
    return tuple(found)


def passing(scene: Scene, track: Track, laws: Mapping[str, str], wave: Heard) -> Heard:
    """Return a wave with its times as they pass a moving place.

    Args:
        scene: What is there.
        track: Where the place is.
        laws: By quantity.
        wave: One of `meeting_waves`.
    """

    def since(time):
        return phase(scene, track, laws, wave, time[None])[0]

    pulse, time = wave.pulse, wave.pulse.arrival_time
    some = jnp.where(jnp.isposinf(time), 0.0, time)
    speed = jax.jvp(since, (some,), (jnp.ones_like(some),))[1]
    if isinstance(pulse, GroundPulse):
        slower = {"amplitude": pulse.amplitude, "time_constant": pulse.time_constant}
    else:
        slower = {
            "rise_time": pulse.rise_time,
            "hold_time": pulse.hold_time,
            "duration": pulse.duration,
            "suction_duration": pulse.suction_duration,
        }
    slower = {name: length / speed for name, length in slower.items()}
    return wave._replace(pulse=pulse._replace(**slower))
