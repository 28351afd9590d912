import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from facegen.errors import InputError
from facegen.facs.yamlfile import parse_yaml
from facegen.facs.yamltext import yaml_text

PRINTABLE = st.text(st.characters(exclude_categories=["C"], exclude_characters="\u2028\u2029\ufeff"))
VALUES = st.recursive(
    st.one_of(st.booleans(), st.integers(-10**12, 10**12), st.floats(allow_nan=False, allow_infinity=False), PRINTABLE),
    lambda inner: st.one_of(st.lists(inner, max_size=4), st.dictionaries(PRINTABLE, inner, max_size=4)), max_leaves=12)


@settings(deadline=None)
@given(st.dictionaries(PRINTABLE, VALUES, min_size=1, max_size=5))
def test_what_is_written_is_read_back_by_us_and_by_other_readers(data):
    text = yaml_text(data)
    assert parse_yaml(text, "text") == data
    assert list(parse_yaml(text, "text")) == list(data)


@settings(deadline=None)
@given(st.dictionaries(PRINTABLE, st.one_of(PRINTABLE, st.floats(-1e3, 1e3).map(lambda x: round(x, 4))), min_size=1))
def test_other_readers_of_yaml_agree(data):
    assert yaml.safe_load(yaml_text(data)) == data


def test_it_is_to_be_read_by_people():
    points = {f"point_{k}": [0.1, 0.2, 0.3] for k in range(5)}
    data = {"about": "x", "units": {"12": {"points": points}, "4": {"scale": 2}}}
    assert yaml_text(data) == """about: "x"
units:
  "12":
    points:
      point_0: [0.1, 0.2, 0.3]
      point_1: [0.1, 0.2, 0.3]
      point_2: [0.1, 0.2, 0.3]
      point_3: [0.1, 0.2, 0.3]
      point_4: [0.1, 0.2, 0.3]
  "4": {scale: 2}
"""


@pytest.mark.parametrize("value", ["\x7f", "\ud800", float("nan"), object()])
def test_what_no_file_can_hold_is_refused(value):
    with pytest.raises(InputError, match="data:"):
        yaml_text({"a": value})
