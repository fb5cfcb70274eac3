"""The forward model from a scene to the readings and records of its sensors."""

from jblast.sensors import (
    anemometer as anemometer,
    geophone as geophone,
    pressure_gauge as pressure_gauge,
)
from jblast.sensors.arrivals import Track as Track, heard as heard
from jblast.sensors.calculator import (
    Calculated as Calculated,
    Question as Question,
    Roots as Roots,
    calculate as calculate,
    roots as roots,
)
from jblast.sensors.law_choice import (
    choose_laws as choose_laws,
    resolve_laws as resolve_laws,
)
from jblast.sensors.layout import (
    Layout as Layout,
    layout_of as layout_of,
    planned_layout as planned_layout,
)
from jblast.sensors.pressure_history import (
    RecordedSound as RecordedSound,
    even_overpressure as even_overpressure,
    overpressure as overpressure,
)
from jblast.sensors.record import (
    Recording as Recording,
    jolt_bearing as jolt_bearing,
    jolt_elevation as jolt_elevation,
    jolt_speed as jolt_speed,
    record as record,
)
from jblast.sensors.simulate import (
    observe as observe,
    readings as readings,
    simulate as simulate,
)
from jblast.sensors.wave_paths import (
    DEFAULT_RECORD_LAWS as DEFAULT_RECORD_LAWS,
    Heard as Heard,
    record_laws as record_laws,
)
