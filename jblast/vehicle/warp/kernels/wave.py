"""The waves of `loads/blast/wave.py` as functions of Warp, in one precision."""

from functools import cache
from types import SimpleNamespace
from typing import no_type_check

import numpy as np
import warp as wp

from jblast.vehicle.loads.blast.wave import FIRST, WaveCurves, wave_curves
from jblast.vehicle.warp.kernels.body import body_functions

BURSTS = ("surface", "free-air")
"""Of each the curves of `WaveCurves`, in this order."""

COLUMNS = (
    *("east", "north", "up", "time", "nearest", "log_scale", "log_impulse_scale"),
    *("time_scale", "sound_speed", "wind_east", "wind_north", "wind_up", "density"),
)
"""Numbers of a blast: where and when, $S_d$ times the curves' start, ln S_d, ln S_d of
the mass for impulses, its $S_t$, and the air."""


def curve_table() -> np.ndarray:
    """Return coefficients of all curves: (curve, stretch, 4)."""
    return np.stack(
        [curve.coefficients for burst in BURSTS for curve in wave_curves(burst)]
    )


@cache
@no_type_check
def wave_functions(real: type) -> SimpleNamespace:
    """Return types and functions of a wave at a place.

    Args:
        real: `wp.float32` or `wp.float64`.
    """
    vec3, vec4 = body_functions(real).vec3, body_functions(real).vec4
    curves = wave_curves("surface")
    nodes = curves.sound_fraction.nodes
    # slopes past the last node, of each curve
    slopes = [c.slope_after for burst in BURSTS for c in wave_curves(burst)]
    outer = wp.constant(wp.types.vector(len(slopes), real)(*slopes))
    first, last = wp.constant(real(nodes[0])), wp.constant(real(nodes[-1]))
    per_spacing = wp.constant(real((len(nodes) - 1) / (nodes[-1] - nodes[0])))
    stretches = wp.constant(len(nodes) - 1)
    own = wp.constant(len(WaveCurves._fields))
    names = {name: wp.constant(n) for n, name in enumerate(WaveCurves._fields)}
    ARRIVAL, PEAK, DURATION = names["sound_fraction"], names["peak"], names["duration"]
    DECAY, SUCTION = names["decay"], names["suction"]
    assert nodes[0] <= np.log(FIRST) + 1e-12

    class Blasts:
        """Rows: for each blast, then of `COLUMNS`, a column for each vehicle or one.

        Besides, of each blast its curves and the parts of its load; all the curves; and
        of Gauss's rule a row a node: place, weight, weights of the integral so far.
        """

        count: int
        rows: wp.array3d[real]
        burst: wp.array[int]
        parts: wp.array[int]
        curves: wp.array2d[vec4]
        gauss: wp.array2d[real]

    class Way:
        """From a blast to a place."""

        distance: real
        away: vec3
        speed: real

    class Wave:
        """As `loads.blast.wave.Wave`."""

        peak: real
        duration: real
        decay: real
        suction: real
        suction_time: real
        sound_speed: real
        afterflow: real

    Blasts, Way, Wave = wp.struct(Blasts), wp.struct(Way), wp.struct(Wave)

    @wp.func
    def lane_of(blasts: Blasts, lane: int) -> int:
        """Return where a vehicle's numbers stand."""
        return wp.min(lane, blasts.rows.shape[2] - 1)

    @wp.func
    def curve(blasts: Blasts, n: int, log_z: real) -> real:
        """Return the value of a curve; nearer than its start, that of the start."""
        inside = wp.clamp(log_z, first, last)
        way = (inside - first) * per_spacing
        stretch = wp.min(int(way), stretches - 1)
        t = way - real(stretch)
        c = blasts.curves[n, stretch]
        past = wp.max(log_z - last, real(0.0))
        return c[0] + t * (c[1] + t * (c[2] + t * c[3])) + outer[n] * past

    @wp.func
    def way_to(blasts: Blasts, b: int, n: int, place: vec3) -> Way:
        """Return distance, direction and speed of sound along it."""
        off = place - vec3(
            blasts.rows[b, 0, n], blasts.rows[b, 1, n], blasts.rows[b, 2, n]
        )
        way = Way()
        way.distance = wp.max(wp.length(off), blasts.rows[b, 4, n])
        way.away = off / way.distance
        way.speed = blasts.rows[b, 8, n]
        way.speed += way.away[0] * blasts.rows[b, 9, n]
        way.speed += way.away[1] * blasts.rows[b, 10, n]
        return way

    @wp.func
    def since_arrival(blasts: Blasts, b: int, n: int, way: Way, time: real) -> real:
        """Return the time since the front came, from the start of the way."""
        log_z = wp.log(way.distance) - blasts.rows[b, 5, n]
        fraction = wp.exp(curve(blasts, blasts.burst[b] * own + ARRIVAL, log_z))
        return time - blasts.rows[b, 3, n] - way.distance / way.speed * fraction

    @wp.func
    def pulse_impulse(x: real, peak: real, duration: real, decay: real) -> real:
        """As `loads.blast.wave._pulse_impulse`."""
        left = wp.exp(-decay * x)
        gone = real(1.0) - left
        part = ((decay - real(1.0)) * gone + decay * x * left) / (decay * decay)
        return peak * duration * part

    @wp.func
    def wave_at(blasts: Blasts, b: int, n: int, distance: real) -> Wave:
        """As `loads.blast.wave.wave_at`."""
        log_r = wp.log(distance)
        log_z = log_r - blasts.rows[b, 5, n]
        row = blasts.burst[b] * own
        wave = Wave()
        wave.peak = wp.exp(curve(blasts, row + PEAK, log_z))
        wave.suction = wp.exp(curve(blasts, row + SUCTION, log_z))
        wave.decay = curve(blasts, row + DECAY, log_z)
        own_z = log_r - blasts.rows[b, 6, n]
        wave.duration = wp.exp(curve(blasts, row + DURATION, own_z))
        wave.duration = wave.duration * blasts.rows[b, 7, n]
        impulse = pulse_impulse(real(1.0), wave.peak, wave.duration, wave.decay)
        wave.suction_time = real(16.0) / real(9.0) * impulse / wave.suction
        c = blasts.rows[b, 8, n]
        wave.sound_speed = c
        wave.afterflow = c * c / (real(1.4) * distance)
        return wave

    @wp.func
    def overpressure(wave: Wave, since: real) -> real:
        """As `loads.blast.wave.overpressure`."""
        if since < real(0.0):
            return real(0.0)
        x = wp.clamp(since / wave.duration, real(0.0), real(1.0))
        later = (since - wave.duration) / wave.suction_time
        s = wp.clamp(later, real(0.0), real(1.0))
        left = (real(1.0) - s) * (real(1.0) - s)
        pulse = wave.peak * (real(1.0) - x) * wp.exp(-wave.decay * x)
        return pulse - real(6.75) * wave.suction * s * left

    @wp.func
    def wind_speed(wave: Wave, since: real, p: real) -> real:
        """As `loads.blast.wave.wind_speed`; p: the overpressure then."""
        x = wp.clamp(since / wave.duration, real(0.0), real(1.0))
        later = (since - wave.duration) / wave.suction_time
        s = wp.clamp(later, real(0.0), real(1.0))
        given = pulse_impulse(x, wave.peak, wave.duration, wave.decay)
        curved = real(0.5) - real(2.0) / real(3.0) * s + real(0.25) * s * s
        given -= wave.suction * wave.suction_time * real(6.75) * s * s * curved
        plane = real(5.0) / real(7.0) * wave.sound_speed * p
        plane = plane / wp.sqrt(real(1.0) + real(6.0) / real(7.0) * p)
        return plane + wave.afterflow * given

    return SimpleNamespace(
        Blasts=Blasts,
        Way=Way,
        Wave=Wave,
        lane_of=lane_of,
        way_to=way_to,
        since_arrival=since_arrival,
        wave_at=wave_at,
        overpressure=overpressure,
        wind_speed=wind_speed,
    )
