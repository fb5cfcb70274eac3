"""`jblast detect` of several clips."""

import json

import pytest

from tests.signals.records.test_clips import STATIONS
from tests.test_mutations_of_files import clip


@pytest.mark.slow
def test_several_clips_make_one_log_of_their_own_clocks(jblast):
    bangs = {"one": 0.4, "two": 0.7}
    paths = [
        str(clip(jblast.directory / f"{name}.mp4", bang, 3.0))
        for name, bang in bangs.items()
    ]
    out = jblast.directory / "out"
    words = ("--positions", jblast.file("stations.csv", STATIONS), "--out", str(out))
    _, told, _ = jblast("detect", *paths, *words, "--json")
    answers = json.loads(told)["clips"]
    for answer, bang in zip(answers, bangs.values(), strict=True):
        assert answer["bang_s"] == pytest.approx(bang, abs=2e-3)
    rows = (out / "observations.csv").read_text().splitlines()[-2:]
    assert [row.split(",")[0] for row in rows] == [*bangs]
    assert [row.split(",")[-1] for row in rows] == [*bangs]
