import json
import re
from html.parser import HTMLParser

import pytest
from matplotlib.figure import Figure

from jblast.errors import InputError
from jblast.report import figure_files, write_report
from jblast.report.fit import figures
from jblast.report.fit.document import fit_document
from jblast.results import plain
from tests.report import example


class Tags(HTMLParser):
    """Collects every tag, and checks that they close in order."""

    EMPTY = ("meta", "img", "br")

    def __init__(self, page):
        super().__init__()
        self.open, self.seen = [], []
        self.feed(page)

    def handle_starttag(self, tag, attrs):
        self.seen.append((tag, dict(attrs)))
        if tag not in self.EMPTY:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag


DRAWN = (example.three_parameters, example.with_outliers)
"""Whose figures are rasterised; of the others, `test_figures` looks at the artists."""


@pytest.fixture(scope="module")
def pages(tmp_path_factory):
    """Every example's report, written once, in place of most figures an empty one."""
    root = tmp_path_factory.mktemp("reports")
    empty = figure_files.figure_bytes(Figure((1, 1)), "png")
    written = {}
    for make in example.EVERY:
        with pytest.MonkeyPatch.context() as patch:
            if make not in DRAWN:
                patch.setattr(figure_files, "figure_bytes", lambda *_: empty)
            written[make.__name__] = write_report(make(), root / make.__name__)
    return root, written


def test_the_json_is_the_answer(pages):
    root, _ = pages
    for make in example.EVERY[:-1]:
        text = (root / make.__name__ / "fit.json").read_text("utf-8")
        told = json.loads(text)
        assert told.pop("provenance")["scene"] is None
        assert told == fit_document(make())


def test_the_json_holds_null_for_nan(pages):
    root, _ = pages
    text = (root / "no_draws" / "fit.json").read_text("utf-8")
    assert "NaN" not in text
    assert json.loads(text)["estimates"]["charge_mass_kg"]["value"] is None
    assert json.loads(text)["chi2"] is None


def test_arrays_and_numbers_of_numpy_become_plain_json():
    import numpy as np

    given = {"a": np.float64(np.inf), "b": np.array([1.0, np.nan]), "c": np.bool_(True)}
    assert plain(given) == {"a": None, "b": [1.0, None], "c": True}
    assert plain((np.int64(3), np.float32(0.5))) == [3, 0.5]


def test_the_page_needs_nothing_beside_it(pages):
    root, written = pages
    for name in written:
        page = (root / name / "report.html").read_text("utf-8")
        # what pictures are packed to may spell anything
        words = re.sub(r"data:image/png;base64,[\w+/=]+", "", page)
        assert "http" not in words
        assert "/home/somebody" not in page
        tags = Tags(page)
        assert tags.open == []
        assert not {"script", "link", "iframe"} & {tag for tag, _ in tags.seen}
        for tag, attributes in tags.seen:
            if tag == "img":
                assert attributes["src"].startswith("data:image/")
                assert len(attributes["alt"]) > 20


def test_what_a_user_wrote_is_escaped(pages):
    root, _ = pages
    page = (root / "with_outliers" / "report.html").read_text("utf-8")
    assert "<script" not in page
    assert "&lt;script&gt;alert(&#39;$x&#39;)&lt;/script&gt;" in page


def test_a_directory_with_files_is_refused_and_left_as_it_was(tmp_path):
    (tmp_path / "fit.json").write_text("precious")
    with pytest.raises(
        InputError, match=r"already holds files.*for the report.*--force"
    ):
        write_report(example.no_draws(), tmp_path)
    assert [p.name for p in tmp_path.iterdir()] == ["fit.json"]
    assert (tmp_path / "fit.json").read_text() == "precious"


def test_force_replaces_a_report_and_leaves_other_files(tmp_path):
    for name in ("notes.txt", "corner.png", "fit.json"):
        (tmp_path / name).write_text("old")
    write_report(example.no_draws(), tmp_path, force=True)
    assert (tmp_path / "notes.txt").read_text() == "old"
    assert not (tmp_path / "corner.png").exists()  # it would show another fit
    assert json.loads((tmp_path / "fit.json").read_text())["converged"] is False


def test_a_file_in_the_place_of_the_directory_is_refused(tmp_path):
    path = tmp_path / "out"
    path.write_text("")
    with pytest.raises(InputError, match="expected a directory"):
        write_report(example.no_draws(), path, force=True)


def test_a_figure_that_fails_costs_only_itself(tmp_path, monkeypatch):
    def fails(fit):
        raise RuntimeError("no ink <left>")

    monkeypatch.setattr(figures, "residuals_figure", fails)
    with pytest.warns(UserWarning, match=r"residuals.png was not written.*no ink"):
        paths = write_report(example.no_draws(), tmp_path)
    left = {"fit.json", "map.png", "recordings.png", "report.html"}
    assert {p.name for p in paths} == left
    page = (tmp_path / "report.html").read_text("utf-8")
    assert re.search(r"residuals.png was not written.*no ink &lt;left&gt;", page)
