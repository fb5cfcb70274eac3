"""Units in names: what other tools call our columns and quantities, and the factor."""

from jblast.units.decimals import products as products
from jblast.units.factors import si_factor as si_factor, si_ratio as si_ratio
from jblast.units.levels import (
    LN_PER_DB as LN_PER_DB,
    REFERENCE_PA as REFERENCE_PA,
    overpressure as overpressure,
)
from jblast.units.names import (
    OurName as OurName,
    our_name as our_name,
    what_to_write as what_to_write,
)
from jblast.units.spelling import Unit as Unit, unit_spelt as unit_spelt
from jblast.units.vocabulary import (
    DIMENSIONS as DIMENSIONS,
    LEVEL as LEVEL,
    SHARE as SHARE,
    SUFFIXES as SUFFIXES,
)
