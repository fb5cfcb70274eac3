import csv

import pytest

from jblast.verification.benchmark.chart import BENCHMARKS, Benchmark, BenchmarkPoint

HALVES = "halves of something"


@pytest.fixture
def topic(monkeypatch):
    points = [
        BenchmarkPoint("cheap", 1e-8, 0.3, "Z = 1 to 40", "near"),
        BenchmarkPoint("dear", 1e-6, 0.01, "Z = 1 to 40", "near", is_reference=True),
        BenchmarkPoint("worse", 2e-6, 0.5, "Z = 1 to 40", "near"),
        BenchmarkPoint("slow", 0.7, 0.005, "Z = 2 to 9", "near", whole=False),
        BenchmarkPoint("alone", 1e-7, 0.2, "Z = 40 to 1000", "far"),
    ]
    fake = Benchmark("halves", HALVES, "a half", "a share", lambda: points)
    import jblast.verification.benchmark  # noqa: F401  the real ones enter the table first

    monkeypatch.setitem(BENCHMARKS, "halves", fake)
    return fake


def test_a_chart_is_a_figure_a_table_to_read_and_one_to_work_with(jblast, topic):
    code, out, err = jblast("chart", "halves", "--out", jblast.path("out"))
    assert (code, err) == (0, "")
    assert HALVES in out
    assert jblast.text("out/halves.md") + "\n" == out
    rows = list(csv.DictReader(jblast.text("out/halves.csv").splitlines()))
    assert list(rows[0]) == ["method", "cost_s", "error", "on_front", "range"]
    front = {row["method"]: row["on_front"] for row in rows}
    assert front == {
        "cheap": "true",
        "dear": "true",
        "worse": "false",
        "slow": "false",
        "alone": "true",
    }
    assert float(rows[0]["cost_s"]) == 1e-8
    assert (jblast.directory / "out/halves.png").stat().st_size > 10_000


def test_an_unknown_topic_lists_them(jblast):
    code, out, err = jblast("chart", "arival")
    assert (code, out) == (2, "")
    for name in ("arrival", "pressure", "waveform", "fit", "sampler", "all"):
        assert name in err


def test_help_names_every_topic():
    from jblast.cli.arguments.verb_parser import VerbParser
    from jblast.cli.verbs import chart
    from jblast.verification.benchmark import BENCHMARKS

    verb = VerbParser("jblast chart", "Chart.", "jblast chart laws")
    chart.add_arguments(verb)
    for name in BENCHMARKS:
        assert name in verb.format_help()


@pytest.mark.slow
def test_laws_are_measured_and_every_panel_has_a_front(jblast):
    code, _, _ = jblast("chart", "arrival", "--out", jblast.path("out"))
    assert code == 0
    rows = list(csv.DictReader(jblast.text("out/arrival.csv").splitlines()))
    methods = {row["method"] for row in rows}
    assert {"kingery_bulmash", "wu_hao", "euler", "acoustic"} <= methods
    assert all(float(row["cost_s"]) > 0 and float(row["error"]) > 0 for row in rows)
    for near in ("surface", "free air"):
        assert any(
            row["on_front"] == "true" for row in rows if row["range"].startswith(near)
        )
