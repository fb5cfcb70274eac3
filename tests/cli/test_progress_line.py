"""What a command says while it works, by a clock that the test winds."""

import io
import subprocess
import sys
from typing import Any, cast

import pytest

from jblast import progress_line
from jblast.errors import InputError
from jblast.progress import counted, each, heard_by, stages
from jblast.progress_line import (
    Progress,
    ProgressLine,
    reported,
)


class Stream(io.StringIO):
    """A file that may be a terminal."""

    def __init__(self, terminal: bool = False):
        super().__init__()
        self.terminal = terminal

    def isatty(self) -> bool:
        return self.terminal


class Clock:
    """Stands still until it is wound."""

    def __init__(self):
        self.now = 100.0

    def __call__(self) -> float:
        return self.now


@pytest.fixture
def clock() -> Clock:
    return Clock()


def line_on(stream: Stream, clock: Clock) -> ProgressLine:
    return ProgressLine("fit", stream, clock)


def test_nothing_is_said_in_the_first_second(clock):
    stream = Stream()
    with heard_by(line_on(stream, clock)):
        begin = stages({"reading": 1.0, "fitting": 1.0})
        begin("reading")
        clock.now += 0.99
        begin("fitting")
    assert stream.getvalue() == ""


def test_after_a_second_the_stage_is_told_and_of_how_many(clock):
    stream = Stream()
    line = line_on(stream, clock)
    with heard_by(line):
        begin = stages({"reading": 1.0, "fitting": 1.0})
        begin("reading")
        clock.now += 1.0
        line.show()  # what the ticking thread does
    assert stream.getvalue() == "jblast fit: reading (1 of 2), 1 s so far\n"


def test_there_is_no_time_left_until_one_unit_of_its_kind_is_done(clock):
    line = line_on(Stream(), clock)
    with heard_by(line):
        begin = stages({"reading": 1.0, "fitting": 3.0})
        begin("reading")
        clock.now += 2.0
        begin("fitting")
        # reading has another pace than fitting
        assert line.seconds_left() is None
        through = counted(3, "logs")
        clock.now += 4.0
        assert line.seconds_left() is None
        through(1)
        assert line.seconds_left() == pytest.approx(8.0)
        clock.now += 3.0
        assert line.seconds_left() == pytest.approx(5.0)
        clock.now += 6.0  # longer than expected: no estimate
        assert line.seconds_left() is None


def test_a_task_within_a_task_moves_the_whole(clock):
    line = line_on(Stream(), clock)
    with heard_by(line):
        begin = stages({"reading": 1.0, "fitting": 3.0})
        begin("fitting")
        through = counted(4, "logs")
        through(2)
        assert line.words() == "fitting (2 of 2): 2 of 4 logs"
        assert line.share() == pytest.approx(0.25 + 0.75 * 0.5)
        begin("reading")
        assert line.words() == "reading (1 of 2)"


def test_into_a_pipe_goes_a_line_a_stage_and_seldom_one_between(clock):
    stream = Stream()
    line = line_on(stream, clock)
    with heard_by(line):
        begin = stages({"reading": 1.0, "flying": 9.0})
        begin("reading")
        clock.now += 3.0
        begin("flying")
        through = counted(3000, "vehicles")
        for vehicle in range(3000):
            through(vehicle)
            clock.now += 0.1
    lines = stream.getvalue().splitlines()
    assert all(text.startswith("jblast fit: ") for text in lines)
    assert "flying (2 of 2)" in lines[0]
    # 300 s: every 10 s for the first 50 s, then each a fifth later than the last
    assert 10 <= len(lines) <= 20
    assert "\r" not in stream.getvalue()
    assert lines[-1].endswith("left")


def test_on_a_terminal_one_line_is_written_over_and_cleared(clock):
    stream = Stream(terminal=True)
    line = line_on(stream, clock)
    with heard_by(line):
        for _ in each(range(20), "frames"):
            clock.now += 0.5
        line.clear()
    assert "\n" not in stream.getvalue()
    shown = stream.getvalue().split("\r")
    assert shown[1].startswith("jblast fit: 2 of 20 frames, 1 s so far, about ")
    assert max(map(len, shown)) < 80
    assert shown[-2].strip() == shown[-1] == ""


@reported("work")
def work(*, progress: Progress = False) -> str:
    begin = stages({"reading": 1.0, "fitting": 3.0})
    begin("reading")
    begin("fitting")
    return "done"


def test_a_function_reports_to_the_function_that_the_caller_gives():
    heard = []
    assert work(progress=lambda words, share: heard.append((words, share))) == "done"
    assert heard == [("reading (1 of 2)", 0.0), ("fitting (2 of 2)", 0.25)]


def test_a_function_prints_its_progress_on_stderr(capsys, monkeypatch):
    monkeypatch.setattr(progress_line, "QUIET_S", 0.0)
    assert work(progress=True) == "done"
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith("jblast work: reading (1 of 2), 0 s so far")
    assert work() == "done"
    assert capsys.readouterr() == ("", "")


def test_another_progress_is_refused():
    with pytest.raises(InputError, match="progress: expected True, False, or a func"):
        work(progress=cast(Any, "yes"))


SLOW = """
import sys
from jblast import progress_line
from jblast.cli import main
from jblast.cli.verbs import calc
from jblast.progress import stages

def run(asked):
    begin = stages({"one": 1.0, "two": 1.0})
    begin("one")
    print("{}")
    return 0

progress_line.QUIET_S = 0.0
calc.run = run
sys.exit(main.main(["calc", "--mass", "1", "--range", "10"]))
"""


def test_a_pipe_gets_progress_on_stderr_and_stdout_stays_as_it_is():
    done = subprocess.run(
        [sys.executable, "-c", SLOW], check=True, capture_output=True, text=True
    )
    assert done.stdout == "{}\n"
    assert done.stderr.splitlines()[0].startswith("jblast calc: one (1 of 2), 0 s")


@pytest.mark.parametrize("terminal", [True, False])
@pytest.mark.parametrize("fault", [BrokenPipeError, OSError(28, "full"), ValueError])
def test_where_nothing_can_be_said_the_command_goes_on(
    clock, terminal, fault, monkeypatch
):
    stream = Stream(terminal)

    def refuse(_):
        raise fault

    monkeypatch.setattr(stream, "write", refuse)
    line = line_on(stream, clock)
    with heard_by(line):
        stages({"reading": 1.0})("reading")
        clock.now += 5.0
        line.show()
        line.clear()
