"""Kinds of sensors: one record for each, by name.

A record holds everything that the package needs to know of a kind: the keys of a scene
file (read by `scene.reader.sensors`), the recorder of its samples and the columns of
its file (`jblast listen`, `jblast world`), the waves that it perceives (`jblast
world`), and whether it moves with a vehicle, is picked and is tuned. `register` adds a
kind from any module. The recorder is named by its module (`jblast.lazy`), so that the
reader of scene files imports no physics of sensors.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, Literal, Protocol, runtime_checkable

from jblast.lazy import resolved
from jblast.parameters import POSITIVE, UNBOUNDED, Bounds
from jblast.registry import Registry

INSTRUMENT_KEYS = ("rate_hz", "full_scale_{}", "noise_{}", "bits", "filter_hz")
"""Keys of a scene file for an instrument; {} is the unit of its samples."""
SATURATION = "saturation"


@dataclass(frozen=True)
class SensorKey:
    """A number in a table [[sensor]] of a scene file.

    Attributes:
        name: With its unit: "response_time_s".
        words: Noun phrase for messages and the manual.
        default: Value without the key; None: the sensor has no such number.
        bounds: Accepted values.
    """

    name: str
    words: str
    default: float | None = None
    bounds: Bounds = UNBOUNDED


@runtime_checkable
class Recorder(Protocol):
    """Samples of a sensor over time, whole or in packets.

    A module with both functions is a recorder; `sensors.sampled_by` makes one of a
    function of scene, sensor and times. Both are pure, for jit, vmap and grad, with a
    static duration. `record` takes (scene, sensor, duration_s, key, *, start_s, laws)
    and returns samples, one row for each time; `stream` yields packets of them. That of
    a mountable kind takes a `track` too.
    """

    @property
    def record(self) -> Callable[..., Any]:
        """Return all samples of a duration."""
        ...

    @property
    def stream(self) -> Callable[..., Iterator[Any]]:
        """Yield packets of samples."""
        ...


@dataclass(frozen=True, kw_only=True)
class SensorKind:
    """All that the package needs to know of one kind of sensor.

    Attributes:
        name: `kind` in a scene file.
        words: Noun phrase for the manual.
        unit: Unit of its samples, as names of keys and columns end: "pa".
        columns: Of its file, one for each component of a sample; () without samples.
        recorder: Its samples: a recorder, or the module that is one; None without
            samples from the scene alone.
        magnitude: Column that is printed and drawn, the magnitude of several
            components; "" where the only component is.
        file: Suffix of its file: ".wav" in pascals, or ".csv".
        keys: Its own keys in a scene file, beside those of an instrument.
        site: Side of the ground on which it is placed; "" either.
        unmounted: Reason why a vehicle cannot carry it; "" where it can.
        senses: Waves that it perceives and the names of these sensations, by the
            quantity that times the wave.
        by_pressure: Whether the pressure of a blast reaches it, not its sound: a preset
            of `jblast world` may have another speed for it.
        is_picked: Whether `jblast world` picks readings from its samples.
        is_tuned: Whether `jblast tune` fits its records.
        hears_ambient: Whether its samples contain the ambient sound.
    """

    name: str
    words: str
    unit: str = ""
    columns: tuple[str, ...] = ()
    recorder: Recorder | str | None = None
    magnitude: str = ""
    file: Literal[".csv", ".wav"] = ".csv"
    keys: tuple[SensorKey, ...] = ()
    site: Literal["above", "in", ""] = ""
    unmounted: str = ""
    senses: tuple[tuple[str, str], ...] = ()
    by_pressure: bool = False
    is_picked: bool = False
    is_tuned: bool = False
    hears_ambient: bool = False

    @property
    def has_samples(self) -> bool:
        """Whether it writes samples over time, of the scene alone."""
        return self.recorder is not None

    @property
    def column(self) -> str:
        """Column that is printed and drawn."""
        return self.magnitude or self.columns[0]

    def instrument_keys(self) -> tuple[str, ...]:
        """Return the keys of its instrument; none without samples."""
        if not self.has_samples:
            return ()
        keys = (key.format(self.unit) for key in INSTRUMENT_KEYS)
        return (*keys, SATURATION)

    def samples(self) -> Recorder:
        """Return its recorder, imported now."""
        return resolved(self.recorder)


def sampling_kinds() -> tuple[str, ...]:
    """Return the names of the kinds that write samples."""
    return tuple(name for name, kind in SENSOR_KINDS.items() if kind.has_samples)


def all_instrument_keys() -> tuple[str, ...]:
    """Return the keys of the instruments of all kinds."""
    units = dict.fromkeys(kind.unit for kind in SENSOR_KINDS.values() if kind.columns)
    keys = [key.format(unit) for key in INSTRUMENT_KEYS for unit in units]
    return (*dict.fromkeys(keys), SATURATION)


def own_keys() -> tuple[str, ...]:
    """Return the keys of all kinds besides those of instruments."""
    every = (key.name for kind in SENSOR_KINDS.values() for key in kind.keys)
    return tuple(dict.fromkeys(every))


def has_key(kind: SensorKind, key: str) -> bool:
    """Return whether a key is one of a kind's own."""
    return any(one.name == key for one in kind.keys)


def hears_ambient(kind: str) -> bool:
    """Return whether samples contain the ambient sound; those of no kind do."""
    return kind not in SENSOR_KINDS or SENSOR_KINDS[kind].hears_ambient


def kind_of(name: str) -> SensorKind | None:
    """Return a kind; None for "", a sensor without one."""
    return SENSOR_KINDS[name] if name else None


_NOT_NEGATIVE = Bounds(at_least=0.0)
IMU_KEYS = (
    SensorKey("rate_hz", "samples a second", bounds=POSITIVE),
    SensorKey("full_scale_m_s2", "range of the accelerometer", bounds=POSITIVE),
    SensorKey("full_scale_rad_s", "range of the gyroscope", bounds=POSITIVE),
    SensorKey("noise_m_s2_sqrt_hz", "noise of the accelerometer", bounds=_NOT_NEGATIVE),
    SensorKey("noise_rad_s_sqrt_hz", "noise of the gyroscope", bounds=_NOT_NEGATIVE),
    SensorKey("bias_m_s2", "offset of the accelerometer", bounds=_NOT_NEGATIVE),
    SensorKey("bias_rad_s", "offset of the gyroscope", bounds=_NOT_NEGATIVE),
    SensorKey("bias_walk_m_s2_sqrt_s", "its random walk", bounds=_NOT_NEGATIVE),
    SensorKey("bias_walk_rad_s_sqrt_s", "its random walk", bounds=_NOT_NEGATIVE),
    SensorKey("bits", "bits of a sample"),
)
"""Defaults are those of `scene.Imu`."""
SENSOR_KINDS = Registry[SensorKind](
    "kind of sensor",
    SensorKind(
        name="pressure",
        words="pressure gauge",
        unit="pa",
        columns=("overpressure_pa",),
        recorder="jblast.sensors.pressure_gauge",
        site="above",
        senses=(("air_arrival_s", "pressure"),),
        by_pressure=True,
        is_picked=True,
        is_tuned=True,
    ),
    SensorKind(
        name="microphone",
        words="microphone",
        unit="pa",
        columns=("overpressure_pa",),
        recorder="jblast.sensors.microphone",
        file=".wav",
        site="above",
        senses=(("ground_arrival_s", "ground sound"), ("air_arrival_s", "sound")),
        is_picked=True,
        is_tuned=True,
        hears_ambient=True,
    ),
    SensorKind(
        name="anemometer",
        words="anemometer of three axes",
        unit="m_s",
        columns=("wind_east_m_s", "wind_north_m_s", "wind_up_m_s"),
        recorder="jblast.sensors.anemometer",
        magnitude="wind_speed_m_s",
        site="above",
        unmounted="an anemometer, whose motion is not supported yet",
        senses=(("air_arrival_s", "wind"),),
        by_pressure=True,
    ),
    SensorKind(
        name="geophone",
        words="geophone",
        unit="m_s",
        columns=("ground_velocity_m_s",),
        recorder="jblast.sensors.geophone",
        site="in",
        unmounted="a geophone, which stands on the ground",
        senses=(("ground_arrival_s", "ground motion"),),
    ),
    SensorKind(
        name="flash",
        words="detector of the flash",
        senses=(("flash_time_s", "flash"),),
    ),
    SensorKind(
        name="imu",
        words="accelerometer and gyroscope of a vehicle",
        keys=IMU_KEYS,
        senses=(("air_arrival_s", "jolt"),),
        by_pressure=True,
    ),
)
"""By name; `register` adds one from any module."""
register = SENSOR_KINDS.register
