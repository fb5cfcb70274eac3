"""What is told of flashes: by key, in words, drawn."""

import json

import numpy as np
from jsonschema import Draft202012Validator

from docs.generate import documents
from jblast.report.flash import flash_answer
from jblast.signals.detect_files import Film, FilmDetections
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
        told = flash_answer(FilmDetections(seen, FILM, 1.0, where)).to_dict()
        Draft202012Validator(schema).validate(json.loads(json.dumps(told)))
        assert told["detected"] == bool(seen.flashes)


def test_keys_that_sound_and_film_share_mean_the_same():
    told = flash_answer(FilmDetections(SEEN, FILM, 1.0)).to_dict()
    (arrival,) = told["arrivals"]
    assert arrival["time_s"] == 0.0304
    assert arrival["snr_db"] == 20 * np.log10(6.0)
    assert (arrival["pixel"], arrival["frame"]) == ([41.0, 33.0], 31)
    assert told["threshold_snr_db"] == 20 * np.log10(4.0)
    assert told["latency_s"] == np.subtract(0.0370, 0.0304)
