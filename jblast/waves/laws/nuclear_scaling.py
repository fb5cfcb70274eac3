"""How far a chemical charge is in the units of nuclear laws: metres per kt^(1/3).

Half of a nuclear yield goes into air blast, the rest into heat and radiation, so a
charge of mass W blasts like a nuclear yield of 2 W: 1 kt of TNT like 2 kt. The factor
is MultiPEM's C2N = 2. A law stated for a yield is therefore asked at Y = 2 W.
"""

import math

NUCLEAR_YIELD_PER_MASS = 2.0
"""Nuclear yield with the air blast of a TNT charge, over its mass [-]."""

NUCLEAR_SCALED_METRES = (1e6 / NUCLEAR_YIELD_PER_MASS) ** (1.0 / 3.0)
"""Scaled distance in m/kt^(1/3) that is 1 m/kg^(1/3): 79.37 [kg^(1/3)/kt^(1/3)]."""

LOG_NUCLEAR_SCALED_METRES = math.log(NUCLEAR_SCALED_METRES)
