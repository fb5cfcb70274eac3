"""What would be recorded: the forward model from a scene to a sensor's readings."""

from jblast.sensors.arrivals.heard import heard as heard
from jblast.sensors.arrivals.laws import (
    DEFAULT_RECORD_LAWS as DEFAULT_RECORD_LAWS,
    record_laws as record_laws,
)
from jblast.sensors.arrivals.overpressure import (
    even_overpressure as even_overpressure,
    overpressure as overpressure,
)
from jblast.sensors.arrivals.recorded_sound import RecordedSound as RecordedSound
from jblast.sensors.arrivals.track import Track as Track
from jblast.sensors.arrivals.way import Heard as Heard
from jblast.sensors.calculator.forward import (
    Calculated as Calculated,
    calculate as calculate,
)
from jblast.sensors.calculator.inverse import Roots as Roots, roots as roots
from jblast.sensors.calculator.question import Question as Question
from jblast.sensors.gauge import (
    anemometer as anemometer,
    geophone as geophone,
    pressure_gauge as pressure_gauge,
)
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
from jblast.sensors.observe import observe as observe
from jblast.sensors.record import Recording as Recording, record as record
from jblast.sensors.simulate import readings as readings, simulate as simulate
