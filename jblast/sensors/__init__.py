"""The forward model from a scene to the readings and records of its sensors."""

from typing import TYPE_CHECKING

from jblast.lazy import lazy_face

if TYPE_CHECKING:
    from jblast.sensors import (
        anemometer as anemometer,
        geophone as geophone,
        pressure_gauge as pressure_gauge,
    )
    from jblast.sensors.arrivals import (
        Track as Track,
        even_overpressure as even_overpressure,
        heard as heard,
        overpressure as overpressure,
    )
    from jblast.sensors.calculator import (
        Calculated as Calculated,
        Question as Question,
        Roots as Roots,
        calculate as calculate,
        roots as roots,
    )
    from jblast.sensors.forward_model import (
        Recording as Recording,
        record as record,
    )
    from jblast.sensors.gauge import sampled_by as sampled_by
    from jblast.sensors.jolt import (
        jolt_bearing as jolt_bearing,
        jolt_elevation as jolt_elevation,
        jolt_speed as jolt_speed,
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
    from jblast.sensors.simulated_readings import (
        observe as observe,
        readings as readings,
        simulate as simulate,
    )
    from jblast.sensors.wave_paths import (
        DEFAULT_RECORD_LAWS as DEFAULT_RECORD_LAWS,
        Heard as Heard,
        record_laws as record_laws,
    )

HOMES = {
    "Calculated": "jblast.sensors.calculator",
    "DEFAULT_RECORD_LAWS": "jblast.sensors.wave_paths",
    "Heard": "jblast.sensors.wave_paths",
    "Layout": "jblast.sensors.layout",
    "Question": "jblast.sensors.calculator",
    "Recording": "jblast.sensors.forward_model",
    "Roots": "jblast.sensors.calculator",
    "Track": "jblast.sensors.arrivals",
    "anemometer": "jblast.sensors.anemometer",
    "calculate": "jblast.sensors.calculator",
    "choose_laws": "jblast.sensors.law_choice",
    "even_overpressure": "jblast.sensors.arrivals",
    "geophone": "jblast.sensors.geophone",
    "heard": "jblast.sensors.arrivals",
    "jolt_bearing": "jblast.sensors.jolt",
    "jolt_elevation": "jblast.sensors.jolt",
    "jolt_speed": "jblast.sensors.jolt",
    "layout_of": "jblast.sensors.layout",
    "observe": "jblast.sensors.simulated_readings",
    "overpressure": "jblast.sensors.arrivals",
    "planned_layout": "jblast.sensors.layout",
    "pressure_gauge": "jblast.sensors.pressure_gauge",
    "readings": "jblast.sensors.simulated_readings",
    "record": "jblast.sensors.forward_model",
    "record_laws": "jblast.sensors.wave_paths",
    "resolve_laws": "jblast.sensors.law_choice",
    "roots": "jblast.sensors.calculator",
    "sampled_by": "jblast.sensors.gauge",
    "simulate": "jblast.sensors.simulated_readings",
}

__getattr__, __dir__ = lazy_face(__name__, HOMES)
