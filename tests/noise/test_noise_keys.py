"""Every draw belongs to (seed, purpose, camera, frame): order, length, workers and other effects change nothing."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from noise import GammaField, Sensor, add_noise
from noise.streams import CLIP, Stream, camera_key, rng_for

SHAPE = (96, 160)
NOISY = Sensor(dark_e_s=500.0, hot_pixel_share=1e-3, row_noise_e=20.0, column_noise_e=20.0, duplicate_share=0.3)
EFFECTS = {
    "shot": {"shot_noise": True},
    "read": {"read_noise_e": 3.0},
    "dark": {"dark_e_s": 500.0},
    "hot": {"hot_pixel_share": 1e-2},
    "row": {"row_noise_e": 20.0},
    "column": {"column_noise_e": 20.0},
}


def scene(n_frames, shape=SHAPE):
    rng = np.random.default_rng(0)
    return np.broadcast_to((33 * 60 * rng.random(shape)).astype(np.float32), (n_frames, *shape))


def clip(n_frames, sensor=NOISY, **changed):
    arguments = {"exposure_s": 1 / 12, "seed": 5, "camera": "left"} | changed
    return add_noise(scene(n_frames), GammaField(20.0), sensor, **arguments)


def same_hits(one, other):
    return all(np.array_equal(getattr(one, name), getattr(other, name)) for name in vars(one))


def test_a_frame_is_the_same_in_a_short_and_a_long_clip():
    short, long = clip(4), clip(9)
    assert np.array_equal(short.frames, long.frames[:4])
    assert same_hits(short.hits.in_frame(3), long.hits.in_frame(3))


@pytest.mark.parametrize("workers", [1, 2, 5])
def test_the_number_of_workers_changes_no_byte(workers):
    one, other = clip(6), clip(6, workers=workers)
    assert one.frames.tobytes() == other.frames.tobytes()
    assert same_hits(one.hits, other.hits)
    assert same_hits(one.border_hits, other.border_hits)


def test_names_and_numbers_of_cameras_are_the_same_keys():
    assert np.array_equal(clip(2, camera="left").frames, clip(2, camera=0).frames)
    assert np.array_equal(clip(2, camera="right").frames, clip(2, camera=1).frames)
    assert not np.array_equal(clip(2, camera="left").frames, clip(2, camera="right").frames)


def test_another_seed_is_another_clip():
    assert not np.array_equal(clip(2, seed=5).frames, clip(2, seed=6).frames)


@given(st.integers(0, 2**63), st.sampled_from(list(Stream)), st.integers(0, 3), st.integers(CLIP, 10**6))
def test_a_key_has_one_stream_and_another_key_another(seed, stream, camera, frame):
    drawn = rng_for(seed, stream, camera, frame).random(4)
    assert np.array_equal(drawn, rng_for(seed, stream, camera, frame).random(4))
    for other in (
        (seed + 1, stream, camera, frame),
        (seed, stream, camera + 1, frame),
        (seed, stream, camera, frame + 1),
    ):
        assert not np.array_equal(drawn, rng_for(*other).random(4))


def test_purposes_have_streams_of_their_own():
    first = {rng_for(1, stream, 0, 0).random() for stream in Stream}
    assert len(first) == len(Stream)


def test_bad_keys_are_refused():
    with pytest.raises(ValueError, match="seed must be >= 0"):
        rng_for(-1, Stream.SHOT)
    for camera in ("middle", -1, 0.5):
        with pytest.raises(ValueError, match="camera"):
            camera_key(camera)


# --- effects are independent ----------------------------------------------------------------------------------------


def electrons(gamma, *effects):
    """A clip in electrons (16 bits, 4 000 of them a level at most) with some effects on."""
    changed = {key: value for effect in effects for key, value in EFFECTS[effect].items()}
    off = {"shot_noise": False, "read_noise_e": 0.0}
    sensor = Sensor(bits=16, electrons_per_grey=100.0, **(off | changed))
    noisy = add_noise(
        np.full((2, 40, 60), 4000.0, np.float32), GammaField(gamma), sensor, exposure_s=1 / 12, seed=3, camera=1
    )
    return noisy.frames * sensor.electrons_per_level


@pytest.mark.parametrize("effect", EFFECTS)
def test_switching_one_effect_changes_no_draw_of_another(effect):
    others = [name for name in EFFECTS if name != effect]
    alone = electrons(20.0, effect) - electrons(20.0)
    among = electrons(20.0, *others, effect) - electrons(20.0, *others)
    # Two clips are rounded each; nothing saturates: the sensor holds 25 500 electrons, hits above are left out.
    unsaturated = (electrons(20.0, *EFFECTS) < 25_400) & (electrons(20.0) < 25_000)
    assert unsaturated.mean() > 0.99
    assert np.abs(alone - among)[unsaturated].max() < 2 * 0.4
    assert np.abs(alone).max() > 5


def test_switching_the_gamma_field_off_changes_no_draw_of_the_sensor():
    with_hits, without = electrons(5.0, *EFFECTS), electrons(0.0, *EFFECTS)
    assert np.mean(np.abs(with_hits - without) < 0.8) > 0.7  # most pixels have no hit at all
    assert (with_hits - without).min() > -0.8


# --- frames and cameras are independent -----------------------------------------------------------------------------


def assert_independent(one, other):
    """Correlation of the noise of two big frames is below 0.01 (5 standard errors of 500 000 pixels: 0.007)."""
    assert abs(np.corrcoef(one.ravel().astype(float), other.ravel().astype(float))[0, 1]) < 0.01


@pytest.fixture(scope="module")
def big():
    frames = np.full((2, 540, 960), 33 * 50.0, np.float32)
    return [
        add_noise(frames, GammaField(20.0), Sensor(), exposure_s=1 / 12, seed=8, camera=camera).frames
        for camera in (0, 1)
    ]


@pytest.fixture(scope="module")
def big_without_hits():
    frames = np.full((2, 540, 960), 33 * 50.0, np.float32)
    return [
        add_noise(frames, GammaField(0.0), Sensor(), exposure_s=1 / 12, seed=8, camera=camera).frames
        for camera in (0, 1)
    ]


@pytest.mark.parametrize("pair", [((0, 0), (0, 1)), ((0, 0), (1, 0)), ((0, 1), (1, 0)), ((1, 0), (1, 1))])
def test_frames_and_cameras_are_independent(big, big_without_hits, pair):
    (camera, frame), (other_camera, other_frame) = pair
    for clips in (big, big_without_hits):
        assert_independent(clips[camera][frame], clips[other_camera][other_frame])


def test_independence_catches_the_same_noise_in_both_cameras(big, monkeypatch):
    monkeypatch.setattr("noise.clip.camera_key", lambda _: 0)
    frames = np.full((1, 540, 960), 33 * 50.0, np.float32)
    right = add_noise(frames, GammaField(20.0), Sensor(), exposure_s=1 / 12, seed=8, camera=1).frames
    with pytest.raises(AssertionError):
        assert_independent(big[0][0], right[0])
