"""Scene: charge, air, ground, sensors, camera and vehicle in one value.

Air and ground are uniform. Properties that follow from the state of the air (sound
speed, density, absorption) are computed in `waves`.
"""

import math
from collections.abc import Sequence
from typing import Literal

import numpy as np

from jblast.errors import require
from jblast.parameters import PARAMETERS
from jblast.scene.camera import Camera
from jblast.scene.charge import Charge
from jblast.scene.sensor import Clock, Sensor, named_numbers
from jblast.types import (
    Array,
    Float,
    Module,
    Scalar,
    as_numbers,
    as_optional_number,
    field,
    number,
)

GroundPath = Literal["head", "thesis"]
HEIGHT_M = 30.0
"""Default scale height of the ambient sound above ground [m]; declared, the height of
trees and houses as sources."""


class Air(Module):
    """Uniform air.

    Attributes:
        temperature: Temperature [K].
        pressure: Ambient pressure [Pa].
        relative_humidity: Fraction, 0 to 1.
        altitude: Height above sea level [m]; if given, temperature and pressure are
            those of the standard atmosphere, and the two above are unused.
        sound_speed: Measured or fitted sound speed [m/s]; None derives it from
            temperature and humidity.
        wind_east: Wind towards east [m/s].
        wind_north: Wind towards north [m/s].
        absorption: Apply absorption also on the path up to Z = 300, although the laws'
            measured peaks already include some.
        absorption_scale: Absorption over that of ISO 9613-1 [-].
    """

    temperature: Scalar = number(default=PARAMETERS["air_temperature_k"].default)
    pressure: Scalar = number(default=PARAMETERS["air_pressure_pa"].default)
    relative_humidity: Scalar = number(
        default=PARAMETERS["air_relative_humidity"].default
    )
    altitude: Scalar | None = number(default=None)
    sound_speed: Scalar | None = number(default=None)
    wind_east: Scalar = number(default=0.0)
    wind_north: Scalar = number(default=0.0)
    absorption: bool = field(static=True, default=False)
    absorption_scale: Scalar = number(default=1.0)


class Ambient(Module):
    """Ambient sound: a recording in a loop, or coloured noise.

    Attributes:
        level: Noise on the ground, rms over its band [Pa].
        slope: How its spectrum rises with frequency [dB/octave]: 0 is white, -3 pink.
        height: Its amplitude falls by e over this height above ground [m].
        file: Recording to loop instead of noise; "" if there is none.
        full_scale: Pressure of a sample of 1 in that recording [Pa].
        loop: Samples of the recording [Pa], after the file is read.
        loop_rate: Their sample rate [Hz].
    """

    level: Scalar = number(default=0.0)
    slope: Scalar = number(default=0.0)
    height: Scalar = number(default=HEIGHT_M)
    file: str = field(static=True, default="")
    full_scale: Scalar = number(default=1.0)
    loop: Float[Array, " sample"] | None = field(
        converter=as_optional_number, default=None
    )
    loop_rate: float = field(static=True, converter=float, default=math.nan)

    def __check_init__(self) -> None:
        # The loop is read later: a scene file names only the recording.
        if self.loop is not None:
            row, shape = self.loop.ndim == 1 and self.loop.size > 1, self.loop.shape
            require(row, "ambient loop", "a row of two samples or more", shape)
            rate = self.loop_rate
            positive = 0 < rate < math.inf
            require(positive, "ambient loop_rate", "a positive, finite rate [Hz]", rate)


class Ground(Module):
    """Uniform rock.

    Attributes:
        p_speed: P-wave speed $c_s$ [m/s].
        path: Path of its wave to a sensor above it: "head" (along the surface only) or
            "thesis" (then up at the mean speed of the air shock).
    """

    p_speed: Scalar = number(default=PARAMETERS["ground_p_speed_m_s"].default)
    path: GroundPath = field(static=True, default="head")


class VehicleSpec(Module):
    """A vehicle with position control, or on a mission.

    Its model is defined in `jblast.vehicle`.

    Attributes:
        model: A name of `keys.VEHICLE_MODELS`.
        position: Initial position: east, north, up [m].
        target: Target position: east, north, up [m]; None: the initial position.
        velocity: Initial velocity: east, north, up [m/s].
        yaw: Initial and target heading, from east to north [rad].
        integral: Integral action of the controller; None: unspecified.
        gains: Controller gains, by the names kp_pos, kd_pos, ki_pos (3), kp_att,
            kd_att, integral_limit and motor_lead; others are those of the model.
        mission: File of its flight plan; None: position control.
        placed: True if `position` is given; else a mission starts at its plan's home.
    """

    model: str = field(static=True)
    position: Float[Array, "3"] = field(converter=as_numbers)
    target: Float[Array, "3"] | None = number(default=None)
    velocity: Float[Array, "3"] = field(
        converter=as_numbers, default_factory=lambda: np.zeros(3)
    )
    yaw: Scalar = number(default=0.0)
    integral: bool | None = field(static=True, default=None)
    gains: dict[str, Float[Array, "..."]] = field(
        converter=named_numbers, default_factory=dict
    )
    mission: str | None = field(static=True, default=None)
    placed: bool = field(static=True, default=True)

    @property
    def held(self) -> Float[Array, "3"]:
        """Target position: east, north, up [m]."""
        return self.position if self.target is None else self.target


def _several(charges: Charge | Sequence[Charge]) -> tuple[Charge, ...]:
    return (charges,) if isinstance(charges, Charge) else tuple(charges)


class Scene(Module):
    """All inputs of the records of the sensors.

    Attributes:
        charges: The charges; several have names. A single one may be given alone.
        air: Medium of the air shock.
        ground: Medium of the ground wave.
        sensors: All sensors but the camera.
        ambient: Sound without a blast, or None.
        camera: The camera, or None.
        vehicle: The vehicle, or None.
        clocks: Recorders' clocks, which may differ from the common one.
        law: Pairs of quantity and law name; a quantity without one is "auto".
        scatter: False for exact laws, without scatter of real blasts.
        instant_light: Neglect the travel time of light.
        sedov_gamma: Ratio of specific heats in the Sedov-Taylor law [-].
        fireball_growth: Time constant of fireballs' expansion [s]; None: that of
            the law.

    Example:
        `jblast.Scene(jblast.Charge(15.0), air=jblast.scene.Air(altitude=800.0))`
    """

    charges: tuple[Charge, ...] = field(converter=_several, default_factory=Charge)
    air: Air = field(default_factory=Air)
    ground: Ground = field(default_factory=Ground)
    sensors: tuple[Sensor, ...] = ()
    ambient: Ambient | None = None
    camera: Camera | None = None
    vehicle: VehicleSpec | None = None
    clocks: tuple[Clock, ...] = ()
    law: tuple[tuple[str, str], ...] = field(static=True, default=())
    scatter: bool = field(static=True, default=True)
    instant_light: bool = field(static=True, default=False)
    sedov_gamma: Scalar = number(default=PARAMETERS["sedov_gamma"].default)
    # None differs from a number: a fit can free it only if it is given.
    fireball_growth: Scalar | None = number(default=None)

    @property
    def charge(self) -> Charge:
        """The first charge, or the only one."""
        return self.charges[0]

    def label(self, charge: Charge) -> str:
        """Return the suffix of a number's name for a charge; "" for a single one."""
        # A single charge has plain names, also if the file names it.
        return f".{charge.name}" if len(self.charges) > 1 else ""

    def clock_offsets(self) -> dict[str, Float[Array, "..."]]:
        """Return the offset of every clock by name: a sensor's own, or a recorder's."""
        # A recorder takes precedence over a sensor of its name; the reader rejects a
        # file with offsets of both.
        own = {sensor.name: sensor.clock_offset_s for sensor in self.sensors}
        return own | {clock.name: clock.offset_s for clock in self.clocks}
