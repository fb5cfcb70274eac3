"""Progress of a command and of a function, by a clock that the test winds."""

import io
from typing import Any, cast

import pytest

from jblast.errors import InputError
from jblast.progress import (
    Progress,
    ProgressLine,
    counted,
    each,
    heard_by,
    reported,
    stages,
)


class Stream(io.StringIO):
    """A file that may be a terminal."""

    def __init__(self, terminal: bool = False):
        super().__init__()
        self.terminal = terminal

    def isatty(self) -> bool:
        return self.terminal


class Clock:
    """A clock that stands until it is wound."""

    now = 100.0

    def __call__(self) -> float:
        return self.now


@pytest.fixture
def clock() -> Clock:
    return Clock()


def line_on(stream: Stream, clock: Clock) -> ProgressLine:
    return ProgressLine("fit", stream, clock)


@pytest.mark.parametrize(
    ("terminal", "quiet_s", "text"),
    [(True, 3.0, "\r{}"), (False, 10.0, "{}\n")],
)
def test_nothing_is_printed_before_a_terminal_or_a_pipe_needs_it(
    clock, terminal, quiet_s, text
):
    stream = Stream(terminal)
    line = line_on(stream, clock)
    with heard_by(line):
        begin = stages({"reading": 1.0, "fitting": 1.0})
        begin("reading")
        clock.now += quiet_s - 0.01
        line.show()
        assert stream.getvalue() == ""
        clock.now += 0.01
        line.show()  # by the ticking thread
    line = f"jblast fit: reading (1 of 2), {quiet_s:.0f} s so far"
    assert stream.getvalue() == text.format(line)


def test_the_time_left_is_that_of_the_mean_pace(clock):
    line = line_on(Stream(), clock)
    with heard_by(line):
        begin = stages({"reading": 1.0, "fitting": 3.0})
        begin("reading")
        clock.now += 2.0
        assert line.seconds_left() is None
        begin("fitting")
        assert line.seconds_left() == pytest.approx(6.0)
        through = counted(3, "logs")
        clock.now += 4.0
        through(1)
        assert line.seconds_left() == pytest.approx(6.0)


def test_a_nested_task_advances_the_whole_and_ends_with_its_parent(clock):
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


def test_lines_in_a_pipe_become_rarer(clock):
    stream = Stream()
    with heard_by(line_on(stream, clock)):
        for _ in each(range(3000), "vehicles"):
            clock.now += 0.1
    lines = stream.getvalue().splitlines()
    # 300 s: every 10 s for the first 50 s, then each a fifth later than the last
    assert 10 <= len(lines) <= 20
    assert "\r" not in stream.getvalue()
    assert lines[0].endswith("vehicles, 10 s so far, about 5 min left")


@reported("work")
def work(*, progress: Progress = False) -> str:
    begin = stages({"reading": 1.0, "fitting": 3.0})
    begin("reading")
    begin("fitting")
    return "done"


def test_a_function_reports_to_the_function_of_its_caller():
    calls = []
    assert work(progress=lambda words, share: calls.append((words, share))) == "done"
    assert calls == [("reading (1 of 2)", 0.0), ("fitting (2 of 2)", 0.25)]
    with pytest.raises(InputError, match="progress: expected True, False, or a func"):
        work(progress=cast(Any, "yes"))


@pytest.mark.parametrize("terminal", [True, False])
@pytest.mark.parametrize("fault", [BrokenPipeError, OSError(28, "full"), ValueError])
def test_a_command_continues_where_progress_cannot_be_written(
    clock, terminal, fault, monkeypatch
):
    stream = Stream(terminal)

    def refuse(_):
        raise fault

    monkeypatch.setattr(stream, "write", refuse)
    line = line_on(stream, clock)
    with heard_by(line):
        stages({"reading": 1.0})("reading")
        clock.now += 15.0
        line.show()
        line.clear()
