import pickle

import numpy as np
import pytest

from facegen.animation.performance import Performance
from facegen.errors import InputError


def made(**change):
    return Performance(**{"times": [0.0, 0.04, 0.08], "names": ("jawOpen", "mouthClose"),
                          "weights": [[0.1, 0.0], [np.nan, np.nan], [0.3, np.nan]], "vocabulary": "arkit"} | change)


def test_what_was_recorded_is_found_again():
    one = made(head=np.zeros((3, 3)), extra={"Timecode": ["a", "b", "c"]}, about={"format": "live-link"})
    assert (len(one), one.duration, one.rate) == (3, 0.08, pytest.approx(25.0))
    assert one.found.tolist() == [True, False, True]
    assert one.frame(2) == {"jawOpen": 0.3}
    assert one.column("jawOpen")[0] == 0.1
    again = pickle.loads(pickle.dumps(one))
    np.testing.assert_array_equal(again.weights, one.weights)
    assert list(again.extra["Timecode"]) == ["a", "b", "c"]
    with pytest.raises(ValueError, match="read-only"):
        one.weights[0, 0] = 1.0


@pytest.mark.parametrize(("change", "message"), [
    ({"vocabulary": "arkitt"}, "did you mean 'arkit'"),
    ({"names": ("jawOpen", "jawOpen")}, "jawOpen more often"),
    ({"times": [], "weights": np.zeros((0, 2))}, "one frame or more"),
    ({"times": [0.0, 0.2, 0.1]}, r"0\.1 at frame 2"),
    ({"times": [0.0, np.nan, 0.1]}, "nan at frame 1"),
    ({"weights": np.zeros((3, 3))}, r"expected shape \(3, 2\)"),
    ({"weights": [["a", "b"]] * 3}, "expected numbers"),
    ({"weights": np.full((3, 2), np.inf)}, "6 infinite"),
    ({"gaze": np.zeros((3, 2))}, r"gaze: expected shape \(3, 4\)"),
    ({"extra": {"Timecode": ["a"]}}, "Timecode: expected shape"),
])
def test_what_is_no_recording_is_refused_in_words(change, message):
    with pytest.raises(InputError, match=message):
        made(**change)


def test_an_unknown_column_names_the_nearest():
    with pytest.raises(InputError, match="did you mean 'jawOpen'"):
        made().column("jawopen")
