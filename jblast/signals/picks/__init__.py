"""Picks of pressure records by a posterior over their samples, and rows of logs."""

from jblast.signals.picks.gathered import (
    Gathered as Gathered,
    gathered as gathered,
)
from jblast.signals.picks.pick import (
    NAMES as NAMES,
    NOTES as NOTES,
    NoteKind as NoteKind,
    Pick as Pick,
    Quality as Quality,
    pick as pick,
)
from jblast.signals.picks.pick_files import (
    PickedFiles as PickedFiles,
    pick_files as pick_files,
)
from jblast.signals.picks.pick_log import (
    LeftOut as LeftOut,
    PickedValue as PickedValue,
    PickLog as PickLog,
    Reason as Reason,
    log_of as log_of,
    picked_value as picked_value,
)
from jblast.signals.picks.record_picks import (
    RecordPick as RecordPick,
    pick_records as pick_records,
)
