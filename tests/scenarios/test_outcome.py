"""Outcome codes: why a place is wrong, from the truth and the believed rig alone."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from leakloc import Estimate, LeakEstimate
from scenarios.build import believed_rig
from scenarios.outcome import TILT_DEG, outcomes, tilt_deg
from scenarios.scenario_file import read_scenario
from scenarios.scene_work import Assigned, _leak_outcome
from scenarios.score import score
from scenarios.simulate import simulate

TINY = ("rig.width_px=96", "rig.height_px=54", "recording.n_frames=4", "pedestal.texture=uniform")
ANGLES = st.floats(-3.0, 3.0)


def clip_of(*overrides):
    return simulate(read_scenario("plain", [*TINY, *overrides]))


@pytest.fixture(scope="module")
def level():
    """Truth of a rig that stands level."""
    return clip_of().truth


def codes(clip, x_m, y_m, columns_px):
    """Codes of an estimate that says a place and columns, whatever they have to do with each other."""
    said = Estimate("m", "world", (LeakEstimate(x_m, y_m, np.full((2, 2), np.nan), 1.0, *columns_px, np.nan),))
    scored = score([(x_m, y_m)], clip.truth)
    return outcomes(said, clip.truth, clip.believed_rig, scored)


def seen(clip):
    """The clip with its leak observable, which it is not in so small pictures."""
    (leak,) = clip.truth.leaks
    told = leak.model_copy(update={"observable": True, "reason": None})
    return replace(clip, truth=clip.truth.model_copy(update={"leaks": (told,)}))


def true_columns(clip):
    (leak,) = clip.truth.leaks
    return leak.left_column_px, leak.right_column_px


@pytest.mark.parametrize(
    ("overrides", "both", "one"),
    [
        ((), "bad.depth", "bad.wrong_match"),
        (("rig.pitch_deg=2", "believed_rig.pitch_deg=2"), "bad.depth", "bad.wrong_match"),  # known, so undone
        (("rig.pitch_deg=2",), "bad.tilt", "bad.tilt"),
        (("rig.right_roll_deg=2",), "bad.tilt", "bad.tilt"),
        (("rig.yaw_deg=2",), "bad.depth", "bad.wrong_match"),  # turns every place, and leaves the columns plumb
    ],
)
def test_a_wrong_place_at_the_right_columns_is_blamed_on_the_tilt_that_is_not_known(overrides, both, one):
    clip = seen(clip_of(*overrides))
    left_px, right_px = true_columns(clip)
    assert codes(clip, -1.5, 1.5, (left_px, right_px)).leaks == {0: both}
    assert codes(clip, -1.5, 1.5, (left_px, right_px - 20)).leaks == {0: one}
    assert codes(clip, -1.5, 1.5, (left_px - 20, right_px - 20)).leaks == {0: "missed.unexplained"}


@given(roll=ANGLES, pitch=ANGLES, yaw=st.floats(-60.0, 60.0))
def test_the_tilt_is_the_angle_that_the_vertical_is_off_and_nothing_of_the_pan(level, roll, pitch, yaw):
    words = {"roll_deg": roll, "pitch_deg": pitch, "yaw_deg": yaw}
    believed = believed_rig(read_scenario("plain", [f"believed_rig.{name}={angle}" for name, angle in words.items()]))
    # R = Rz(yaw) Ry(pitch) Rx(roll): the vertical is off by acos(cos pitch cos roll)
    expected = np.degrees(np.arccos(np.clip(np.cos(np.radians(pitch)) * np.cos(np.radians(roll)), -1.0, 1.0)))
    assert tilt_deg(level, believed) == pytest.approx(expected, abs=1e-5)


def test_a_pixel_over_half_the_papers_image_is_less_than_the_tilt_that_counts():
    assert np.degrees(np.arctan(1 / 270)) < TILT_DEG < 2 * np.degrees(np.arctan(1 / 270))


def test_a_leak_in_the_cameras_own_plane_has_no_error_in_pixels(level):
    leak = level.leaks[0].model_copy(update={"x_m": -2.4, "y_m": 0.5})
    outcome = _leak_outcome(leak, level, "found", Assigned(error_m=0.1))
    assert (outcome.error_m, outcome.error_px) == (0.1, None)
