"""Laws of blast waves, one a file and registered where defined, and wave models."""

from typing import TYPE_CHECKING

from jblast import registry
from jblast.lazy import lazy_face
from jblast.waves.laws.acoustic import acoustic_arrival_time as acoustic_arrival_time
from jblast.waves.laws.dna_1kt import (
    dna_1kt_arrival_time as dna_1kt_arrival_time,
    dna_1kt_pressure as dna_1kt_pressure,
)
from jblast.waves.laws.fireball_radius import (
    fireball_law_radius as fireball_law_radius,
    fireball_law_radius_in_image as fireball_law_radius_in_image,
)
from jblast.waves.laws.ford_2021 import (
    ford_2021_duration as ford_2021_duration,
    ford_2021_impulse as ford_2021_impulse,
)
from jblast.waves.laws.ground_motion import (
    ground_motion_displacement as ground_motion_displacement,
    ground_motion_velocity as ground_motion_velocity,
)
from jblast.waves.laws.kingery_bulmash import (
    ground_factor as ground_factor,
    kingery_bulmash_arrival_time as kingery_bulmash_arrival_time,
    kingery_bulmash_blast_wind as kingery_bulmash_blast_wind,
    kingery_bulmash_duration as kingery_bulmash_duration,
    kingery_bulmash_impulse as kingery_bulmash_impulse,
    kingery_bulmash_pressure as kingery_bulmash_pressure,
    kingery_bulmash_reflected_impulse as kingery_bulmash_reflected_impulse,
    kingery_bulmash_reflected_pressure as kingery_bulmash_reflected_pressure,
    kingery_bulmash_shock_speed as kingery_bulmash_shock_speed,
)
from jblast.waves.laws.kinney_graham import (
    kinney_graham_arrival_time as kinney_graham_arrival_time,
    kinney_graham_duration as kinney_graham_duration,
    kinney_graham_impulse as kinney_graham_impulse,
    kinney_graham_pressure as kinney_graham_pressure,
)
from jblast.waves.laws.line_of_sight import (
    bearing as bearing,
    elevation as elevation,
    light_arrival_time as light_arrival_time,
)
from jblast.waves.laws.negative_phase_rigby import (
    rigby_negative_duration as rigby_negative_duration,
)
from jblast.waves.laws.negative_phase_ufc import (
    ufc_negative_impulse as ufc_negative_impulse,
    ufc_negative_pressure as ufc_negative_pressure,
)
from jblast.waves.laws.point_source import (
    point_source_arrival_time as point_source_arrival_time,
    point_source_pressure as point_source_pressure,
)
from jblast.waves.laws.sadovsky import sadovsky_pressure as sadovsky_pressure
from jblast.waves.laws.sedov_taylor import (
    sedov_alpha as sedov_alpha,
    sedov_taylor_energy as sedov_taylor_energy,
    sedov_taylor_shock_radius as sedov_taylor_shock_radius,
)
from jblast.waves.laws.shock_kinematics import (
    shock_kinematics_arrival_time as shock_kinematics_arrival_time,
    shock_kinematics_duration as shock_kinematics_duration,
    shock_kinematics_impulse as shock_kinematics_impulse,
    shock_kinematics_pressure as shock_kinematics_pressure,
)
from jblast.waves.laws.swisdak import swisdak_pressure as swisdak_pressure
from jblast.waves.laws.weak_shock import (
    weak_shock_iso_pressure as weak_shock_iso_pressure,
)
from jblast.waves.laws.wu_hao import (
    wu_hao_air_arrival_time as wu_hao_air_arrival_time,
    wu_hao_ground_arrival_time as wu_hao_ground_arrival_time,
)
from jblast.waves.paths import Path as Path, evaluate as evaluate
from jblast.waves.propagation import (
    air_density as air_density,
    ambient as ambient,
    iso_9613_absorption as iso_9613_absorption,
    sound_speed_in_air as sound_speed_in_air,
)
from jblast.waves.scaling import scaled_distance as scaled_distance
from jblast.waves.shock import blast_wind as blast_wind

if TYPE_CHECKING:
    from jblast.waves.fireballs import (
        fireball as fireball,
        fireball_duration as fireball_duration,
    )
    from jblast.waves.pulse import blast_pulse as blast_pulse

__getattr__, __dir__ = lazy_face(__name__)

registry.mark_packaged()
