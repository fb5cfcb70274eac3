"""Readers of files of samples, one a format."""

from jblast.observations.records.formats.by_extension import (
    FORMATS as FORMATS,
    is_record as is_record,
    open_record as open_record,
)
from jblast.observations.records.formats.scale import Scaling as Scaling
