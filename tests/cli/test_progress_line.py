"""What a command says while it works, by a clock that the test winds."""

import inspect
import io
import subprocess
import sys
import threading
from typing import Any, cast

import jax
import jax.numpy as jnp
import pytest

import jblast
import jblast.study
from jblast import progress_line
from jblast.errors import InputError
from jblast.progress import Listener, counted, each, heard_by, in_words, stages
from jblast.progress_line import (
    COMPILATION,
    Progress,
    ProgressLine,
    note_compilation,
    printed_progress,
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


def test_words_within_a_stage_stand_behind_it_until_the_next(clock):
    line = line_on(Stream(), clock)
    with heard_by(line):
        begin = stages({"sampler": 1.0, "vehicle": 1.0})
        begin("sampler")
        tell = in_words()
        tell("the optimum")
        tell("the reference")
        assert line.words() == "sampler (1 of 2): the reference"
        begin("vehicle")
        assert line.words() == "vehicle (2 of 2)"


def test_a_task_that_is_over_leaves_its_place_to_the_next(clock):
    def fit():
        begin = stages({"reading": 1.0, "fitting": 1.0})
        for name in ("reading", "fitting"):
            begin(name)
            for _ in each(range(2), "logs"):
                said.append(line.words())

    line, said = line_on(Stream(), clock), []
    with heard_by(line):
        begin = stages({"bands": 1.0, "fits": 1.0})
        begin("fits")
        fit()
        first, said = said, []
        assert line.words() == "fits (2 of 2)"
        fit()
    assert said == first
    assert said[-1] == "fits (2 of 2): fitting (2 of 2): 1 of 2 logs"


def test_a_task_that_is_let_go_late_takes_nothing_from_the_next(clock):
    line = line_on(Stream(), clock)
    with heard_by(line):
        begin = stages({"bands": 1.0, "fits": 1.0})
        begin("bands")
        held = in_words()
        held("a band")
        begin("fits")
        tell = in_words()
        tell("a fit")
        del held
    assert line.words() == "fits (2 of 2): a fit"


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


def test_each_counted_stage_has_its_own_pace(clock):
    line = line_on(Stream(), clock)
    with heard_by(line):
        begin = stages({"drawing": 1.0, "flying": 1.0})
        for stage, pace in (("drawing", 0.1), ("flying", 5.0)):
            begin(stage)
            through = counted(10, "vehicles")
            assert line.seconds_left() is None
            clock.now += pace
            through(1)
            if stage == "drawing":
                for done in range(2, 11):
                    clock.now += pace
                    through(done)
        assert line.seconds_left() == pytest.approx(45.0)


def test_a_compilation_is_reported_while_it_runs(clock):
    stream = Stream()
    line = line_on(stream, clock)
    lowered, compiled = COMPILATION
    with heard_by(line):
        begin = stages({"reading": 1.0, "fitting": 1.0})
        begin("fitting")
        note_compilation(lowered, 0.1, fun_name="f")
        clock.now += 1.0
        line.show()
        note_compilation(compiled, 1.0, fun_name="f")
        clock.now += 20.0
        line.show()
    assert stream.getvalue().splitlines() == [
        "jblast fit: fitting (2 of 2): compiling, 1 s so far",
        "jblast fit: fitting (2 of 2), 21 s so far",
    ]


def test_jax_reports_both_events_of_a_compilation():
    heard = []

    def listen(event: str, duration_secs: float, **kwargs: str | int) -> None:
        heard.append((event, kwargs.get("fun_name")))

    jax.monitoring.register_event_duration_secs_listener(listen)
    jax.jit(lambda x: jnp.sin(x) + 17.0)(jnp.ones(3))
    events = [event for event, name in heard if "lambda" in str(name)]
    assert [event for event in events if event in COMPILATION] == list(COMPILATION)


def test_a_first_item_that_compiles_does_not_count_for_the_rest(clock):
    line = line_on(Stream(), clock)
    with heard_by(line):
        for log in each(range(10), "logs"):
            clock.now += 30.0 if log == 0 else 1.0
            if log == 3:
                # three through after 32 s, the last two of them in a second each
                assert line.words() == "3 of 10 logs"
                assert line.seconds_left() == pytest.approx(7.0 - 1.0)
                break


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


@pytest.mark.parametrize("terminal", [True, False])
def test_while_nothing_is_waited_for_nothing_is_said(clock, terminal):
    stream = Stream(terminal)
    line = line_on(stream, clock)
    with heard_by(line):
        begin = stages({"drawing": 1.0})
        clock.now += 2.0
        begin("drawing")
        assert "drawing" in stream.getvalue()
        del begin  # as before a window is opened
        clock.now += 20.0
        line.show()
        said = stream.getvalue()
        clock.now += 20.0
        line.show()
    assert "working" not in said
    assert stream.getvalue() == said
    assert not terminal or said.endswith(" \r")


def test_where_nobody_listens_telling_does_nothing():
    begin = stages({"reading": 1.0})
    begin("reading")
    assert list(each(range(3), "logs")) == [0, 1, 2]


class Recorder(Listener):
    """Listener that stores the words of each report."""

    def __init__(self):
        super().__init__()
        self.reports = []

    def heard(self):
        self.reports.append(self.words())


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


def test_without_the_argument_reports_go_to_the_listener_around_the_call():
    outer = Recorder()
    with heard_by(outer):
        work()
        assert outer.reports == ["reading (1 of 2)", "fitting (2 of 2)"]
        work(progress=lambda words, share: None)
        assert len(outer.reports) == 2


def test_lines_in_two_threads_leave_the_streams_as_they_were(monkeypatch):
    terminal = Stream(terminal=True)
    monkeypatch.setattr(sys, "stderr", terminal)
    before = sys.stdout
    begun, may_end = threading.Event(), threading.Event()

    def other():
        with printed_progress("other"):
            begun.set()
            may_end.wait(60.0)

    thread = threading.Thread(target=other)
    with printed_progress("fit"):
        thread.start()
        assert begun.wait(60.0)
    may_end.set()
    thread.join()
    assert sys.stderr is terminal
    assert sys.stdout is before


def test_another_progress_is_refused():
    with pytest.raises(InputError, match="progress: expected True, False, or a func"):
        work(progress=cast(Any, "yes"))


LONG_CALLS = (
    *(jblast.fit, jblast.fit_each, jblast.fit_many, jblast.bound, jblast.choose),
    *(jblast.pick_files, jblast.detect, jblast.fly, jblast.fly_scene),
    *(jblast.study.run, jblast.study.run_into),
)


@pytest.mark.parametrize("call", LONG_CALLS, ids=lambda call: call.__name__)
def test_long_calls_have_the_argument(call):
    assert inspect.signature(call).parameters["progress"].default is False


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
