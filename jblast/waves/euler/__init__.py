"""A spherical shock and the flow behind it, computed: the reference of the laws.

The equations of motion of an ideal gas in one dimension, with the leading shock fitted
as the moving end of the mesh. `run` is pure, to be batched and differentiated; `march`
goes to the end however many steps it takes. A start returns what stays (`Flow`) and
what changes (`FlowState`); another start or gas is another file.
"""

from jblast.waves.euler.initial import (
    riemann_profile as riemann_profile,
    simple_wave_means as simple_wave_means,
    star_state as star_state,
    start_sedov as start_sedov,
    start_simple_wave as start_simple_wave,
    start_sod as start_sod,
    start_sphere as start_sphere,
    start_tube as start_tube,
)
from jblast.waves.euler.run import (
    Decay as Decay,
    History as History,
    March as March,
    cell_centres as cell_centres,
    decay_at as decay_at,
    extrapolated as extrapolated,
    front_pressure_at as front_pressure_at,
    gauge_readings as gauge_readings,
    march as march,
    point_source_march as point_source_march,
    run as run,
)
from jblast.waves.euler.state import (
    Ambient as Ambient,
    Flow as Flow,
    FlowState as FlowState,
    Gas as Gas,
    IdealGas as IdealGas,
    Primitives as Primitives,
    primitives as primitives,
)
