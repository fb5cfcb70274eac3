"""What would be recorded: the forward model from a scene to a sensor's readings."""

from jblast.sensors.laws import choose_laws as choose_laws
from jblast.sensors.laws import resolve_laws as resolve_laws
from jblast.sensors.layout import Layout as Layout
from jblast.sensors.layout import layout_of as layout_of
from jblast.sensors.layout import planned_layout as planned_layout
from jblast.sensors.observe import observe as observe
from jblast.sensors.record import Recording as Recording
from jblast.sensors.record import record as record
from jblast.sensors.simulate import simulate as simulate
