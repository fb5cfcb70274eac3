"""Tasks of `jblast study`, and the options of each."""

import json

import pytest

from tests.study.example import written

REFUSED = {
    "": "study run: expected one STUDY.toml, got nothing",
    "a.toml b.toml": "study run: expected one STUDY.toml, got a.toml b.toml",
    "study.toml": "--out: expected the folder of the store, got nothing",
    "study.toml --out store --force": "--force: expected no such option of study run",
    "report": "study report: expected one store, got nothing",
    "report store --limit 5": "--limit: expected no such option of study report",
    "report store --resume": "--resume: expected no such option of study report",
    "report none.zarr": "none.zarr: no such store; expected a store of jblast study",
    "merge a.zarr": "merge: expected at least two stores, got 1",
    "merge a.zarr b.zarr --devices 2": "--devices: expected no such option of study",
    "--list --out store": "--out: expected no such option of study list",
    **{
        f"study.toml --out store --devices {word}": "--devices: expected all, or a"
        for word in ("0", "-1", "1.5", "²", "9" * 5000)
    },
}


@pytest.mark.parametrize(("words", "message"), REFUSED.items())
def test_unsuitable_options_are_refused(jblast, tmp_path, monkeypatch, words, message):
    written(tmp_path)
    monkeypatch.chdir(tmp_path)
    assert message in jblast.refused("study", *words.split())
    assert not (tmp_path / "store").exists()


def test_a_study_is_run_reported_and_merged(jblast, tmp_path, monkeypatch):
    written(tmp_path)
    monkeypatch.chdir(tmp_path)

    def answer(line):
        code, out, _ = jblast("study", *line.split())
        assert code == 0
        return out

    assert json.loads(answer("study.toml --out s.zarr --json"))["complete"]
    assert "air_arrival_s" in answer("report s.zarr --out page")
    names = {path.name for path in (tmp_path / "page").iterdir()}
    assert {"study.json", "report.html", "exceedance.png"} <= names
    assert "--force" in jblast.refused("study", "report", "s.zarr", "--out", "page")
    answer("study.toml --out t.zarr")
    merged = json.loads(answer("merge s.zarr t.zarr --out u.zarr --json"))
    assert (merged["stores"], merged["complete"]) == (2, True)
