import hashlib
import html
import json
import re

from jblast.report import write_report
from jblast.report.provenance import provenance_lines, provenance_of
from tests.report import example

SCENE = '[charge]\nmass_kg = "free"  # <of one & another>\n'


def test_files_are_told_by_name_and_sha256(tmp_path):
    log, scene = tmp_path / "a b.csv", tmp_path / "scene.toml"
    log.write_bytes(b"sensor,quantity\r\n")
    scene.write_text(SCENE, "utf-8")
    made = provenance_of([log], str(scene), ["jblast", "fit", "a b.csv"])
    assert made.command == "jblast fit 'a b.csv'"
    (told,) = made.logs
    assert told.name == "a b.csv"
    assert told.sha256 == hashlib.sha256(b"sensor,quantity\r\n").hexdigest()
    assert made.scene is not None
    assert made.scene.sha256 == hashlib.sha256(SCENE.encode()).hexdigest()
    assert made.scene_text == SCENE
    said = "\n".join(provenance_lines(made))
    assert told.sha256 in said
    assert str(tmp_path) not in said


def test_covariances_beside_a_log_are_told_with_it(tmp_path):
    for name in ("picks.csv", "picks.covariance.csv"):
        (tmp_path / name).write_text(name)
    made = provenance_of([tmp_path / "picks.csv"])
    assert [file.name for file in made.logs] == ["picks.csv", "picks.covariance.csv"]


def test_the_page_and_the_answer_hold_all_of_it(tmp_path):
    scene = tmp_path / "scene.toml"
    scene.write_text(SCENE, "utf-8")
    made = provenance_of(scene=scene, command=["jblast", "fit"])
    assert made.scene is not None
    write_report(example.no_draws(), tmp_path / "out", made=made)
    page = (tmp_path / "out" / "report.html").read_text("utf-8")
    told = json.loads((tmp_path / "out" / "fit.json").read_text("utf-8"))["provenance"]
    assert told["scene"]["sha256"] == made.scene.sha256
    assert told["command"] == "jblast fit"
    for words in (made.scene.sha256, made.date, "Command: jblast fit"):
        assert words in page
    (shown,) = re.findall(
        r"<summary>The scene</summary>\s*<pre>(.*?)</pre>", page, re.S
    )
    assert html.unescape(shown).strip() == SCENE.strip()
