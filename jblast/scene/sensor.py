"""Sensors, their instruments and their clocks.

An instrument converts the signal or motion at a sensor's position to recorded samples:
sample rate, range, noise, filters. Several sensors may share a clock.
"""

import math
from collections.abc import Mapping
from typing import Literal

import numpy as np

from jblast.constants import STANDARD_GRAVITY
from jblast.errors import require
from jblast.parameters import NOT_NEGATIVE, POSITIVE
from jblast.types import (
    Array,
    ArrayLike,
    Described,
    Float,
    Module,
    Scalar,
    as_numbers,
    field,
    namespace,
    number,
)

VECTORS = {
    "position_m": ("east", "north", "up"),
    "offset_m": ("forward", "left", "up"),
    "quaternion": ("x", "y", "z", "w"),
}
"""Components of a sensor's vectors."""
RATE_HZ = 48_000.0
"""Default sample rate [Hz]: that of audio recorders."""
Saturation = Literal["clip", "compress"]


def named_numbers(numbers: Mapping[str, ArrayLike]) -> dict[str, Float[Array, "..."]]:
    """Return numbers by name as arrays."""
    return {name: as_numbers(number) for name, number in numbers.items()}


class Imu(Module):
    """Accelerometer and gyroscope of three axes; samples are means over their interval.

    The defaults are those of a Bosch BMI088, which is on Crazyflie 2.1 and Pixhawk
    boards (data sheet BST-BMI088-DS001: range and bits; noise and offsets are quoted
    second hand): 24 g, 2000 degrees a second, 16 bits; noise of 160 ug and 0.014
    degrees a second per root hertz; offsets of 20 mg and 1 degree a second. Their
    random walk is not in the data sheet: declared, a tenth of the offset in 1000 s.

    Attributes:
        rate: Samples per second [Hz].
        accelerometer_range: Largest magnitude of an axis [m/s2].
        gyroscope_range: Largest magnitude of an axis [rad/s].
        accelerometer_noise: One-sided density of white noise [m/s2/sqrt(Hz)].
        gyroscope_noise: One-sided density of white noise [rad/s/sqrt(Hz)].
        accelerometer_bias: Standard deviation of the offset of an axis at switch-on
            [m/s2].
        gyroscope_bias: Standard deviation of the offset of an axis at switch-on
            [rad/s].
        accelerometer_walk: Standard deviation of the random walk of the offset in one
            second [m/s2/sqrt(s)].
        gyroscope_walk: Standard deviation of the random walk of the offset in one
            second [rad/s/sqrt(s)].
        bits: Bits of a sample; None: floating-point numbers.
    """

    rate: float = field(static=True, converter=float, default=1000.0)
    accelerometer_range: Scalar = number(default=24 * STANDARD_GRAVITY)
    gyroscope_range: Scalar = number(default=math.radians(2000))
    accelerometer_noise: Scalar = number(default=160e-6 * STANDARD_GRAVITY)
    gyroscope_noise: Scalar = number(default=math.radians(0.014))
    accelerometer_bias: Scalar = number(default=20e-3 * STANDARD_GRAVITY)
    gyroscope_bias: Scalar = number(default=math.radians(1))
    accelerometer_walk: Scalar = number(
        default=20e-3 * STANDARD_GRAVITY / 10 / math.sqrt(1000)
    )
    gyroscope_walk: Scalar = number(default=math.radians(1) / 10 / math.sqrt(1000))
    bits: int | None = field(static=True, default=16)

    def sample_noise(self) -> Float[Array, "2"]:
        """Return standard deviations of a sample's noise: accelerometer, gyroscope.

        The mean over an interval 1/f has the noise bandwidth f/2 of a one-sided
        spectrum.
        """
        half = math.sqrt(self.rate / 2)
        noise = self.accelerometer_noise, self.gyroscope_noise
        return half * namespace(*noise).stack(noise)


class Instrument(Module):
    """Response and errors of an instrument; the default is an ideal one.

    Full scale and noise are in the unit of the sensor's kind: Pa for a microphone, m/s
    for a geophone (`scene.sensor_kinds`).

    Attributes:
        rate: Samples per second [Hz].
        full_scale: Largest magnitude of a sample; None: unlimited.
        noise: Its own noise, rms; None: no noise.
        bits: Bits of a sample over the range of the full scale; None: samples are
            floating-point numbers.
        high_pass: Corner frequency of its high-pass filter [Hz]; None: no filter.
        low_pass: Corner frequency of its low-pass filter [Hz]; None: no filter.
        saturation: Response above the full scale: "clip" is limited to it, "compress"
            approaches it smoothly.
        noise_slope: Slope of that noise above 20 Hz [dB/octave]; None: it is white.
        wind_noise: Pressure of wind on its membrane: rms over the air's density and the
            square of its speed [-]; None: no pressure.
    """

    rate: float = field(static=True, converter=float, bounds=POSITIVE, default=RATE_HZ)
    full_scale: Scalar | None = number(bounds=POSITIVE, default=None)
    noise: Scalar | None = number(bounds=NOT_NEGATIVE, default=None)
    bits: int | None = field(static=True, bounds=POSITIVE, default=None)
    high_pass: Scalar | None = number(bounds=POSITIVE, default=None)
    low_pass: Scalar | None = number(bounds=POSITIVE, default=None)
    saturation: Saturation = field(static=True, default="clip")
    noise_slope: Scalar | None = number(default=None)
    wind_noise: Scalar | None = number(default=None)

    def __check_init__(self) -> None:
        # The quantization step is the range over 2**bits.
        ranged = self.bits is None or self.full_scale is not None
        expected = f"the range of {self.bits} bits"
        require(ranged, "instrument full_scale", expected, "none")


class Sensor(Described):
    """Position, instrument and recorded quantities of a sensor.

    Attributes:
        name: As in the observation file.
        position_m: East, north, up [m].
        kind: A name of `scene.sensor_kinds` (pressure, microphone, ...); "" if unknown.
        clock_offset_s: Sensor clock minus common clock [s].
        records: Pairs of quantity and sigma: seconds for times, radians for directions,
            relative otherwise.
        times_s: Times of readings that have one, as radii, by its clock [s].
        instrument: Response to the signal that it samples, if it is given.
        imu: Response to the motion that it samples, if it is given.
        mount: "" for none, "vehicle" for the scene's vehicle. Then its position is NaN,
            like that of any sensor without a given position.
        offset_m: Position relative to the centre of its mount, body axes: forward,
            left, up [m].
        quaternion: Sensor to body (x, y, z, w), scalar last.
        settings: Numbers specific to its kind, by key of a scene file.

    Raises:
        InputError: A vector has the wrong number of components.
        TypeError: A keyword that no attribute has, or text in place of a number.

    Example:
        `Sensor("gate", (20.0, 0.0, 1.5), records=(("air_arrival_s", 1e-3),))`
    """

    name: str = field(static=True)
    position_m: Float[Array, "3"] = field(converter=as_numbers)
    kind: str = field(static=True, default="")
    clock_offset_s: Scalar = number(default=0.0)
    records: tuple[tuple[str, float], ...] = field(static=True, default=())
    times_s: tuple[float, ...] = field(static=True, default=())
    instrument: Instrument | None = None
    imu: Imu | None = None
    mount: str = field(static=True, default="")
    offset_m: Float[Array, "3"] = field(
        converter=as_numbers,
        default_factory=lambda: np.zeros(3),
    )
    quaternion: Float[Array, "4"] = field(
        converter=as_numbers, default_factory=lambda: np.eye(4)[3]
    )
    settings: dict[str, Float[Array, ""]] = field(
        converter=named_numbers, default_factory=dict
    )

    def __check_init__(self) -> None:
        for name, numbers in VECTORS.items():
            shape, where = getattr(self, name).shape, f"sensor {self.name} {name}"
            expected = f"{len(numbers)} numbers: {', '.join(numbers)}"
            whole = shape[-1:] == (len(numbers),)
            require(whole, where, expected, f"shape {shape}")


class Clock(Described):
    """A clock that a log names.

    Attributes:
        name: As in the log's `clock` column.
        offset_s: This clock minus the common one [s].

    Raises:
        TypeError: A keyword that no attribute has.
    """

    name: str = field(static=True)
    offset_s: Scalar = number(default=0.0)
