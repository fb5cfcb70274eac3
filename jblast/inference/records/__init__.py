"""From files of samples to picks, and to rows of a log."""

from jblast.inference.records.gathered import (
    Gathered as Gathered,
    gathered as gathered,
)
from jblast.inference.records.log import (
    LeftOut as LeftOut,
    PickLog as PickLog,
    Reason as Reason,
    log_of as log_of,
)
from jblast.inference.records.pick_estimate import (
    PickEstimate as PickEstimate,
    pick_estimate as pick_estimate,
)
