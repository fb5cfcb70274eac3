from dataclasses import replace

import numpy as np
import pytest

from jblast.errors import InputError
from jblast.observations import read, some_rows, write
from jblast.observations.covariances import covariance_file, rows_with_covariance
from jblast.observations.grouping import one_event
from jblast.observations.table import RecordCovariance
from tests.inference.logs import log

QUANTITIES = ("peak_overpressure_pa", "positive_duration_s", "positive_impulse_pa_s")
SD = np.array([0.05, 0.02, 0.03])  # of ln
CORRELATION = np.array([[1.0, -0.6, 0.3], [-0.6, 1.0, 0.4], [0.3, 0.4, 1.0]])


def picked(names=("g1", "g2")):
    """Picks of some records, with what they share."""
    rows = [
        (name, quantity, value, sigma, 20.0)
        for name in names
        for quantity, value, sigma in zip(
            QUANTITIES, (50e3, 0.02, 300.0), (2500.0, 4e-4, 9.0), strict=True
        )
    ]
    matrix = CORRELATION * SD * SD[:, None]
    return replace(
        log(*rows, at_range=True),
        record=tuple(name for name in names for _ in QUANTITIES),
        covariances=tuple(RecordCovariance(n, QUANTITIES, matrix) for n in names),
    )


def written(tmp_path, observations=None):
    path = tmp_path / "picks.csv"
    write(path, observations or picked())
    return path


def test_what_is_written_reads_back_to_the_last_digit(tmp_path):
    path = written(tmp_path, picked(("g1", 'a "quoted", name')))
    back = read(path).covariances
    for one, other in zip(
        back, picked(("g1", 'a "quoted", name')).covariances, strict=True
    ):
        assert (one.record, one.quantities) == (other.record, other.quantities)
        # lower half as it was, to the last digit; the upper is made its mirror
        np.testing.assert_array_equal(np.tril(one.matrix), np.tril(other.matrix))


def test_a_sigma_that_disagrees_is_refused_with_both(tmp_path):
    path = written(tmp_path)
    path.write_text(path.read_text().replace("2500.0", "2600.0", 1))
    with pytest.raises(InputError, match=r"line 2, column sigma.*2500.*2600"):
        read(path)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "line 1: .*expected a header"),
        ("g1,peak_overpressure_pa,peak_overpressure_pa,nan\n", "a finite number"),
        (
            "g1,peak_overpressure,peak_overpressure_pa,1\n",
            "column quantity: expected one of",
        ),
        (",peak_overpressure_pa,peak_overpressure_pa,1\n", "expected a name"),
        ("g1,peak_overpressure_pa,1\n", "expected 4 fields"),
        (
            "g1,peak_overpressure_pa,peak_overpressure_pa,-1\n",
            r"positive definite, got \[\[-1.0\]\]",
        ),
        (
            "g1,peak_overpressure_pa,positive_duration_s,1e-3\n",
            "expected a covariance of peak_overpressure_pa with peak_overpressure_pa",
        ),
        (
            "g1,peak_overpressure_pa,peak_overpressure_pa,1\n"
            "g1,peak_overpressure_pa,positive_duration_s,1\n"
            "g1,positive_duration_s,positive_duration_s,1\n",
            "positive definite",
        ),
        (
            "g1,peak_overpressure_pa,peak_overpressure_pa,1\n"
            "g1,peak_overpressure_pa,peak_overpressure_pa,2\n",
            "got 1 and 2",
        ),
    ],
)
def test_what_is_no_covariance_is_refused(tmp_path, text, message):
    path = written(tmp_path)
    header = "record,quantity,with,covariance\n" if text else ""
    covariance_file(path).write_text(header + text)
    with pytest.raises(InputError, match=message):
        read(path)


def test_of_a_row_taken_out_the_others_keep_their_covariance():
    kept = some_rows(picked(), np.array([0, 2, 3]))
    (rows, both), (last, alone) = rows_with_covariance(kept)
    np.testing.assert_array_equal(rows, [0, 1])
    np.testing.assert_allclose(both.correlation, [[1, 0.3], [0.3, 1]], rtol=1e-12)
    assert last.tolist() == [2]
    assert alone.own_share == pytest.approx(1.0)


def test_a_quantity_of_a_record_in_two_rows_is_refused():
    twice = some_rows(picked(), np.array([0, 0]))
    with pytest.raises(InputError, match=r"row 2.*expected one row"):
        list(rows_with_covariance(twice))


def test_recordings_of_one_event_keep_records_of_one_name_apart():
    logs = [replace(picked(("g",)), source=name) for name in ("one.csv", "two.csv")]
    both, _ = one_event(logs)
    assert [of.record for of in both.covariances] == ["one/g", "two/g"]
    assert [len(rows) for rows, _ in rows_with_covariance(both)] == [3, 3]
