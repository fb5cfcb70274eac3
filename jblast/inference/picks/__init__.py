"""Picks: the pulse of a pressure record, by a posterior over its samples."""

from jblast.inference.picks.eye_rules import EyePick as EyePick, eye_pick as eye_pick
from jblast.inference.picks.pick import pick as pick
from jblast.inference.picks.quality import NoteKind as NoteKind, Quality as Quality
from jblast.inference.picks.record_picks import (
    RecordPick as RecordPick,
    pick_records as pick_records,
)
from jblast.inference.picks.result import NAMES as NAMES, Pick as Pick
