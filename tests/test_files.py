"""What is written is there whole, or what was there before is."""

import csv
import os
import re
import signal
import stat
import subprocess
import sys
from pathlib import Path

import pytest

import jblast
from jblast.errors import InputError
from jblast.files import check_out, replacing, table_text, write_bytes, write_text

PACKAGE = Path(jblast.__file__).parent
OLD, NEW = b"the old content", b"the new content, which is longer"


@pytest.fixture
def old(tmp_path):
    path = tmp_path / "answer.json"
    path.write_bytes(OLD)
    return path


def permissions(path):
    return stat.S_IMODE(path.stat().st_mode)


def test_csv_reads_back_whatever_a_cell_contains():
    rows = [["log", "error"], ['a "b", c', "two\nlines"], ["", 0.1]]
    text = table_text(rows, ["a comment\nof one line"])
    comment, *lines = text.splitlines(keepends=True)
    assert comment == "# a comment of one line\n"
    assert list(csv.reader(lines))[1] == rows[1]
    assert "\r" not in text
    assert table_text([["a"], [None]]) == 'a\n""\n'


@pytest.mark.parametrize("name", ["fly.json", "report.html"])
def test_files_of_an_answer_and_its_page_are_not_overwritten(tmp_path, name):
    check_out(tmp_path / "new", ["fly.json"], force=False)
    (tmp_path / name).touch()
    with pytest.raises(InputError, match=f"{name}: exists already"):
        check_out(tmp_path, ["fly.json"], force=False)
    check_out(tmp_path, ["fly.json"], force=True)


def test_text_is_utf_8_and_its_lines_end_in_one_byte(tmp_path):
    write_text(tmp_path / "a.csv", "Δp\n1.5\n")
    assert (tmp_path / "a.csv").read_bytes() == "Δp\n1.5\n".encode()


@pytest.mark.parametrize("durable", [True, False])
def test_a_file_is_replaced_and_nothing_is_left_beside_it(old, durable):
    write_bytes(old, NEW, durable=durable)
    assert old.read_bytes() == NEW
    assert os.listdir(old.parent) == [old.name]


def half_written(path, error):
    with replacing(path) as temporary:
        temporary.write_bytes(NEW[:5])
        assert temporary.parent == path.parent
        raise error


@pytest.mark.parametrize("error", [ValueError("no ink"), KeyboardInterrupt("no ink")])
def test_what_fails_half_way_leaves_the_old_file_and_nothing_else(old, error):
    with pytest.raises(type(error), match="no ink"):
        half_written(old, error)
    assert old.read_bytes() == OLD
    assert os.listdir(old.parent) == [old.name]


KILLED = """
import sys, time
from jblast.files import replacing
with replacing(sys.argv[1]) as temporary:
    temporary.write_bytes(b"half")
    print("half way", flush=True)
    time.sleep(60)
"""


def test_a_process_that_is_killed_leaves_the_old_file(old):
    environment = {**os.environ, "PYTHONPATH": str(PACKAGE.parent)}
    command = [sys.executable, "-c", KILLED, str(old)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, env=environment) as child:
        assert child.stdout is not None
        assert child.stdout.readline() == b"half way\n"
        child.send_signal(signal.SIGKILL)
    assert child.returncode == -signal.SIGKILL
    assert old.read_bytes() == OLD
    # a part is left, which no glob of ours takes for a file: it is hidden, and named so
    (left,) = {path.name for path in old.parent.iterdir()} - {old.name}
    assert re.fullmatch(r"\.answer\.json\.[0-9a-f]{8}\.part", left)
    write_bytes(old, NEW)
    assert old.read_bytes() == NEW


@pytest.mark.parametrize("mask", [0o022, 0o077])
def test_a_new_file_has_the_permissions_of_the_umask(tmp_path, mask):
    before = os.umask(mask)
    try:
        write_bytes(tmp_path / "new", NEW)
        (tmp_path / "plain").write_bytes(NEW)
    finally:
        os.umask(before)
    assert permissions(tmp_path / "new") == permissions(tmp_path / "plain")
    assert permissions(tmp_path / "new") == 0o666 & ~mask


def test_a_link_stays_one_and_its_target_is_replaced(old):
    (old.parent / "elsewhere").mkdir()
    link = old.parent / "elsewhere" / "link.json"
    link.symlink_to(Path("..") / old.name)
    write_bytes(link, NEW)
    assert link.is_symlink()
    assert old.read_bytes() == NEW
    assert os.listdir(link.parent) == [link.name]


def test_what_cannot_be_replaced_is_written_in_place(tmp_path):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    reading = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    try:
        write_bytes(pipe, NEW)
        assert os.read(reading, 100) == NEW
    finally:
        os.close(reading)
    assert stat.S_ISFIFO(pipe.stat().st_mode)


TO_STDOUT = """
from jblast.files import write_text
write_text("/dev/stdout", "one\\n")
print("two", flush=True)
"""


def test_standard_output_is_written_to_through_a_pipe():
    environment = {**os.environ, "PYTHONPATH": str(PACKAGE.parent)}
    command = [sys.executable, "-c", TO_STDOUT]
    child = subprocess.run(command, capture_output=True, env=environment, check=True)
    assert child.stdout == b"one\ntwo\n"


def looped(folder):
    (folder / "loop").symlink_to("loop")
    return folder / "loop"


def reason(write, path):
    try:
        write(path, NEW)
    except OSError as error:
        return error.errno, error.strerror
    return None


WRONG = {
    "no folder": lambda folder: folder / "none" / "a.csv",
    "a folder": lambda folder: folder,
    "a file for a folder": lambda folder: folder / "answer.json" / "a.csv",
    "a loop of links": looped,
    "too long a name": lambda folder: folder / ("n" * 256),
    "a full disk": lambda folder: Path("/dev/full"),
}


@pytest.mark.parametrize("wrong", WRONG)
def test_the_reason_is_what_writing_straight_would_give(old, wrong):
    path = WRONG[wrong](old.parent)
    there = sorted(old.parent.iterdir())
    straight = reason(Path.write_bytes, path)
    assert straight is not None
    assert reason(write_bytes, path) == straight
    assert sorted(old.parent.iterdir()) == there


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write anywhere")
def test_what_must_not_be_written_to_is_not_replaced(old):
    old.chmod(0o444)
    with pytest.raises(PermissionError, match="Permission denied"):
        write_bytes(old, NEW)
    assert old.read_bytes() == OLD
    old.chmod(0o644)
    old.parent.chmod(0o555)  # no file can be made here, though this one may be written
    try:
        with pytest.raises(PermissionError, match="Permission denied"):
            write_bytes(old.parent / "new", NEW)
        write_bytes(old, NEW)
    finally:
        old.parent.chmod(0o755)
    assert old.read_bytes() == NEW


BY_HAND = re.compile(
    r"\.write_(text|bytes)\(|\.savefig\(|\.to_netcdf\(|\.tofile\(|\bopen\([^)\n]*"
    r"[\"'][wax]|\bnp\.(save|savez|savez_compressed|savetxt)\(|\btempfile\b|umask\("
)
"""Ways to write a file."""
THROUGH_FILES = re.compile(r"with (\(\s*)?replacing\(")
ALLOWED = {
    "autopilot/mavlink.py": "a log, which is added to as a flight goes on",
    "cli/main.py": "into os.devnull",
    "report/detect.py": "clips in a temporary folder, whose bytes the answer has",
    "observations/records/arrays.py": "to the standard output of a reader process",
    **dict.fromkeys(
        (
            "sensors/camera/files/event_tables.py",
            "sensors/camera/files/evt3.py",
        ),
        "what `files/event_files.py` replaces the file by",
    ),
}


def test_whatever_writes_a_file_writes_it_whole():
    found = {
        str(path.relative_to(PACKAGE))
        for path in PACKAGE.rglob("*.py")
        if BY_HAND.search(path.read_text())
        and not THROUGH_FILES.search(path.read_text())
    }
    assert found == set(ALLOWED)
