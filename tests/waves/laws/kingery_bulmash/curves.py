"""The curves that the tests of Kingery and Bulmash go through."""

from jblast.waves.laws import kingery_bulmash as kb

LAWS = {
    "incident_pressure": kb.kingery_bulmash_pressure,
    "reflected_pressure": kb.kingery_bulmash_reflected_pressure,
    "incident_impulse": kb.kingery_bulmash_impulse,
    "reflected_impulse": kb.kingery_bulmash_reflected_impulse,
    "positive_phase_duration": kb.kingery_bulmash_duration,
    "arrival_time": kb.kingery_bulmash_arrival_time,
    "shock_front_velocity": kb.kingery_bulmash_shock_speed,
}
