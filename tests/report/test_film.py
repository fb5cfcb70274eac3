"""The answers on a film and on its events: by key, and as text."""

from dataclasses import replace

import pytest
from jsonschema import Draft202012Validator

from docs.generate import documents
from jblast.report.film import (
    EventsAnswer,
    FilmAnswer,
    events_view,
    film_lines,
    film_view,
)
from jblast.report.view import terminal
from jblast.sensors.camera.files.event_files import Written
from jblast.sensors.camera.film_writer import FilmEvents, FilmFiles

SIZE = (5, 64, 48, 100.0)
FOUND = FilmEvents((0.2, 0.2), "off", Written(3000, 2000, 1000), "interpolated", 1e-6)
FILES = FilmFiles("out/frames", "out/events.h5", None, "out/contact_sheet.png")
BOTH = FilmAnswer("a.toml", "both", *SIZE, None, 0.0, 0.04, 0, FOUND, None, FILES)
FRAMES = replace(BOTH, mode="rgb", found=None, files=replace(FILES, events=None))
DARK = (8, 0.5 / 255, 0.0, ())
EVENTS = EventsAnswer(
    *(*SIZE, 0.04, (0.2, 0.3), False, "on", 0, Written(3, 2, 1), *DARK), "events.h5"
)


def test_the_schema_takes_a_film_with_and_without_events():
    schema = documents.schema("render")
    Draft202012Validator.check_schema(schema)
    for film in (BOTH, FRAMES):
        Draft202012Validator(schema).validate(film.to_dict())
    assert set(BOTH.to_dict()) - set(FRAMES.to_dict()) == {
        *("threshold", "noise", "events", "brighter", "darker"),
        *("stamps", "stamp_error_s"),
    }
    assert set(FRAMES.to_dict()["files"]) == {"frames", "contact_sheet"}


def test_the_schema_takes_events_with_and_without_noise():
    schema = documents.schema("events")
    Draft202012Validator.check_schema(schema)
    for events in (EVENTS, replace(EVENTS, noise="off", seed=None)):
        Draft202012Validator(schema).validate(events.to_dict())


@pytest.mark.parametrize(
    ("video_fps", "pace"),
    [
        (100.0, "in real time"),
        (25.0, "4 times slower than real time"),
        (200.0, "2 times faster than real time"),
    ],
)
def test_the_text_has_size_accuracy_and_files(video_fps, pace):
    files = replace(FILES, video="a.mp4")
    text = terminal(film_view(replace(BOTH, video_fps=video_fps, files=files)))
    assert text.startswith("5 frames of 64 x 48 pixels at 100 Hz from 0 s\n")
    assert "3,000 events, 2,000 brighter and 1,000 darker" in text
    assert "interpolated, error below 1 us for 99 % of them\n" in text
    lines = film_lines(replace(BOTH, video_fps=video_fps, files=files))
    assert lines[0] == "Written: out/frames"
    assert lines[-1] == f"Written: a.mp4 ({video_fps:g} Hz, {pace})"
    assert "Warnings" not in text
    lifted = terminal(film_view(replace(BOTH, lifted_m=12.0)))
    assert "drawn at a height of 12 m" in " ".join(lifted.split())


def test_warnings_of_events_are_in_text_and_document():
    dark = replace(EVENTS, warnings=("it is dark",))
    assert "it is dark" in terminal(events_view(dark))
    assert dark.to_dict()["warnings"] == ["it is dark"]
