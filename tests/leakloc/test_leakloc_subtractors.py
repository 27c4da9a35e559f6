import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from leakloc import PaperOptions, locate
from leakloc.background import column_vectors, temporal_median
from leakloc.columns import column_profile
from leakloc.subtractors import SUBTRACTORS, mean_foreground, median_foreground, mog2_foreground

N, H, W, LEAK_PX = 24, 200, 60, 30

clips = st.tuples(st.sampled_from([np.uint8, np.uint16]), st.integers(3, 12)).flatmap(
    lambda kind: hnp.arrays(kind[0], (kind[1], 4, 6), elements=st.integers(0, np.iinfo(kind[0]).max))
)


def streaks(contrast_grey, leak_px=LEAK_PX, width_px=W):
    """Read noise of 1 grey, and down one column streaks of 40 rows every 120 that fall 37 rows a frame."""
    rng = np.random.default_rng(5)
    frames = 30 + rng.normal(size=(N, H, width_px))
    for n in range(N):
        frames[n, (np.arange(H) - 37 * n) % 120 < 40, leak_px] += contrast_grey
    return np.clip(np.rint(frames), 0, 255).astype(np.uint8)


@given(clips)
def test_the_default_is_the_papers_median_to_the_bit(frames):
    median, columns = temporal_median(frames), np.array([4, 0])
    for foreground in (median_foreground(frames), SUBTRACTORS[PaperOptions().subtractor](frames)):
        assert np.array_equal(foreground.profile_grey, column_profile(frames, median))
        assert np.array_equal(foreground.vectors(columns), column_vectors(frames, median, columns))


@given(clips)
def test_the_mean_foreground_is_the_distance_from_the_mean(frames):
    plain = np.abs(frames - frames.mean(axis=0))
    foreground = mean_foreground(frames)
    np.testing.assert_allclose(foreground.profile_grey, plain.mean(axis=(0, 1)), rtol=1e-12)
    np.testing.assert_allclose(foreground.vectors(np.array([5, 1])), plain[:, :, [5, 1]].transpose(2, 0, 1))


def test_the_mean_of_four_frames_by_hand():
    # 10, 2, 1, 3 have the mean 4: distances 6, 2, 3, 1
    foreground = mean_foreground(np.array([10, 2, 1, 3], np.uint8).reshape(4, 1, 1))
    assert foreground.profile_grey.tolist() == [3.0]
    assert foreground.vectors(np.array([0])).tolist() == [[[6.0], [2.0], [3.0], [1.0]]]


@pytest.mark.parametrize("name", SUBTRACTORS)
@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_the_profile_is_the_mean_of_the_vectors_and_a_still_scene_has_none(name, dtype):
    frames = streaks(60).astype(dtype) * (257 if dtype == np.uint16 else 1)
    foreground = SUBTRACTORS[name](frames)
    columns = np.arange(W)
    np.testing.assert_allclose(foreground.profile_grey, foreground.vectors(columns).mean(axis=(1, 2)), rtol=1e-12)
    still = SUBTRACTORS[name](np.repeat(frames[:1], 6, axis=0))
    assert still.profile_grey.tolist() == [0.0] * W


def test_a_mixture_of_gaussians_learns_the_drops_away_and_the_median_does_not():
    """The paper's remark: the drops pass each pixel again and again, and from the second quarter on are background."""
    frames = streaks(60)
    quarters = [
        subtract(frames).vectors(np.array([LEAK_PX])).reshape(4, -1).mean(axis=1)
        for subtract in (median_foreground, mean_foreground, mog2_foreground)
    ]
    for kept in quarters[:2]:
        assert kept.min() > 0.9 * kept.max()
    learned = quarters[2]
    assert learned[0] > 10
    assert learned[1:].max() < 0.02 * learned[0]


def test_a_mixture_of_gaussians_never_sees_faint_drops_that_the_median_finds():
    """5 grey are below its threshold of four deviations of its initial 4 grey, and widen its variance from then on."""
    frames = streaks(5)
    assert mog2_foreground(frames).profile_grey[LEAK_PX] == 0
    profile = median_foreground(frames).profile_grey
    others = np.delete(profile, LEAK_PX)
    assert profile[LEAK_PX] > others.mean() + 20 * others.std()


def test_the_papers_method_finds_a_faint_leak_by_median_and_mean_and_loses_it_by_mog2(make_rig):
    rig = make_rig(W, H)
    found = {}
    for name in SUBTRACTORS:
        estimate = locate(streaks(8, 34), streaks(8, 22), rig, method="paper", options=PaperOptions(subtractor=name))
        found[name] = [(leak.left_column_px, leak.right_column_px) for leak in estimate.leaks]
    assert found["median"] == found["mean"] == [(34, 22)]
    assert found["mog2"] == []


def test_mog2_sees_the_same_in_16_bit_as_in_8():
    frames = streaks(40)
    eight, sixteen = mog2_foreground(frames), mog2_foreground(frames.astype(np.uint16) * 257)
    assert np.array_equal(eight.profile_grey, sixteen.profile_grey)


def test_an_unknown_subtractor_is_refused_with_what_there_is():
    with pytest.raises(ValueError, match="subtractor must be one of median, mean, mog2, got 'knn'"):
        PaperOptions(subtractor="knn")
