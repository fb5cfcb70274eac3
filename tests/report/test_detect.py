"""The answer on flashes: document and text."""

import json

import numpy as np
from jsonschema import Draft202012Validator

from docs.generate import documents
from jblast.report.detect import detect_answer
from jblast.report.view import Picture, terminal
from jblast.signals.detect_files import ClipDetections, Film, FilmDetections
from jblast.signals.flash.fireball import Direction, Growth, Silhouette
from jblast.signals.flash.search import Flash, FlashDetections

GROWN = Growth(0.0304, 1e-4, 41.0, 0.3, 33.0, 0.4, *(15.0, 0.1, 3e-3, 1e-4, 0.2))
SPOTS = tuple(
    Silhouette(0.001 * k, 2.0 * (k - 30), 41.0, 30.0, 9.0, k > 36)
    for k in range(31, 40)
)
FLASH = Flash(6.0, 0.0370, 31, GROWN, SPOTS, np.full((60, 80), 0.2))
TIMES = np.arange(80) / 1000
SEEN = FlashDetections((FLASH,), TIMES, np.zeros(80), 4.0, 0.005, 1)
NOTHING = SEEN._replace(flashes=())
FILM = Film("film", "frames", 80, 60, 80, 1000.0, 0.079)
WHERE = [Direction(0.5, 0.01, -0.1, 0.02)]


def test_the_schema_takes_a_flash_with_and_without_a_scene_and_none():
    schema = documents.schema("detect_film")
    Draft202012Validator.check_schema(schema)
    bare = SEEN._replace(
        flashes=(FLASH._replace(growth=GROWN._replace(radius_px=None, growth_s=None)),)
    )
    for seen, where in ((SEEN, WHERE), (SEEN, []), (bare, []), (NOTHING, [])):
        answer = detect_answer(FilmDetections(seen, FILM, 1.0, where))
        found = json.loads(answer.document.to_json())
        Draft202012Validator(schema).validate(found)
        assert found["detected"] == bool(seen.flashes)
        assert answer.exit_code == (0 if seen.flashes else 3)


def test_keys_that_sound_and_film_share_mean_the_same():
    answer = detect_answer(FilmDetections(SEEN, FILM, 1.0)).document.to_dict()
    (arrival,) = answer["arrivals"]
    assert arrival["time_s"] == 0.0304
    assert arrival["snr_db"] == 20 * np.log10(6.0)
    assert (arrival["pixel"], arrival["frame"]) == ([41.0, 33.0], 31)
    assert answer["threshold_snr_db"] == 20 * np.log10(4.0)
    assert answer["latency_s"] == np.subtract(0.0370, 0.0304)


def test_several_flashes_of_a_slow_film_are_numbered_with_a_warning():
    two = SEEN._replace(flashes=(FLASH, FLASH))
    slow = FILM._replace(frames_hz=30.0)
    text = terminal(detect_answer(FilmDetections(two, slow, 1.0, WHERE)).view)
    assert text.startswith("2 blasts detected in 0.079 s of frames, 80 x 60 pixels")
    assert "Blast 1\n  first light  0.03040 ± 0.0001 s, frame 31" in text
    assert "bearing 28.65 ± 0.57, elevation -5.7 ± 1.1 degrees" in text
    assert "Warning: 30 frames/s" in text


def test_clips_are_named_and_have_a_figure_each():
    clips = [
        FilmDetections(s, FILM._replace(path=p), 1.0)
        for s, p in ((SEEN, "a/one.mp4"), (NOTHING, "two.mp4"))
    ]
    answer = detect_answer(ClipDetections(tuple(clips), None))
    text = terminal(answer.view)
    assert "one.mp4: 1 blast detected in" in text
    assert "two.mp4: 0 blasts detected in" in text
    names = [b.name for b in answer.view.blocks if isinstance(b, Picture)]
    assert names == ["one.detection.png", "two.detection.png"]
    schema = Draft202012Validator(documents.schema("detect_clips"))
    schema.validate(json.loads(answer.document.to_json()))
