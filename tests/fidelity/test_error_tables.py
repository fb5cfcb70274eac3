"""The stored tables are what would be measured now."""

from itertools import pairwise

import numpy as np
import pytest

from calibration.fidelity import spans
from jblast.fidelity import errors
from jblast.fidelity.errors import (
    BURSTS,
    FAR_NODES,
    MASSES,
    NODES,
    REFERENCES,
    exponents,
    log_losses,
    log_ratio,
    methods_for,
    standard_path,
)

PRINTED = 1e-5
"""Half of the last digit of the tables, and what rounding adds."""


@pytest.mark.slow
@pytest.mark.parametrize("burst", BURSTS)
@pytest.mark.parametrize("quantity", REFERENCES)
def test_errors_are_as_stored(quantity, burst):
    table = errors.error_table(quantity, burst)
    np.testing.assert_allclose(np.exp(table.log_z), NODES, rtol=1e-11)
    assert set(table.log_ratio) == set(methods_for(quantity))
    path = standard_path(NODES, burst)
    for method, kept in table.log_ratio.items():
        now = log_ratio(quantity, method, path, lossless=True)
        np.testing.assert_allclose(now, kept, rtol=0, atol=PRINTED, err_msg=method)
        # six digits are printed
        powers = exponents(quantity, method, burst)
        np.testing.assert_allclose(powers, table.exponents[method], atol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("burst", BURSTS)
def test_losses_are_as_stored(burst):
    table = errors.loss_table(burst)
    np.testing.assert_allclose(np.exp(table.log_z), FAR_NODES, rtol=1e-11)
    np.testing.assert_allclose(np.exp(table.log_mass), MASSES, rtol=1e-11)
    now = log_losses(burst)[:, :, ::-1]  # pressures ascend as altitudes fall
    np.testing.assert_allclose(now, table.log_loss, rtol=0, atol=PRINTED)


def test_references_are_as_stored():
    now = spans()
    rows = errors.table_rows("references")
    assert len(now) == len(rows)
    for span, row in zip(now, rows, strict=True):
        assert (span.quantity, span.burst) == (row["quantity"], row["burst"])
        assert span.evidence == row["evidence"]
        # two digits are printed
        assert span.error == pytest.approx(float(row["e_ref"]), rel=0.06)
        assert span.start == pytest.approx(float(row["z_from"]), rel=1e-5)
        assert span.end == float(row["z_to"])


def test_spans_of_a_reference_leave_no_gap():
    for quantity in REFERENCES:
        for burst in BURSTS:
            uncertainty = errors.reference_uncertainties(quantity, burst)
            for near, far in pairwise(uncertainty):
                assert near.end == far.start
            assert uncertainty[-1].end == REFERENCES[quantity][-1].end


def test_every_method_has_a_cost():
    costs = errors.cost_table()
    for quantity in REFERENCES:
        assert all(costs[quantity, m] > 0 for m in methods_for(quantity))
