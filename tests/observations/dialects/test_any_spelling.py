"""Whatever unit, separator, decimal mark or encoding: the same log, or a refusal."""

import io
import math
import re

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from jblast.errors import InputError
from jblast.observations import read
from jblast.units import LENGTHS, PRESSURES, TIMES, our_name, overpressure, si_factor

PLAIN = settings(deadline=None, max_examples=60)
NUMBERS = st.floats(1e-6, 1e9, allow_nan=False).map(lambda x: float(f"{x:.12g}"))
UNITS = st.one_of(
    st.sampled_from([("peak_overpressure", unit) for unit in PRESSURES]),
    st.sampled_from([("positive_duration", unit) for unit in TIMES]),
    st.sampled_from([("ground_displacement", unit) for unit in LENGTHS]),
    st.builds(
        lambda pressure, time: ("positive_impulse", f"{pressure}_{time}"),
        st.sampled_from(list(PRESSURES)),
        st.sampled_from(list(TIMES)),
    ),
)
GROUPED = re.compile(r"[1-9]\d{0,2}[.,]\d{3}")


@PLAIN
@given(
    UNITS,
    st.lists(NUMBERS, min_size=1, max_size=4, unique=True),
    st.sampled_from([",", ";", "\t"]),
    st.sampled_from([".", ","]),
    st.sampled_from(["utf-8", "utf-8-sig", "utf-16"]),
)
def test_a_log_is_the_same_in_any_dialect(named, values, separator, decimal, encoding):
    word, unit = named
    texts = [repr(value).replace(".", decimal) for value in values]
    rows = [
        f'a{separator}{word}_{unit}{separator}"{text}"{separator}' for text in texts
    ]
    header = separator.join(["sensor", "quantity", "value", "sigma"])
    file = io.BytesIO("\n".join([header, *rows]).encode(encoding))
    marked = [text for text in texts if decimal in text]
    unsure = bool(marked) and all(GROUPED.fullmatch(text) for text in marked)
    if unsure and (decimal == "," or separator == ";"):
        with pytest.raises(InputError, match="may be either"):
            read(file)
        return
    np.testing.assert_allclose(
        read(file).value, np.array(values) * si_factor(unit), rtol=1e-15
    )


@PLAIN
@given(st.floats(-50, 220), st.floats(0.01, 20))
def test_a_level_and_its_error_are_straight_in_ln(level, sigma):
    text = f"sensor,quantity,value,sigma\na,peak_level_db,{level!r},{sigma!r}\n"
    found = read(io.StringIO(text))
    pressure = overpressure(np.array([level, level + sigma]))
    np.testing.assert_allclose(found.value, pressure[:1], rtol=1e-14)
    up = math.log(pressure[1] / pressure[0])
    np.testing.assert_allclose(found.error_scale(), up, rtol=1e-9)


@PLAIN
@given(st.text(max_size=25))
def test_any_name_is_ours_in_a_unit_or_none_and_nothing_else_happens(name):
    found = our_name(name)
    assert found is None or found.factor > 0 or found.dimension == "level"
