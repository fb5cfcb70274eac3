"""How a blast travels: one law a file, each registered where it is defined."""

from jblast.waves.acoustic import acoustic_arrival_time as acoustic_arrival_time
from jblast.waves.atmosphere import air_density as air_density
from jblast.waves.atmosphere import sound_speed_in_air as sound_speed_in_air
from jblast.waves.atmosphere import standard_atmosphere as standard_atmosphere
from jblast.waves.ford_2021 import ford_2021_duration as ford_2021_duration
from jblast.waves.ford_2021 import ford_2021_impulse as ford_2021_impulse
from jblast.waves.kingery_bulmash import (
    kingery_bulmash_arrival_time as kingery_bulmash_arrival_time,
)
from jblast.waves.kingery_bulmash import (
    kingery_bulmash_duration as kingery_bulmash_duration,
)
from jblast.waves.kingery_bulmash import (
    kingery_bulmash_impulse as kingery_bulmash_impulse,
)
from jblast.waves.kingery_bulmash import (
    kingery_bulmash_pressure as kingery_bulmash_pressure,
)
from jblast.waves.kingery_bulmash import (
    kingery_bulmash_reflected_impulse as kingery_bulmash_reflected_impulse,
)
from jblast.waves.kingery_bulmash import (
    kingery_bulmash_reflected_pressure as kingery_bulmash_reflected_pressure,
)
from jblast.waves.kingery_bulmash import (
    kingery_bulmash_shock_speed as kingery_bulmash_shock_speed,
)
from jblast.waves.light import light_arrival_time as light_arrival_time
from jblast.waves.paths import Path as Path
from jblast.waves.paths import slant_range as slant_range
from jblast.waves.scaling import sachs_distance_factor as sachs_distance_factor
from jblast.waves.scaling import sachs_impulse_factor as sachs_impulse_factor
from jblast.waves.scaling import sachs_pressure_factor as sachs_pressure_factor
from jblast.waves.scaling import sachs_time_factor as sachs_time_factor
from jblast.waves.scaling import scaled_distance as scaled_distance
from jblast.waves.sedov_alpha import sedov_alpha as sedov_alpha
from jblast.waves.sedov_taylor import sedov_taylor_energy as sedov_taylor_energy
from jblast.waves.sedov_taylor import (
    sedov_taylor_shock_pressure as sedov_taylor_shock_pressure,
)
from jblast.waves.sedov_taylor import (
    sedov_taylor_shock_radius as sedov_taylor_shock_radius,
)
from jblast.waves.shock_kinematics import (
    shock_kinematics_arrival_time as shock_kinematics_arrival_time,
)
from jblast.waves.shock_kinematics import (
    shock_kinematics_pressure as shock_kinematics_pressure,
)
from jblast.waves.shock_kinematics import (
    shock_kinematics_shock_speed as shock_kinematics_shock_speed,
)
from jblast.waves.wu_hao import wu_hao_air_arrival_time as wu_hao_air_arrival_time
from jblast.waves.wu_hao import wu_hao_ground_arrival_time as wu_hao_ground_arrival_time
