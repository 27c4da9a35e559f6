"""Whatever the scene, a clip is finite, non-negative light, and truth and masks can be told."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from simcam import (
    Box,
    Grating,
    Lamp,
    Leak,
    Lens,
    Pedestal,
    Pipe,
    Pose,
    Recording,
    RustTexture,
    Scene,
    drop_centres,
    drop_mask,
    ground_truth,
    render_clip,
    shadow_mask,
    stereo_rig,
)


def random_scene(rng):
    def inside(reach_m=2.3):
        radius, azimuth = reach_m * np.sqrt(rng.uniform()), rng.uniform(-np.pi, np.pi)
        return radius * np.cos(azimuth), radius * np.sin(azimuth)

    lamps = [Lamp((*inside(), rng.uniform(-3, 3)), rng.uniform(0.01, 0.15), rng.uniform(0, 200)) for _ in range(2)]
    leaks = [
        Leak(*inside(), rng.uniform(-3, 3.3), rng.uniform(0.001, 0.03), rng.uniform(-2, 2, rng.integers(0, 6)))
        for _ in range(3)
    ]
    structures = [
        Box((*inside(), rng.uniform(-2, 2)), tuple(rng.uniform(0.02, 0.5, 3)), 30.0),
        Pipe((*inside(), -2.0), (*inside(), 2.0), 0.05),
        Grating((*inside(), rng.uniform(-2, 2)), (0.8, 0.8)),
    ]
    pedestal = Pedestal(texture=RustTexture(1))
    return Scene(pedestal, lamps[: rng.integers(0, 3)], leaks[: rng.integers(0, 4)], structures[: rng.integers(0, 4)])


@settings(max_examples=20)
@given(seed=st.integers(0, 10_000))
def test_any_scene_gives_finite_non_negative_light(seed):
    rng = np.random.default_rng(seed)
    scene = random_scene(rng)
    pose = Pose(
        *rng.uniform(-20, 20, 3), position_m=(rng.uniform(-2.4, -1), rng.uniform(-0.5, 0.5), rng.uniform(-1, 1))
    )
    lens = Lens(rng.uniform(40, 110), int(rng.integers(8, 90)), int(rng.integers(8, 60)), (0.05, 0, 0.001, 0, 0))
    rig = stereo_rig(pose=pose, lens=lens, baseline_m=0.3)
    recording = Recording(
        2, 12.0, rng.uniform(0.001, 0.08), float(rng.choice([0.0, 0.03])), float(rng.choice([0.0, 0.7]))
    )
    clip = render_clip(scene, rig, recording)
    for frames in (clip.left, clip.right):
        assert np.isfinite(frames).all()
        assert (frames >= 0).all()
    assert len(ground_truth(scene, rig, recording).leaks) == len(scene.leaks)
    assert drop_centres(scene, rig.left, recording, 0).shape[0] == len(scene.leaks)
    for mask in (drop_mask(scene, rig.right, recording, 1), shadow_mask(scene, rig.right, recording, 1)):
        assert np.isfinite(mask).all()
        assert mask.min() >= -1e-5
