"""Names of `numbers` and `view` for modules that do not import these yet."""

from jblast.registry import law_words as law_words
from jblast.report.numbers import (
    CUSTOMARY as CUSTOMARY,
    LADDERS as LADDERS,
    System as System,
    Unit as Unit,
    capitalised as capitalised,
    finite as finite,
    joined as joined,
    parameter_words as parameter_words,
    printed_number as printed_number,
    quantity_words as quantity_words,
    rounded as rounded,
    scientific as scientific,
    significant as significant,
    split_name as split_name,
    unit_for as unit_for,
)
from jblast.report.view import (
    WIDTH as WIDTH,
    aligned as aligned,
    behind as behind,
    comma_separated as comma_separated,
    commented as commented,
    hanging as hanging,
)

GAP = 2
