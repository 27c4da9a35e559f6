"""The static scene beside a path tracer's: a uniform matt wall under direct light."""

import cv2
import numpy as np
import pytest
from reference_clips import REFERENCE, VIEWS, described, linear, read_reference

from simcam import UniformTexture
from simcam.static import static_view

BLOCK_PX = 30


@pytest.mark.parametrize("view", VIEWS)
def test_a_uniform_wall_has_the_path_tracers_light_everywhere(view):
    _, description = read_reference("separated")
    scene, rig, _ = described(description, UniformTexture(0.3))
    theirs = blocks(linear(cv2.imread(str(REFERENCE / f"uniform_{view}.png"), cv2.IMREAD_UNCHANGED)))
    ours = blocks(static_view(scene, getattr(rig, view)).direct.sum(axis=0).reshape(540, 960))
    gain = (theirs * ours).sum() / (ours * ours).sum()
    assert np.corrcoef(theirs.ravel(), ours.ravel())[0, 1] >= 0.999
    np.testing.assert_allclose(theirs / (gain * ours), 1, atol=0.01)


def blocks(image):
    height, width = image.shape
    return image.reshape(height // BLOCK_PX, BLOCK_PX, width // BLOCK_PX, BLOCK_PX).mean(axis=(1, 3))
