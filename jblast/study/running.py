"""A run of a world on one clock, in packets: what its senses record as time passes.

A run has the vehicle's motion, samples of sensors, frames and events of the camera. All
of them are divided into packets of equal duration. A subscriber takes the packets in
order of time, for example to write files, to show them or to search them for blasts.
"""

from dataclasses import dataclass, field
from typing import NamedTuple, Protocol

import numpy as np
from jaxtyping import Float, Int, UInt8

from jblast.scene import Charge
from jblast.world import Perceived


class Motion(NamedTuple):
    """Rows of the vehicle's motion, in order of time.

    Attributes:
        time_s: Time on the common clock.
        position_m: Position: east, north, up.
        velocity_m_s: Velocity: east, north, up.
        quaternion: Rotation from body (forward, left, up) to world axes, scalar last.
        body_rate_rad_s: Angular velocity along body axes.
        rotor_speed_rad_s: Speeds of the rotors.
        force_n: Force of the blasts and the air on the vehicle, world axes.
        moment_n_m: Moment likewise, body axes.
        set_point_m: Set point of the position controller.
        path_error_m: Distance from the set point.
        estimate_m: Estimated position; the true one without an estimator.
    """

    time_s: Float[np.ndarray, " row"]
    position_m: Float[np.ndarray, "row 3"]
    velocity_m_s: Float[np.ndarray, "row 3"]
    quaternion: Float[np.ndarray, "row 4"]
    body_rate_rad_s: Float[np.ndarray, "row 3"]
    rotor_speed_rad_s: Float[np.ndarray, "row 4"]
    force_n: Float[np.ndarray, "row 3"]
    moment_n_m: Float[np.ndarray, "row 3"]
    set_point_m: Float[np.ndarray, "row 3"]
    path_error_m: Float[np.ndarray, " row"]
    estimate_m: Float[np.ndarray, "row 3"]


class Samples(NamedTuple):
    """Contiguous samples of one sensor.

    Attributes:
        start_s: Beginning of the first sample, common clock.
        rate_hz: Samples per second.
        values: One column per component, in the unit of the sensor's kind; of an IMU
            specific force [m/s^2] and body rate [rad/s], its own axes.
    """

    start_s: float
    rate_hz: float
    values: Float[np.ndarray, "sample component"]


class Frames(NamedTuple):
    """Frames of the camera.

    Attributes:
        time_s: Beginning of each exposure, common clock.
        images: sRGB, 8 bits.
    """

    time_s: Float[np.ndarray, " frame"]
    images: UInt8[np.ndarray, "frame height width 3"]


class CameraEvents(NamedTuple):
    """Events of the camera, in order of time.

    Attributes:
        time_s: Times, common clock.
        x: Columns.
        y: Rows, down from the top.
        polarity: 1 brighter, -1 darker.
    """

    time_s: Float[np.ndarray, " event"]
    x: Int[np.ndarray, " event"]
    y: Int[np.ndarray, " event"]
    polarity: Int[np.ndarray, " event"]


@dataclass(frozen=True)
class RunDetection:
    """A blast that a detector of the run has reported.

    Attributes:
        sensor: Name of the sensor, or "camera".
        kind: "sound" or "flash".
        time_s: Estimated arrival of the wave at the sensor, or first light, common
            clock.
        sigma_s: Its standard deviation.
        reported_s: Time of the report: the end of the packet that completed it.
        statistic: Statistic of the detector.
        shot: Name of the blast whose true wave it agrees with; "" for a false alarm.
        true_s: Its true time; NaN for a false alarm.
    """

    sensor: str
    kind: str
    time_s: float
    sigma_s: float
    reported_s: float
    statistic: float
    shot: str
    true_s: float

    @property
    def latency_s(self) -> float:
        """Delay of the report after the wave reached the sensor [s]."""
        return self.reported_s - self.true_s


@dataclass
class Packet:
    """All that is recorded in one interval of the common clock.

    Attributes:
        start_s: Beginning.
        end_s: End, the beginning of the next packet.
        blasts: Charges that detonate within it.
        perceived: First perceptions within it.
        motion: Rows of the vehicle; None without one.
        samples: Samples of each sampling sensor, by name.
        frames: Frames; None without a camera.
        events: Camera events; None without a camera.
        detections: Detections that are reported at its end.
    """

    start_s: float
    end_s: float
    blasts: tuple[Charge, ...] = ()
    perceived: tuple[Perceived, ...] = ()
    motion: Motion | None = None
    samples: dict[str, Samples] = field(default_factory=dict)
    frames: Frames | None = None
    events: CameraEvents | None = None
    detections: tuple[RunDetection, ...] = ()


class Subscriber(Protocol):
    """Consumer of a run's packets. It must not change them."""

    def take(self, packet: Packet) -> None:
        """Process the next packet."""
        ...

    def finish(self) -> None:
        """Process the end of the run; called once, also after an error."""
        ...
