"""Whatever stands in a scene file: a scene within its bounds, or an input error."""

from contextlib import suppress

from hypothesis import given, settings, strategies as st

from jblast.errors import InputError
from jblast.scene import UncertainScene, WorldSpec
from jblast.scene.keys import keys_of
from jblast.scene.reader import scene_from_document, world_from_document

NUMBER = st.one_of(
    st.floats(),
    st.integers(),
    st.just("free"),
    st.dictionaries(
        st.sampled_from(["normal", "lognormal", "uniform", "loguniform", "x"]),
        st.lists(st.floats(), max_size=3),
        max_size=2,
    ),
)
VALUE = st.recursive(
    st.one_of(st.none(), st.booleans(), NUMBER, st.text(max_size=8)),
    lambda inner: st.one_of(
        st.lists(inner, max_size=3),
        st.dictionaries(st.text(max_size=8), inner, max_size=2),
    ),
    max_leaves=6,
)


def tables(name):
    keys = st.sampled_from([*keys_of(name), "x"])
    some = st.one_of(NUMBER, st.lists(NUMBER, min_size=3, max_size=3), VALUE)
    return st.dictionaries(keys, some, max_size=4)


CAMERA = {
    "position_m": [0.0, -40.0, 2.0],
    "look_at_m": [0.0, 0.0, 2.0],
    "width": 32,
    "height": 24,
    "focal_px": 30.0,
}
VEHICLE = {"model": "iris", "position_m": [10.0, 0.0, 2.0]}
CONTROL = st.one_of(tables("control"), VALUE)
DOCUMENT = st.fixed_dictionaries(
    {},
    optional={
        "schema": st.one_of(st.just(1), VALUE),
        "charge": st.one_of(tables("charge"), VALUE),
        "air": st.one_of(tables("air"), VALUE),
        "ground": st.one_of(tables("ground"), VALUE),
        "law": st.one_of(tables("law"), VALUE),
        "sensor": st.one_of(st.lists(tables("sensor"), max_size=3), VALUE),
        "ambient": st.one_of(tables("ambient"), VALUE),
        "camera": st.one_of(tables("camera").map(lambda t: CAMERA | t), VALUE),
        "vehicle": st.one_of(
            tables("vehicle").map(lambda t: VEHICLE | t),
            CONTROL.map(lambda control: VEHICLE | {"control": control}),
            VALUE,
        ),
        "x": VALUE,
    },
)


@settings(deadline=None)
@given(DOCUMENT)
def test_random_documents_raise_nothing_but_input_errors(document):
    with suppress(InputError):
        assert type(scene_from_document(document, "scene.toml")) is UncertainScene


REGION = st.one_of(tables("region"), VALUE)


@settings(deadline=None)
@given(st.one_of(tables("world"), REGION.map(lambda one: {"region_m": one}), VALUE))
def test_random_worlds_raise_nothing_but_input_errors(world):
    document = {"world": world, "vehicle": VEHICLE}
    with suppress(InputError):
        assert type(world_from_document(document, "scene.toml")[1]) is WorldSpec
