"""One sentence for each kind of note, without its full stop.

A template names the numbers of its note. A number with a unit in its name is printed
with it, a list is joined, and shortened if it is long.
"""

from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from string import Formatter
from typing import Any

import jblast
from jblast.observations.table import Observations
from jblast.report.numbers import (
    joined,
    parameter_words,
    printed_number,
    quantity_words,
    significant,
    split_name,
)
from jblast.results import Note

MAX_NAMED = 5
"""Largest number of names in a list; the others are counted."""
MESSAGES = {
    # problems: the part before the colon is printed in capitals
    "not_converged": "not converged: do not use the numbers below; the warnings name "
    "the reason",
    "poor_fit": "poor fit (p {p_value:p}): the recordings disagree with the law by "
    "more than their errors allow (chi squared {chi2:.1f} on {dof} degrees of "
    "freedom); do not use the intervals below",
    "no_law_applies": "outside the laws: no recording lies within the range of its "
    "law; do not use the numbers below",
    "extrapolated": "outside the laws: most of the information about "
    "{parameters:parameters} is from recordings outside the range of their laws; do "
    "not use these values",
    "wrong_sensor": "wrong sensor or clock ({wrong:wrong}): do not use the numbers "
    "below",
    "uncertain_intervals": "uncertain intervals: do not use those below; the warnings "
    "name the reason; --posterior emcee runs MCMC",
    "not_identifiable": "not identified: the recordings leave {parameters:parameters} "
    "open",
    # warnings
    "mode_found_once": "the best solution was found by one search only; there may be "
    "a better one",
    "weights_unreliable": "few draws have most of the weight (k-hat {k_hat:.2f}, "
    "effective sample size {effective:.0f})",
    "quantiles_uncertain": "the quantiles of {parameter:parameter} have a standard "
    "error of {error:.2g} sd, required {wanted:g}",
    "chain_too_short": "{steps} steps are {times:.0f} autocorrelation times of "
    "{parameter:parameter}, required {wanted:.0f}",
    "chains_disagree": "R-hat of {parameter:parameter} is {r_hat:.3g}, required "
    "{wanted:g}",
    "more_to_free": "with {parameters:parameters} free the recordings fit (p "
    "{p_value:p}): {masses:estimates}; repeat the command with --free "
    "{parameters:option}",
    "clock_to_free": "with {parameters:parameters} free (the clock of {clock} is "
    "wrong) the recordings fit (p {p_value:p}): {masses:estimates}; repeat the "
    "command with --free {parameters:option}",
    "look_closer": "`jblast check {log}` searches for wrong units, clocks and "
    "positions; `jblast scene {log}` writes a scene to which air, ground and priors "
    "can be added",
    "slower_than_sound": "slower than sound: the arrivals at {sensors:names} imply "
    "mean speeds down to {speed_m_s:.0f} m/s (speed of sound {sound_m_s:.0f} m/s), "
    "more than scatter explains; check clocks, distances, and temperature and wind "
    "of the scene",
    "prior_conflict": "without priors the log fits well, at {values:values}, which a "
    "prior excludes; correct or widen the prior, or correct the readings",
    "law_out_of_range": "{rows} of {of} rows lie outside their law's range "
    "({quantities:quantities}); {ranges:ranges}",
    "law_out_of_range_below": "{rows} of {of} rows lie outside their law's range at "
    "the lower bound of the 90 % interval ({quantities:quantities}); {ranges:ranges}",
    "laws_unsettled": "the automatic choice of law at the answer differs from the law "
    "of the fit; its choice there: {laws:law}",
    "far_from_its_law": "the whole shot, or a path, departs from its law by "
    "{times:.1f} times the expected scatter: the law may not apply to this setting",
    "height_of_burst": "{note}",
    "deep_charge": "the {charge} was {scaled_depth:.2g} m/kg^(1/3) deep; of its "
    "burial the laws used include the longer path only",
    "no_point_source": "{laws:names} is for a point source, and a charge of "
    "{explosive} is not one: near the charge the estimated mass can be many times "
    'too small; for a nuclear burst set explosive = "nuclear"',
    "flat_ground": "flat ground was assumed: at {sensor}, {range_m} away, the error of "
    "the distance is {error_m}, {sigmas:.2g} sigma of its {quantity}",
    "clocks_taken_to_agree": "clocks were assumed to agree: {clocks:names}; --free "
    "{parameters:option} fits their offsets",
    "rests_on_clocks": "{parameters:parameters} would not be identified without the "
    "assumption that clocks agree",
    "flashes_set_aside": "the flash times of the clocks {clocks:names} were not "
    "used: no other reading relates these clocks to the others; if they agree, write "
    "the same name in the column clock, or set offset_s in the scene; --free "
    "{parameters:option} fits their offsets",
    "several_explanations": "the recordings of {suspected} are suspected, but without "
    "those of {others:or} the log fits as well; the log does not determine which is "
    "wrong",
    "paths_beyond_array": "the scatter of {paths:,} paths was assumed independent "
    "(correlation is modelled for at most {limit:,} paths); the sensors are close "
    "together compared with the range, so the scatter of their paths is correlated: "
    "the intervals of bearing and range are too narrow, and the range may be too "
    "small; fit {limit:,} paths or fewer to include the correlation",
    # assumptions
    "no_scene": "no scene was given: a surface charge of TNT in the standard "
    "atmosphere at {altitude_m:.0f} m; also free: {free:parameters}",
    "no_scene_nor_place": "no scene was given: a surface charge of TNT at the origin "
    "at time 0, in the standard atmosphere at {altitude_m:.0f} m",
    "nothing_learned": "intervals of {parameters:parameters} are those of the prior: "
    "the log does not narrow them",
    "paths_independent": "the scatter of {paths:,} paths was assumed independent "
    "(correlation is modelled for at most {limit:,} paths); the scatter of "
    "neighbouring paths is correlated, so intervals of position and time are too "
    "narrow; fit {limit:,} paths or fewer to include the correlation",
    "wind_is_fitted": "still air; wind along the paths acts like a change of the sound "
    "speed, and the fitted {parameter:parameter} covers it",
    "wind_needs_prior": "still air; wind along the paths acts like a change of the "
    "sound speed, and a prior on {parameter} covers it",
    "still_air": "still air; with unknown wind (sd {wind_sd:g} m/s per component) 90 % "
    "intervals would be wider: {wider:times}",
    "still_air_matters_little": "still air; with unknown wind (sd {wind_sd:g} m/s per "
    "component) no 90 % interval would widen by 5 %",
    "still_air_unknown": "still air; with unknown wind (sd {wind_sd:g} m/s per "
    "component) the intervals would widen by an unknown factor",
    "draws_weighted": "draws of a mixture, weighted by the posterior (importance "
    "sampling, k-hat {k_hat:.2f}, effective sample size {effective:.0f})",
    "walked": "MCMC (emcee)",
    # goodness of fit
    "no_chi2": "goodness of fit is unknown: there is no chi2",
    "no_freedom": "goodness of fit is unknown: there are no more recordings than free "
    "parameters",
    "fits_poorly": "the fit is poor (p {p:p}): the recordings disagree with the law by "
    "more than their errors allow, and the intervals are likely too narrow",
    "fits_marginally": "the fit is marginal (p {p:p}): the stated errors give so large "
    "a disagreement in less than 1 % of logs",
    "fits_too_well": "the recordings lie closer to the law than their errors allow "
    "(p {p:p}): the errors may be overstated",
    "fits": "the recordings agree with the law within their errors (p {p:p})",
    "chi2": "chi2 = {chi2:.1f} on {dof} degrees of freedom",
    "valid": "the answer lies within the laws' range of validity",
    "not_valid": "the answer lies outside the range of a law it uses: it is an "
    "extrapolation, whose error the intervals do not include",
    "lower_bounds": "{bounds} of {of} recordings are lower bounds ({sensors:names}); "
    "the law satisfies {kept} of them",
    "outlier": "{sensor}, {quantity:quantity}: {sds:+.1f} sd",
    # fits without a part of a log
    "wrong.exchange": "with the positions of {name} and {other} exchanged all "
    "recordings fit (p {p_value:p}){estimates:masses}; if they were swapped, exchange "
    "their positions in the log",
    "wrong.clock": "without the times of {name} the others fit (p "
    "{p_value:p}){estimates:masses}; its clock is {offset_s:fast} (± "
    "{offset_sd:time}), or its times are wrong{parameter:free}",
    "wrong.sensor": "without the sensor {name} the others fit (p "
    "{p_value:p}){estimates:masses}; to leave it out, put a # before its rows",
    # how a log was read
    "format": "read as {format}",
    "sheet": "read as {format}: sheet {sheet}",
    "separator": "fields are separated by {separator}",
    "encoding": "text was read as {encoding}, as it is not UTF-8",
    "titles": "{word}s {first} and {line} were read as one header",
    "units_row": "{word} {line} was read as the units of the columns",
    "decimal_comma": "decimal commas, as in {text} ({place})",
    "columns_ignored": "ignored columns: {names:names}",
    "height_taken": "no column up_m: sensors assumed at up = 0",
    "longitudes_wrapped": "lon_deg above 180 was read as west: less 360 ({rows:row})",
    "renamed": "{theirs} was read as {ours}",
    "converted": "{theirs} was converted to {ours}: times {factor:.9g} ({rows:row})",
    "share": "{theirs}: per cent of each value ({rows:row})",
    "level": "{theirs} was converted to peak_overpressure_pa: 20 uPa times "
    "10^(dB/20); a sigma of 1 dB is ln(10)/20 = 11.5 % ({rows:row})",
    "level_error": "{theirs}: 1 dB is ln(10)/20 = 11.5 % of each value ({rows:row})",
    "times_undated": "value_utc: times of day were read as of {date} ({rows:row})",
    "times_unzoned": "value_utc: times without a zone were read as {zone} ({rows:row})",
    "times_moved": "value_utc: times with an offset were converted to UTC ({rows:row})",
    "empty_skipped": "{rows:row} without a value left out: {words} {lines:names}",
    "made_long": "a wide table, a column for each of {names:names}",
    "no_errors": "no column of errors for {names:names}: only the law's scatter is "
    "used",
    # probable mistakes in a log
    "sensor_copied": "{other} and {one} have the same position and the same values to "
    "the last digit: is it one sensor with two names?",
    "two_sensors_at_one_place": "{sensor} and {other_sensor} have the same position, "
    "but {quantity} {value} and {other_value}",
    "sensor_at_two_places": "{sensor} is {apart_m:3} from its position in an earlier "
    "row",
    "since_1970": "{sensor}: {quantity} looks like {unit} since 1970, here {when}; "
    "without a date the value is read as seconds after an unknown time zero; write "
    "dates in the column value_utc, like this one",
    "shot_unheard": "{shot:shot} has a flash but no reading of the blast: light "
    "constrains no mass",
    "clock_of_one_row": "clock {clock} has only this reading: with a free clock offset "
    "the reading constrains nothing else",
    "arrival_before_flash": "{reading} is {early_s:time} before the flash on the same "
    "clock",
    "sigma_too_fine": "{reading} has a sigma of {share:short} of its value, smaller "
    "than that of any gauge: sigma is in the unit of the value",
    "sigma_large": "{reading} has a sigma of {share:short} times its value: sigma is "
    "in the unit of the value",
    "lat_lon_swapped": "{sensor} is {apart_m:3} from the other sensors, at latitude "
    "{lat_deg:.6g}, longitude {lon_deg:.6g}; with the two swapped it would be among "
    "them",
    "no_mass_gives_it": "{reading}{distance_m:at}: larger than any law "
    "gives{distance_m:there}, {largest} at most",
    "mass_of_no_blast": "{reading}{distance_m:at} corresponds to {mass_kg}, which is "
    "impossible",
    "in_the_fireball": "{reading}{distance_m:at} corresponds to {mass_kg}, with a "
    "fireball radius of {fireball_m:3}: is the unit right?",
    "peak_rises": "{reading}{distance_m:at} is larger than {other_value} at "
    "{nearer_m:3}: peaks decrease with distance; a factor of 2 to 8 suggests a "
    "reflected pressure",
    "radius_shrinks": "{reading} follows one of {other_value}: shock radii never "
    "decrease",
    "too_slow_between": "{sensor} and {other_sensor} are {apart_m:3} apart, and their "
    "arrivals {late_s:time}: {mean_m_s:short} m/s; no wave in air is slower than "
    "{slowest_m_s:.0f} m/s: a clock, a position or a unit is wrong",
    "slow_together": "the {n_rows} air arrivals together imply a speed of "
    "{speed_m_s:.0f} m/s from one position, slower than sound ({slowest_m_s:.0f} m/s "
    "or more): positions, a unit, or temperature and wind of the scene are wrong",
    "too_slow": "{reading}: {apart_m:3} in {late_s:time} is {mean_m_s:short} m/s; no "
    "wave in air is slower than {slowest_m_s:.0f} m/s",
    "too_fast": "{reading}: {apart_m:3} in {late_s:time}; no blast wave is faster than "
    "{fastest_m_s:short} m/s",
    "unit_slip": "{reading} {unit:looks}, compared with the other rows",
    "units_of_a_quantity": "every {quantity} ({n_rows} rows) {unit:looks}: with that "
    "corrected all rows agree",
    "clock_of_another_zone": "the clock of {sensor} looks {late_s:fast}: is it in "
    "another time zone, or in summer time?",
    "east_north_swapped": "{sensor} agrees with the position {place}: are east and "
    "north swapped?",
    "place_in_feet": "{sensor} agrees with the position {place}: is it in feet?",
    "place_in_km": "{sensor} agrees with the position {place}: is it in km?",
    "sign_of_east": "{sensor} agrees with the position {place}: is a sign wrong?",
    "sign_of_north": "{sensor} agrees with the position {place}: is a sign wrong?",
    "off_in_time": "{reading} is {late_s:late} for {mass_kg}, on which the other rows "
    "agree",
    "off_by_factor": "{reading} is {ratio:ratio} the prediction for {mass_kg}, on "
    "which the other rows agree",
    "of_no_one_blast": "one blast explains at most {agree} of {of} rows, and not those "
    "of {sensors:names}",
    "not_at_the_origin": "the log does not agree with a charge at the origin at time "
    "0, but with one near {place}: set or free position and time in a scene, or use "
    "--free",
    "not_at_time_0": "the log does not agree with a charge at time 0, but with one at "
    "another time: set or free the origin time in a scene, or use --free origin_time_s",
    # the contents of a log
    "degrees": "positions are degrees of WGS84; the origin of east, north and up is "
    "{place}, {alt_m:.6g} m, {whose}",
    "time_zero": "time zero is {start:%Y-%m-%d %H:%M:%S} UTC",
    "freed": "free parameters of a fit without a scene: {names:parameters}",
    # picks
    "nothing_found": "nothing found",
    "onset_alone": "no blast pulse fits the samples; the arrival is the onset of the "
    "signal",
    "clipped": "clipped at {clipped_at_pa:3}",
    "clipped_uncalibrated": "clipped at {clipped_at_pa:.3g} of full scale",
    "hopeless": "the samples do not have the form of a blast pulse (misfit "
    "{misfit:.3g}, expected 1)",
    "misfit": "the samples do not have the form of a blast pulse (misfit {misfit:.3g}, "
    "expected 1)",
    "few_quiet_samples": "too few quiet samples before the front to estimate the noise",
    "under_sampled": "fewer than eight samples in the positive phase",
    "sharp_front": "the front rises within one sample",
    "cut_short": "the record ends before the positive phase does",
    "resonating": "the sensor rings at {resonance_hz:.3g} Hz",
    "high_passed": "the record after the pulse looks high-passed, and no corner was "
    "given; a Friedlander pulse that stays below zero looks the same",
    "later_arrival": "further fronts at {later_arrival_s:.6g} s",
    "zero_shift": "the zero of the gauge shifts at the front: duration and impulse "
    "depend on the time of the shift",
    "reversed_polarity": "reversed polarity: the samples were negated",
    "front_alone": "the record after the front does not have the form of a blast "
    "pulse: arrival and peak are from the front only",
    "duration_unsure": "the duration is poorly constrained",
    "duration_lost": "the pulse is too faint for a duration",
    "faint": "the pulse is faint",
    "continued_decay": "below zero the pressure follows Friedlander's formula, which "
    "has no end; the negative duration is that of a phase of equal depth and impulse",
    "independent": "errors of {names:names} are assumed independent: their covariance "
    "is singular",
    "bangs": "{bangs} bangs; the column shot of the log separates them",
    # why a log has no row of a picked quantity
    "no_row.poor": "quality is poor",
    "no_row.onset_alone": "no pulse fits the samples",
    "no_row.uncalibrated": "the samples have no known scale in pascals",
    "no_row.high_passed": "distorted by a high-pass of unknown corner",
    "no_row.cut_short": "the record ends too early",
    "no_row.zero_shift": "the zero of the gauge shifts at the front",
    "no_row.misfit": "no blast pulse fits the samples",
    "no_row.front_alone": "the record after the front is not a blast pulse",
    "no_row.duration_lost": "the pulse is too faint",
    "no_row.weaker": "weaker than another pick of the same bang: possibly an echo",
    # flights and missions
    "blast_out_of_range": "a blast{share:of_flights} is outside the range of the "
    "{source}: its load is finite, but not reliable",
    "blast_never": "a blast{share:of_flights} does not occur: the time of its charge "
    "is infinite",
    "blast_late": "a blast{share:of_flights} arrives after the end of the flight",
    "blast_not_in_flight": "a blast arrives before or after the flight",
    "not_settled": "{controller} the vehicle{share:of_flights} is outside the "
    "tolerance before the first blast arrives; the results include the effect of start "
    "and wind (a later time_s of the charge leaves time to settle)",
    "lost": "{controller} the integration{share:of_flights} diverged",
    "remark": "{text}",
    "vehicle_crashed": "the vehicle {cause}; results after that are not meaningful",
    "mission_unfinished": "the flight reached the time limit before landing",
    # tuned parameters and gains
    "noise_added": "the scene has no noise: noise_pa is tuned as well",
    "blast_outside": "the record of {seconds:g} s contains no blast: it constrains the "
    "noise only",
    "law_invalid": "{quantities:names} are extrapolated: the sensor lies outside the "
    "range of their laws",
    "thinned": "{used:,} of {count:,} {what} were used, evenly spaced",
    "not_constrained": "the record does not constrain {names:names}",
    "not_separated": "the record does not separate {names:names}: a joint change "
    "leaves it unchanged; fix one of them",
    "interval_of_prior": "{name}: its interval is nearly that of the prior",
    "at_bound": "{name} is at its bound, {value}: the best value lies outside the "
    "permitted range",
    "poor_residuals": "poor fit ({tests:ranges}): the intervals include noise, but no "
    "model error, and are too narrow",
    "search_not_converged": "the search did not converge",
    "gains_not_converged": "the search did not converge: other gains may be better",
    "margins_short": "the scene's gains have margins of {margins:names}, below the "
    "required ones",
    "fewer_fly_on": "{percent:.3g} % fewer flights fly on than with the scene's gains",
    "largest_peak_grew": "the largest peak deviation is larger than before",
    "median_peak_not_less": "the median peak deviation is not less than with the "
    "scene's gains",
    "slower_recovery": "the path error after the blast is larger than with the scene's "
    "gains: recovery is slower",
    # selection of a law
    "choose.exact": "exact",
    "choose.no_reference": "the default law; its error is unknown, as there is no "
    "reference, so no tolerance can be verified",
    "choose.beyond_reference": "Z = {z} m/kg^(1/3); the reference ends at Z = {end:g} "
    "and {distance_km:g} km, so no tolerance can be verified there",
    "choose.not_valid": "Z = {z} m/kg^(1/3), not all inside {range}; no method is "
    "valid at all of it",
    "choose.suffices": "Z = {z} m/kg^(1/3) inside {range}; {quality}",
    "choose.not_verifiable": "Z = {z} m/kg^(1/3) inside {range}; {quality}, so a "
    "tolerance of {tolerance} cannot be verified",
    "choose.most_accurate": "Z = {z} m/kg^(1/3) inside {range}; {quality}; it is the "
    "most accurate method, and misses a tolerance of {tolerance} by a factor of "
    "{short:.2g}",
    # equations of motion, and the evidence against them
    "discover.integrated": "Integration from the first row: misfit {percent:.1f} % of "
    "the spread of {name}, noise removed ({noise_sd:short}){fails}",
    "discover.restarted": "Integration, restarted as errors grow tenfold in "
    "{growth_s}: misfit {percent:.1f} % of the spread of {name}, noise removed "
    "({noise_sd:short}){fails}",
    "discover.diverges": "Integration from the first row: diverges, the data are not "
    "reproduced",
    "discover.held_out": "Held-out data, {segments} segments: the squared error is "
    "{percent:.1f} % smaller than that of a constant prediction",
    "discover.held_out_diverges": "Held-out data, {segments} segments: the integration "
    "diverges",
    "discover.jumps": "the states jump before row {jumped:names}: if these are several "
    "runs, number them in a column run",
    "discover.exchangeable": "{pairs:names} are exchangeable: they are nearly "
    "collinear on this record, and either fits",
    "discover.not_predicted": "on held-out data it is hardly better than a constant "
    "prediction",
    "discover.not_reproduced": "integrated, it does not reproduce {name}",
    "discover.untested": "the residuals could not be tested: the record is too short "
    "for the terms outside of the search",
    "discover.outside": "the residuals correlate with {outside_term}, which is not a "
    "candidate term (p = {outside:short})",
}


def sentence(message: str, source: Any = None, /, **more: Any) -> str:
    """Return a sentence.

    Args:
        message: Kind of a note, or a template.
        source: Mapping, or object whose attributes are named.
        **more: Further numbers, which come first.
    """
    template = MESSAGES.get(message, message)
    return _Sentences().vformat(template, (), _Named(source, more))


def sentence_of(note: Note) -> str:
    """Return the sentence of a note."""
    return sentence(note.kind, note.numbers)


def sentences_of(notes: Iterable[Note]) -> list[str]:
    """Return the sentence of each note."""
    return [sentence_of(note) for note in notes]


def conversion_comments(log: Observations) -> list[str]:
    """Return the provenance of a converted log: its source, and the conversions."""
    origin = f"converted from {Path(log.source).name} by jblast {jblast.__version__}"
    lines = [origin, *sentences_of(log.understood)]
    return [" ".join(line.split()) for line in lines]


def alarm(problem: Note) -> str:
    """Return the sentence of a problem, its name in capitals."""
    name, _, rest = sentence_of(problem).partition(":")
    kind, bracket, numbers = name.partition(" (")
    return f"{kind.upper()}{bracket}{numbers}:{rest}."


def alarm_name(problem: Note) -> str:
    """Return the name of a problem, which is the start of its sentence."""
    return sentence_of(problem).partition(":")[0]


def printed_p(p: float) -> str:
    """Return a probability with its comparison sign: "= 0.27", "< 0.001"."""
    # imported where a fit is worded: conversions of a log need no JAX
    from jblast.inference.fitting.goodness_of_fit import POOR

    if p < POOR:
        return f"< {POOR}"
    return f"> {1 - POOR}" if p > 1 - POOR else f"= {p:.2g}"


def listed(parts: Iterable[str]) -> str:
    """Return a list for a sentence, shortened if it is long."""
    parts = list(parts)
    if (more := len(parts) - MAX_NAMED) > 0:
        parts = [*parts[:MAX_NAMED], f"{more} more"]
    return joined(parts)


def _named(wrong: Any) -> str:
    """Return what is wrong of a log: a clock, a sensor, or the order of two."""
    if wrong.kind == "exchange":
        return f"the order of {wrong.name} and {wrong.other}"
    return f"the {wrong.kind} {wrong.name}"


def _hours_or_less(seconds: float) -> str:
    """Return a time with its unit, from one hour on in hours."""
    if abs(seconds) >= 3600:
        return f"{seconds / 3600:.4g} h"
    return printed_number("_s", seconds, 3)


def _signed(seconds: float, more: str, less: str) -> str:
    return f"{_hours_or_less(abs(seconds))} {more if seconds > 0 else less}"


def _value(name: str, value: float) -> str:
    from jblast.report.estimates import printed_value

    return printed_value(name, value)


def _with_interval(name: str, estimate: Any) -> str:
    from jblast.report.estimates import printed_estimate

    printed = printed_estimate(name, estimate)
    return f"{parameter_words(name)} {printed.value} (90 %: {printed.interval})"


FORMS: Mapping[str, Callable[[Any], str]] = {
    "p": printed_p,
    "names": listed,
    "or": " or ".join,
    "option": ",".join,
    "ranges": "; ".join,
    "law": lambda laws: " ".join(f"--law {law}" for law in laws),
    "parameter": parameter_words,
    "parameters": lambda names: listed(map(parameter_words, names)),
    "quantity": quantity_words,
    "quantities": lambda names: listed(map(quantity_words, names)),
    "wrong": lambda wrong: " or ".join(map(_named, wrong)),
    "values": lambda values: listed(
        f"{parameter_words(name)} {_value(name, value)}"
        for name, value in values.items()
    ),
    "times": lambda factors: listed(
        f"{parameter_words(name)} {factor:.2g} times"
        for name, factor in factors.items()
    ),
    "short": significant,
    "time": _hours_or_less,
    "late": lambda late: _signed(late, "too late", "too early"),
    "fast": lambda late: _signed(late, "fast", "slow"),
    "at": lambda distance: (
        f" at {printed_number('_m', distance, 3)}" if distance else ""
    ),
    "there": lambda distance: " there" if distance else "",
    "looks": lambda unit: (
        f"looks like {unit}" if "written" in unit else f"looks {unit} the true value"
    ),
    "ratio": lambda ratio: (
        f"{significant(ratio)} times" if ratio > 1 else f"1/{significant(1 / ratio)} of"
    ),
    "of_flights": lambda share: (
        "" if share == 1 else f" of {100 * share:.3g} % of the flights"
    ),
    "shot": lambda shot: f"shot {shot}" if shot else "the shot",
    "estimates": lambda found: listed(_with_interval(*pair) for pair in found.items()),
    "free": lambda parameter: f"; to fit it: --free {parameter}" if parameter else "",
    "masses": lambda found: "".join(
        f": {_with_interval(name, estimate)}"
        for name, estimate in found.items()
        if name.startswith("charge_mass_kg")
    ),
}
"""Forms of numbers and names in a template, beside those of Python."""


class _Named(dict):
    """Fields of a template, of a mapping or an object."""

    def __init__(self, source: Any, more: Mapping[str, Any]):
        super().__init__(more)
        self.source = source

    def __missing__(self, name: str) -> Any:
        is_mapping = isinstance(self.source, Mapping)
        return self.source[name] if is_mapping else getattr(self.source, name)


class _Sentences(Formatter):
    """Formats fields by `FORMS`; a number without a form has the unit of its name.

    A form of digits, as in `{apart_m:3}`, is a number of significant digits with the
    unit of the name. Other words are a noun that is counted: `{rows:row}`.
    """

    def get_field(self, field_name: str, args: Any, kwargs: Any) -> tuple[Any, Any]:
        value, key = super().get_field(field_name, args, kwargs)
        return (field_name, value), key

    def format_field(self, value: Any, format_spec: str) -> str:
        name, number = value
        if format_spec in FORMS:
            return FORMS[format_spec](number)
        if len(format_spec) > 1 and format_spec.replace(" ", "").isalpha():
            return f"{number:,} {format_spec}" + "s" * (number != 1)
        digits = int(format_spec) if format_spec.isdigit() else 2
        has_unit = isinstance(number, float) and split_name(name)[1]
        if has_unit and (not format_spec or format_spec.isdigit()):
            return printed_number(name, number, digits)
        return format(number, format_spec)
