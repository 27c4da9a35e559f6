import json
import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from leakloc import Estimate, LeakEstimate, ResultError, locate, read_result, result_schema, write_result

NUMBERS = ("x_m", "y_m", "score", "left_column_px", "right_column_px", "column_sigma_px")
LEAK = dict.fromkeys(NUMBERS, 1.5) | {"covariance_m2": [[1.0, 0.0], [0.0, 1.0]]}
RESULT = {"method": "paper", "frame": "world", "leaks": [LEAK], "diagnostics": {}}

finite = st.floats(allow_nan=False, allow_infinity=False)
undefined = st.one_of(finite, st.just(float("nan")))
leaks = st.builds(
    LeakEstimate,
    x_m=finite,
    y_m=finite,
    covariance_m2=st.lists(undefined, min_size=4, max_size=4).map(lambda four: np.array(four).reshape(2, 2)),
    score=undefined,
    left_column_px=undefined,
    right_column_px=undefined,
    column_sigma_px=undefined,
)
plain = st.recursive(
    st.one_of(undefined, st.integers(-(2**53), 2**53), st.text(), st.booleans()),
    lambda inner: st.one_of(st.lists(inner, max_size=3), st.dictionaries(st.text(), inner, max_size=3)),
    max_leaves=8,
)
estimates = st.builds(
    Estimate,
    method=st.text(),
    frame=st.sampled_from(["world", "left camera"]),
    leaks=st.lists(leaks, max_size=4).map(tuple),
    diagnostics=st.dictionaries(st.text(), plain, max_size=3),
)


def assert_same(one, other):
    assert (one.method, one.frame, len(one.leaks)) == (other.method, other.frame, len(other.leaks))
    np.testing.assert_equal(one.diagnostics, other.diagnostics)
    for a, b in zip(one.leaks, other.leaks, strict=True):
        np.testing.assert_array_equal(a.covariance_m2, b.covariance_m2)
        np.testing.assert_equal([getattr(a, key) for key in NUMBERS], [getattr(b, key) for key in NUMBERS])


@given(estimates)
def test_a_written_estimate_is_read_back_to_the_bit(tmp_path_factory, estimate):
    path = tmp_path_factory.getbasetemp() / "result.json"
    write_result(estimate, path)
    assert_same(read_result(path), estimate)


def test_the_papers_result_is_json_with_null_for_what_it_does_not_know(tmp_path, make_rig, make_dripping):
    estimate = locate(make_dripping([70, 40]), make_dripping([50, 10]), make_rig(120, 40), method="paper")
    write_result(estimate, tmp_path / "result.json")
    content = json.loads((tmp_path / "result.json").read_text())
    assert list(content) == ["method", "frame", "leaks", "diagnostics"]
    leak = content["leaks"][0]
    assert (leak["left_column_px"], leak["right_column_px"]) == (40, 10)
    assert leak["covariance_m2"] is leak["column_sigma_px"] is None
    assert len(content["diagnostics"]["left"]["profile_grey"]) == 120
    assert_same(read_result(tmp_path / "result.json"), estimate)


def test_arrays_in_diagnostics_become_lists_of_numbers(tmp_path):
    diagnostics = {"profile_grey": np.array([1.5, np.nan]), "columns_px": np.array([3]), "count": np.int64(2)}
    write_result(Estimate("robust", "world", (), diagnostics), tmp_path / "result.json")
    written = json.loads((tmp_path / "result.json").read_text())["diagnostics"]
    assert written == {"profile_grey": [1.5, None], "columns_px": [3], "count": 2}


def test_a_write_that_fails_leaves_the_old_result_and_nothing_else(tmp_path):
    path = tmp_path / "result.json"
    path.write_text("old")
    with pytest.raises(ValueError, match="not JSON compliant"):
        write_result(Estimate("paper", "world", (), {"a": float("inf")}), path)
    with pytest.raises(OSError, match="No such file"):
        write_result(Estimate("paper", "world", ()), tmp_path / "nowhere" / "result.json")
    (tmp_path / "folder").mkdir()
    with pytest.raises(IsADirectoryError):
        write_result(Estimate("paper", "world", ()), tmp_path / "folder")
    assert sorted(entry.name for entry in tmp_path.iterdir()) == ["folder", "result.json"]
    assert path.read_text() == "old"


def test_a_write_leaves_no_temporary_file(tmp_path):
    write_result(Estimate("paper", "world", ()), tmp_path / "result.json")
    assert [entry.name for entry in tmp_path.iterdir()] == ["result.json"]


def test_the_schema_asks_for_what_the_reader_asks_for(tmp_path):
    schema = result_schema()
    assert set(schema["required"]) == set(RESULT)
    assert set(schema["properties"]["leaks"]["items"]["required"]) == set(LEAK)
    path = tmp_path / "result.json"
    for key in schema["required"]:
        path.write_text(json.dumps({k: v for k, v in RESULT.items() if k != key}))
        with pytest.raises(ResultError, match=f"must have the keys {key}$"):
            read_result(path)
    for key in LEAK:
        path.write_text(json.dumps(RESULT | {"leaks": [LEAK, {k: v for k, v in LEAK.items() if k != key}]}))
        with pytest.raises(ResultError, match=rf"leaks\[1\] must have the keys {key}$"):
            read_result(path)


def test_keys_of_other_programs_are_left_out(tmp_path):
    (tmp_path / "result.json").write_text(json.dumps(RESULT | {"made_by": "x", "leaks": [LEAK | {"id": "a"}]}))
    assert read_result(tmp_path / "result.json").leaks[0].x_m == 1.5


def with_leak(**changes):
    return json.dumps(RESULT | {"leaks": [LEAK | changes]})


def nest(depth):
    return {"a": nest(depth - 1)} if depth else {}


BAD_RESULTS = {
    "empty": ("", "not JSON"),
    "cut short": (json.dumps(RESULT)[:-5], "not JSON"),
    "not utf-8": (b"\xff\xfe\xfa{", "not JSON"),
    "nested": ("[" * 500_000, "not JSON"),
    "nested within what Python bears": (json.dumps(RESULT | {"diagnostics": nest(400)}), "nested too deeply"),
    "a list": ("[]", "the file must be an object"),
    "too large": (" " * ((6 << 20) + 1), "at most 6291456 bytes"),
    "NaN": (with_leak(x_m=float("nan")), "finite or null, got NaN"),
    "Infinity": (with_leak(score=float("-inf")), "finite or null, got -Infinity"),
    "beyond floats": (with_leak().replace("1.5", "1e999", 1), "finite or null, got 1e999"),
    "integer beyond floats": (with_leak(x_m=10**400), r"leaks\[0\].x_m must be a finite number or null"),
    "x unknown": (with_leak(x_m=None), r"leaks\[0\].x_m must be a number, got null"),
    "x a text": (with_leak(x_m="1.0"), r"leaks\[0\].x_m must be a finite number or null, got '1.0'"),
    "score true": (with_leak(score=True), r"leaks\[0\].score must be .* got True"),
    "covariance of 3": (with_leak(covariance_m2=[1, 2, 3]), r"leaks\[0\].covariance_m2 must be 2 x 2"),
    "covariance a text": (with_leak(covariance_m2=[["a", 0], [0, 1]]), r"covariance_m2 must be a finite number"),
    "leak a number": (json.dumps(RESULT | {"leaks": [3]}), r"leaks\[0\] must be an object, got 3"),
    "leaks an object": (json.dumps(RESULT | {"leaks": {}}), "leaks must be a list of at most 10000"),
    "too many leaks": (json.dumps(RESULT | {"leaks": [0] * 10_001}), "leaks must be a list of at most 10000"),
    "unknown frame": (json.dumps(RESULT | {"frame": "moon"}), "frame must be one of world, left camera, got 'moon'"),
    "frame a list": (json.dumps(RESULT | {"frame": []}), "frame must be one of"),
    "method a number": (json.dumps(RESULT | {"method": 7}), "method must be a text, got 7"),
    "diagnostics a list": (json.dumps(RESULT | {"diagnostics": []}), "diagnostics must be an object"),
}


@pytest.mark.parametrize("kind", BAD_RESULTS)
def test_a_bad_result_gets_one_error_with_file_key_and_rule(tmp_path, kind):
    content, said = BAD_RESULTS[kind]
    path = tmp_path / "result.json"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(ResultError, match=said) as caught:
        read_result(path)
    assert re.match(re.escape(f"{path}: "), str(caught.value))
    assert len(str(caught.value)) < len(str(path)) + 300


def test_a_missing_result_is_named(tmp_path):
    for path, said in ((tmp_path / "none.json", "No such file"), (tmp_path, "regular file")):
        with pytest.raises(ResultError, match=said):
            read_result(path)
