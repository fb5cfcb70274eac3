"""What an answer says of its intervals is what the kept table says."""

from pathlib import Path

import jblast
from jblast.report.text import HELD

TABLE = Path(jblast.__path__[0]).parent / "calibration/results/coverage_default.txt"


def test_the_share_that_an_answer_prints_is_that_of_the_kept_table():
    rows = {
        line.split()[0]: [float(x) for x in line.split()[1:]]
        for line in TABLE.read_text(encoding="utf-8").splitlines()
        if line.startswith(("weighted   ", "laplace"))
    }
    for weighted, (least, most) in HELD.items():
        shares = rows["weighted" if weighted else "laplace"]
        assert len(shares) == 4
        # in whole per cent, towards what is not flattering
        assert 0 <= 100 * min(shares) - least < 1
        assert 0 <= 100 * max(shares) - most < 1
