"""What is told of a film and of its events: by key, and in words."""

from dataclasses import replace

from jsonschema import Draft202012Validator

from docs.generate import documents
from jblast.report.film import (
    EventsAnswer,
    FilmAnswer,
    FilmEvents,
    FilmFiles,
)
from jblast.sensors.camera.files.event_files import Written

SIZE = (5, 64, 48, 100.0)
FOUND = FilmEvents((0.2, 0.2), "off", Written(3000, 2000, 1000), "solved for", 1e-6)
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
