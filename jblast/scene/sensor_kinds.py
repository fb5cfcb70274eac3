"""Registry of the kinds of sensors, one record each.

A record has all properties of a kind: the keys of a scene
file (read by `scene.reader`), the sources of its samples and the columns of
its file (`jblast listen`, `jblast world`), the waves that it perceives (`jblast
world`), and whether it moves with a vehicle, is picked and is tuned. `register` adds a
kind from any module. The sources are named by their path (`jblast.lazy`), so that the
reader of scene files imports no physics of sensors.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Literal

from jblast.parameters import NOT_NEGATIVE, POSITIVE, Bounds
from jblast.registry import Registry
from jblast.scene.values import Number, Numbers, SceneKey, Whole, Word

# Converters of 8 bits are the coarsest in use; 32 bits exceed any noise floor.
BITS = Whole(8, 32, word="float")
BAND = Numbers("[high-pass, low-pass]", Number(POSITIVE), rising=True, word="none")
SATURATIONS = ("clip", "compress")


def instrument_keys(unit: str) -> tuple[SceneKey, ...]:
    """Return the keys of an instrument whose samples have a unit."""
    return (
        SceneKey("rate_hz", Number(POSITIVE), "instrument.rate"),
        SceneKey(f"full_scale_{unit}", Number(POSITIVE), "instrument.full_scale"),
        SceneKey(f"noise_{unit}", Number(NOT_NEGATIVE), "instrument.noise"),
        # The quantization step is the range over 2**bits.
        SceneKey("bits", BITS, "instrument.bits", needs=(f"full_scale_{unit}",)),
        SceneKey("filter_hz", BAND, "instrument.filter_hz"),
        SceneKey("saturation", Word(SATURATIONS), "instrument.saturation"),
    )


@dataclass(frozen=True, kw_only=True)
class SensorKind:
    """Registry entry of one kind of sensor.

    Attributes:
        name: `kind` in a scene file.
        words: Noun phrase for documentation.
        unit: Unit of its samples, in the spelling of keys and columns: "pa".
        columns: Columns of its file, one per component; () without samples.
        sources: Function of scene, sensor, position or track, laws and three random
            keys that returns the summands of its signal (`sensors.recorder.Source`), or
            its path; None without samples from the scene alone.
        magnitude: Column to print and draw, the magnitude of several components; ""
            for a single component.
        file: Suffix of its file: ".wav" in pascals, or ".csv".
        keys: Keys in a scene file, except those of an instrument.
        site: Side of the ground on which it is placed; "": either.
        unmounted: Reason why a vehicle cannot carry it; "" if it can.
        senses: Pairs of wave (named by its arrival time) and sense.
        is_picked: True if `jblast world` picks readings from its samples.
        is_tuned: True if `jblast tune` fits its records.
        hears_ambient: True if its samples contain the ambient sound.
    """

    name: str
    words: str
    unit: str = ""
    columns: tuple[str, ...] = ()
    sources: Callable[..., tuple[Any, ...]] | str | None = None
    magnitude: str = ""
    file: Literal[".csv", ".wav"] = ".csv"
    keys: tuple[SceneKey, ...] = ()
    site: Literal["above", "in", ""] = ""
    unmounted: str = ""
    senses: tuple[tuple[str, str], ...] = ()
    is_picked: bool = False
    is_tuned: bool = False
    hears_ambient: bool = False

    @property
    def column(self) -> str:
        """Column to print and draw."""
        return self.magnitude or self.columns[0]


def sampling_kinds() -> tuple[str, ...]:
    """Return the names of the kinds that write samples."""
    return tuple(name for name, kind in SENSOR_KINDS.items() if kind.sources)


def kind_keys(kind: str) -> tuple[SceneKey, ...]:
    """Return the keys of a kind: its own, and those of an instrument with samples."""
    # A sensor without a kind records pressure.
    known = SENSOR_KINDS[kind or "pressure"]
    own = [k if k.field else replace(k, field=f"settings.{k.name}") for k in known.keys]
    return (*own, *(instrument_keys(known.unit) if known.sources else ()))


def hears_ambient(kind: str) -> bool:
    """Return whether a kind's samples contain ambient sound; True without a kind."""
    # A sensor without a kind may be a microphone: it keeps its background.
    return kind not in SENSOR_KINDS or SENSOR_KINDS[kind].hears_ambient


MAX_IMU_RATE_HZ = 1e5
"""Maximum sampling rate of an IMU [Hz]; declared: MEMS units reach some 10 kHz."""
IMU_KEYS = tuple(
    SceneKey(name, value, f"imu.{field}", needs=('mount = "vehicle"',))
    for name, value, field in (
        ("rate_hz", Number(Bounds(above=0.0, at_most=MAX_IMU_RATE_HZ)), "rate"),
        ("full_scale_m_s2", Number(POSITIVE), "accelerometer_range"),
        ("full_scale_rad_s", Number(POSITIVE), "gyroscope_range"),
        ("noise_m_s2_sqrt_hz", Number(NOT_NEGATIVE), "accelerometer_noise"),
        ("noise_rad_s_sqrt_hz", Number(NOT_NEGATIVE), "gyroscope_noise"),
        ("bias_m_s2", Number(NOT_NEGATIVE), "accelerometer_bias"),
        ("bias_rad_s", Number(NOT_NEGATIVE), "gyroscope_bias"),
        ("bias_walk_m_s2_sqrt_s", Number(NOT_NEGATIVE), "accelerometer_walk"),
        ("bias_walk_rad_s_sqrt_s", Number(NOT_NEGATIVE), "gyroscope_walk"),
        ("bits", BITS, "bits"),
    )
)
"""Defaults are those of `scene.Imu`."""
SENSOR_KINDS = Registry[SensorKind](
    "kind of sensor",
    SensorKind(
        name="pressure",
        words="pressure gauge",
        unit="pa",
        columns=("overpressure_pa",),
        sources="jblast.sensors.sources:pressure",
        site="above",
        senses=(("air_arrival_s", "pressure"),),
        is_picked=True,
        is_tuned=True,
    ),
    SensorKind(
        name="microphone",
        words="microphone",
        unit="pa",
        columns=("overpressure_pa",),
        sources="jblast.sensors.sources:microphone",
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
        sources="jblast.sensors.sources:anemometer",
        magnitude="wind_speed_m_s",
        site="above",
        senses=(("air_arrival_s", "wind"),),
    ),
    SensorKind(
        name="geophone",
        words="geophone",
        unit="m_s",
        columns=("ground_velocity_m_s",),
        sources="jblast.sensors.sources:geophone",
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
    ),
)
"""Kinds by name; `register` adds one from any module."""
