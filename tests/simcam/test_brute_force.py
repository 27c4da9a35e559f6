"""The fast path beside its definition, every ray of every frame, for random scenes."""

import numpy as np
import pytest
from brute_force import BruteForce
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from simcam import Box, Lamp, Leak, Lens, Pedestal, Pose, Recording, RustTexture, Scene, render_view, stereo_rig

GREY_E = 33.0  # photo-electrons of a grey level
SMALL = Lens(70.0, 96, 64)


def leaks():
    return st.builds(
        lambda x, y, z, radius, times: Leak(x, y, z, radius, np.array(times)),
        st.floats(-0.8, 2.3),
        st.floats(-0.8, 0.8),
        st.floats(0.2, 1.8),
        st.floats(0.003, 0.012),
        st.lists(st.floats(-0.6, 0.02), min_size=1, max_size=3),
    )


def scenes():
    lamp = st.builds(
        lambda x, y, z, radius: Lamp((x, y, z), radius, 12.0),
        st.floats(-2.3, -2.0),
        st.floats(-0.5, 0.5),
        st.floats(0.35, 0.8),  # above what the camera sees: grey levels beside a lamp are thousands
        st.floats(0.02, 0.12),
    )
    return st.builds(
        lambda seed, lamps, dripping: Scene(Pedestal(texture=RustTexture(seed)), tuple(lamps), tuple(dripping)),
        st.integers(0, 5),
        st.lists(lamp, min_size=1, max_size=2),
        st.lists(leaks(), min_size=1, max_size=2),
    )


def differences_in_grey(scene, camera, recording):
    fast = render_view(scene, camera, recording)[0]
    return np.abs(fast - BruteForce(scene, camera, recording).frame(0)) / GREY_E


# 100 in the deep profile; shrinking renders hundreds of clips
@settings(max_examples=settings().max_examples // 10, phases=(Phase.explicit, Phase.generate))
@given(
    scene=scenes(), tilt=st.tuples(*[st.floats(-5, 5)] * 3), k1=st.floats(-0.1, 0.1), exposure=st.floats(0.005, 0.083)
)
def test_fast_and_brute_force_agree(scene, tilt, k1, exposure):
    lens = Lens(70.0, 96, 64, (k1, 0.0, 0.001, -0.001, 0.0))
    camera = stereo_rig(lens=lens, pose=Pose(*tilt)).left
    off = differences_in_grey(scene, camera, Recording(1, 12.0, exposure))
    assert np.mean(off <= 1) >= 0.999
    assert off.max() <= 3


def test_fast_and_brute_force_agree_behind_and_over_structure():
    leak = Leak(0.5, 0.0, 1.2, 0.012, np.array([-0.42, -0.3]))
    beams = (Box((0.0, 0.1, 0.2), (0.1, 0.3, 0.1)), Box((1.2, 0.0, -0.6), (0.3, 1.5, 0.1)))
    scene = Scene(Pedestal(texture=RustTexture(1)), (Lamp(),), (leak,), beams)
    camera = stereo_rig(lens=SMALL).left
    off = differences_in_grey(scene, camera, Recording(1, 12.0, 1 / 12))
    assert np.mean(off <= 1) >= 0.999
    assert off.max() <= 3


def test_the_difference_that_is_compared_is_not_nothing():
    leak = Leak(0.0, 0.0, 0.5, 0.02, np.array([-0.2]))
    scene = Scene(Pedestal(texture=RustTexture(1)), (Lamp(),), (leak,))
    camera, recording = stereo_rig(lens=SMALL).left, Recording(1, 12.0, 1 / 12)
    still = render_view(Scene(scene.pedestal, scene.lamps), camera, recording)[0]
    change = (BruteForce(scene, camera, recording).frame(0) - still) / GREY_E
    assert np.abs(change).max() > 1.5
    fast = (render_view(scene, camera, recording)[0] - still) / GREY_E
    assert np.abs(fast).sum() == pytest.approx(np.abs(change).sum(), rel=0.1)
