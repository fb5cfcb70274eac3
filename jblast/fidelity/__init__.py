"""How much is enough: measured errors and costs, and the cheapest that will do."""

from jblast.fidelity.choose import (
    Candidate as Candidate,
    Choice as Choice,
    TakenLaw as TakenLaw,
    choose as choose,
    choose_for as choose_for,
    tolerance_of as tolerance_of,
)
