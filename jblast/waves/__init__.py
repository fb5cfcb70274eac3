"""Laws of blast waves, one a file and registered where defined, and wave models."""

from jblast import registry
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
    kingery_bulmash_dynamic_pressure as kingery_bulmash_dynamic_pressure,
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
    kinney_graham_nuclear_duration as kinney_graham_nuclear_duration,
    kinney_graham_nuclear_pressure as kinney_graham_nuclear_pressure,
    kinney_graham_pressure as kinney_graham_pressure,
    kinney_graham_shock_speed as kinney_graham_shock_speed,
)
from jblast.waves.laws.line_of_sight import (
    bearing as bearing,
    elevation as elevation,
    light_arrival_time as light_arrival_time,
)
from jblast.waves.laws.negative_phase_rigby import (
    rigby_negative_duration as rigby_negative_duration,
    rigby_reflected_negative_impulse as rigby_reflected_negative_impulse,
    rigby_reflected_negative_pressure as rigby_reflected_negative_pressure,
)
from jblast.waves.laws.negative_phase_ufc import (
    ufc_negative_duration as ufc_negative_duration,
    ufc_negative_impulse as ufc_negative_impulse,
    ufc_negative_pressure as ufc_negative_pressure,
    ufc_reflected_negative_impulse as ufc_reflected_negative_impulse,
    ufc_reflected_negative_pressure as ufc_reflected_negative_pressure,
)
from jblast.waves.laws.point_source import (
    point_source_arrival_time as point_source_arrival_time,
    point_source_pressure as point_source_pressure,
    point_source_shock_speed as point_source_shock_speed,
)
from jblast.waves.laws.sadovsky import (
    sadovsky_duration as sadovsky_duration,
    sadovsky_pressure as sadovsky_pressure,
)
from jblast.waves.laws.sedov_taylor import (
    sedov_alpha as sedov_alpha,
    sedov_taylor_energy as sedov_taylor_energy,
    sedov_taylor_shock_pressure as sedov_taylor_shock_pressure,
    sedov_taylor_shock_radius as sedov_taylor_shock_radius,
)
from jblast.waves.laws.shock_kinematics import (
    shock_kinematics_arrival_time as shock_kinematics_arrival_time,
    shock_kinematics_duration as shock_kinematics_duration,
    shock_kinematics_impulse as shock_kinematics_impulse,
    shock_kinematics_pressure as shock_kinematics_pressure,
    shock_kinematics_shock_speed as shock_kinematics_shock_speed,
)
from jblast.waves.laws.swisdak import (
    swisdak_arrival_time as swisdak_arrival_time,
    swisdak_duration as swisdak_duration,
    swisdak_impulse as swisdak_impulse,
    swisdak_pressure as swisdak_pressure,
    swisdak_reflected_impulse as swisdak_reflected_impulse,
    swisdak_reflected_pressure as swisdak_reflected_pressure,
    swisdak_shock_speed as swisdak_shock_speed,
)
from jblast.waves.laws.weak_shock import (
    weak_shock_iso_pressure as weak_shock_iso_pressure,
    weak_shock_pressure as weak_shock_pressure,
)
from jblast.waves.laws.wu_hao import (
    dual_path_ground_arrival_time as dual_path_ground_arrival_time,
    wu_hao_air_arrival_time as wu_hao_air_arrival_time,
    wu_hao_ground_arrival_time as wu_hao_ground_arrival_time,
    wu_hao_ground_path_arrival_time as wu_hao_ground_path_arrival_time,
)
from jblast.waves.paths import (
    Path as Path,
    slant_range as slant_range,
)
from jblast.waves.propagation import (
    air_density as air_density,
    effective_sound_speed as effective_sound_speed,
    iso_9613_absorption as iso_9613_absorption,
    sound_speed_in_air as sound_speed_in_air,
    standard_atmosphere as standard_atmosphere,
    stokes_absorption as stokes_absorption,
)
from jblast.waves.pulse import (
    Pulse as Pulse,
    pulse_mean as pulse_mean,
    pulse_of as pulse_of,
    pulse_pressure as pulse_pressure,
    pulse_samples as pulse_samples,
)
from jblast.waves.scaling import (
    sachs_distance_factor as sachs_distance_factor,
    sachs_impulse_factor as sachs_impulse_factor,
    sachs_pressure_factor as sachs_pressure_factor,
    sachs_time_factor as sachs_time_factor,
    scaled_distance as scaled_distance,
)
from jblast.waves.shock import (
    blast_wind as blast_wind,
    dynamic_pressure as dynamic_pressure,
)
from jblast.waves.waveform import (
    BlastPulse as BlastPulse,
    blast_pressure as blast_pressure,
    blast_pulse as blast_pulse,
    friedlander_decay as friedlander_decay,
    friedlander_impulse as friedlander_impulse,
    friedlander_pressure as friedlander_pressure,
    friedlander_spectrum as friedlander_spectrum,
    modified_friedlander_pressure as modified_friedlander_pressure,
    negative_phase_pressure as negative_phase_pressure,
    weak_shock_rise_time as weak_shock_rise_time,
)

registry.mark_packaged()
