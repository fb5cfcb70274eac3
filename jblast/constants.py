"""Physical constants, each with unit and source."""

STANDARD_PRESSURE = 101_325.0
"""Sea-level pressure [Pa]. ISO 2533:1975, the standard atmosphere."""

STANDARD_TEMPERATURE = 288.15
"""Sea-level temperature [K]. ISO 2533:1975."""

STANDARD_SOUND_SPEED = 340.29
"""Sound speed of the Kingery-Bulmash ambient air [m/s]. ISO 2533:1975 (15 C, dry)."""

DRY_AIR_GAS_CONSTANT = 287.05
"""Specific gas constant of dry air [J/(kg K)]. ISO 2533:1975 (287.05287)."""

AIR_HEAT_CAPACITY_RATIO = 1.4
"""Ratio of specific heats of air [-], ideal diatomic gas."""

STANDARD_GRAVITY = 9.80665
"""Standard acceleration of free fall [m/s2], exact. SI Brochure, 9th edition."""

LIGHT_SPEED = 299_792_458.0
"""Speed of light [m/s], exact. SI Brochure, 9th edition."""

TNT_SPECIFIC_ENERGY = 4.184e6
"""Energy of 1 kg of TNT [J/kg], by convention: 1 kt = 4.184 TJ."""

TNT_DENSITY = 1630.0
"""Density of cast TNT [kg/m3]: a charge of 1 kg has a radius of 0.0527 m."""

GRANITE_P_SPEED = 5660.0
"""P-wave speed of granite in situ [m/s]. Wu and Hao (2005); 6000 m/s is intact core."""

FLIGHT_GRAVITY = 9.81
"""Gravity of the vehicles [m/s2]: that of RotorPy 3.0.0, to reproduce its flights."""

FOOT = 0.3048
"""A foot [m], exact. NIST SP 811 (2008), appendix B."""

PSI = 44482216152605 / 6451600000
"""A pound-force per square inch [Pa], 4.4482216152605 N over (0.0254 m)^2, exact and
rounded once. NIST SP 811 (2008), appendix B."""

BAR = 1e5
"""A bar [Pa]. Exact."""
