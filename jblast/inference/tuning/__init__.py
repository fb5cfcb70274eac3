"""How sensors and media behave, fitted by gradient to what they recorded."""

from jblast.inference.tuning.result import (
    NothingHeardError as NothingHeardError,
    Tuned as Tuned,
)
from jblast.inference.tuning.tune_sound import (
    recorded_sound as recorded_sound,
    tune_sound as tune_sound,
)
