"""A spherical shock and the flow behind it, computed: the reference of the laws.

The equations of motion of an ideal gas in one dimension, with the leading shock fitted
as the moving end of the mesh. `run` is pure, to be batched and differentiated; `march`
goes to the end however many steps it takes. A start returns what stays (`Flow`) and
what changes (`FlowState`); another start or gas is another file.
"""

from jblast.waves.euler.exact_riemann import (
    riemann_profile as riemann_profile,
    star_state as star_state,
)
from jblast.waves.euler.front_pressure import front_pressure_at as front_pressure_at
from jblast.waves.euler.gas import Gas as Gas, IdealGas as IdealGas
from jblast.waves.euler.gauges import (
    cell_centres as cell_centres,
    gauge_readings as gauge_readings,
)
from jblast.waves.euler.initial.sedov import start_sedov as start_sedov
from jblast.waves.euler.initial.shock_tube import (
    start_sod as start_sod,
    start_tube as start_tube,
)
from jblast.waves.euler.initial.simple_wave import (
    simple_wave_means as simple_wave_means,
    start_simple_wave as start_simple_wave,
)
from jblast.waves.euler.initial.sphere import start_sphere as start_sphere
from jblast.waves.euler.march import March as March, march as march
from jblast.waves.euler.point_source_run import (
    Decay as Decay,
    decay_at as decay_at,
    extrapolated as extrapolated,
    point_source_march as point_source_march,
)
from jblast.waves.euler.run import History as History, run as run
from jblast.waves.euler.state import (
    Ambient as Ambient,
    Flow as Flow,
    FlowState as FlowState,
    Primitives as Primitives,
    primitives as primitives,
)
