"""Measured errors and costs of methods, and the cheapest that is accurate enough."""

from jblast.fidelity.choose import (
    Candidate as Candidate,
    Choice as Choice,
    TakenLaw as TakenLaw,
    choose as choose,
    choose_for as choose_for,
    tolerance_of as tolerance_of,
)
