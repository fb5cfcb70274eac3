"""What `jblast pick --json` prints, as data."""

from collections.abc import Mapping
from dataclasses import dataclass

from jblast.inference.picks import Quality
from jblast.inference.records import LeftOut


@dataclass(frozen=True)
class PickedValue:
    """A value and its standard deviation, in its unit.

    Attributes:
        value: The value.
        sd: Its standard deviation.
    """

    value: float
    sd: float


@dataclass(frozen=True)
class PickAnswer:
    """A pick; a value is null where samples are no pascals and it is in them.

    Attributes:
        record: Its name, name#bang where a channel has several.
        sensor: The channel.
        file: Its file.
        bang: Which of its channel it is, from 1.
        shot: Which event of the log it belongs to; "" where there is one.
        air_arrival_s: When the front came.
        peak_overpressure_pa: Peak overpressure.
        positive_duration_s: How long the positive phase lasts.
        positive_impulse_pa_s: Its impulse.
        decay: Decay parameter of the modified Friedlander pulse.
        rise_time_s: How long the front rises.
        negative_pressure_pa: Peak of the negative phase.
        negative_duration_s: How long that lasts.
        lower_bound: Whether the peak is a lower bound, as the record is clipped.
        later_arrivals_s: Further fronts.
        quality: How far it may be trusted.
        notes: What is to be said of it, a sentence each.
    """

    record: str
    sensor: str
    file: str
    bang: int
    shot: str
    air_arrival_s: PickedValue | None
    peak_overpressure_pa: PickedValue | None
    positive_duration_s: PickedValue | None
    positive_impulse_pa_s: PickedValue | None
    decay: PickedValue | None
    rise_time_s: PickedValue | None
    negative_pressure_pa: PickedValue | None
    negative_duration_s: PickedValue | None
    lower_bound: bool
    later_arrivals_s: tuple[PickedValue, ...]
    quality: Quality
    notes: tuple[str, ...]


@dataclass(frozen=True)
class PicksAnswer:
    """What was picked from records of samples.

    Attributes:
        picks: By file, channel and time.
        epoch_utc: What arrivals count from, ISO 8601; null where no file tells the time
            of day.
        nothing_found: Channels without a pick.
        quieter_onsets: How many onsets were not looked at, by channel: 20 dB below its
            loudest.
        not_in_log: What stands in no row of the log, and why.
        bangs: How many bangs the rows of the log are of.
        refused: Why files could not be read, a message each.
    """

    picks: tuple[PickAnswer, ...]
    epoch_utc: str | None
    nothing_found: tuple[str, ...]
    quieter_onsets: Mapping[str, int]
    not_in_log: tuple[LeftOut, ...]
    bangs: int
    refused: tuple[str, ...]
