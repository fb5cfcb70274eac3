"""Numbers of sensors and media, fitted by gradient to records."""

from jblast.inference.tuning.result import (
    NothingHeardError as NothingHeardError,
    Tuned as Tuned,
)
from jblast.inference.tuning.tune_sound import (
    recorded_sound as recorded_sound,
    tune_sound as tune_sound,
)
