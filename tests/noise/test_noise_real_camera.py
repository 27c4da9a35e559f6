"""Against a real camera in a Co-60 field: the grey histogram of its noise-only frames and the shape of its clusters.

Reference: summary statistics of published noise-only frames (nominal 199 Gy/h, 1/12 s, 256 x 256, 8 bit), listed in the
design notes. Model: 4 um layer, 1.75 um pitch, a Co-60 beam onto the sensor. Four parameters are fitted, of one chain
for every level: gain (electrons per grey), offset (grey), blur (diffusion), fluence (dose rate).
"""

import cv2
import numpy as np
import pytest
from scipy.optimize import minimize

from noise import GammaField, Sensor, add_noise

pytestmark = [pytest.mark.statistical, pytest.mark.usefixtures("fresh_draws"), pytest.mark.xdist_group("real camera")]

# fmt: off
REAL_BINS = np.array(
    [5719.5, 1397.7, 858.8, 526.3, 358.2, 245.0, 169.4, 119.9, 98.1, 79.1, 64.3, 54.0, 47.5, 40.3, 35.4, 30.1,
     27.7, 24.0, 21.4, 15.7, 14.3, 11.7, 9.0, 8.6, 6.0, 5.5, 3.5, 3.4, 2.0, 1.5, 0.8, 1.4]
)
# fmt: on
"""Pixels per 10 000 in 32 bins of 8 grey."""

NOMINAL_GY_H = 199.0
CO60_KEV = 1252.9
N_FRAMES = 3
FLUENCES = (1 / 8, 1 / 6, 1 / 4)
SALT_FLUENCES = (1 / 128, 1 / 64, 1 / 32, 1 / 16, 1 / 8)
BLURS_UM = (0.7, 1.0, 1.25, 1.5)


def chain(level, parameters):
    """Noise-only frames of gain, offset, blur and fluence."""
    electrons_per_grey, offset, blur_um, fluence = parameters
    sensor = Sensor(
        pitch_um=1.75,
        thickness_um=4.0,
        electrons_per_grey=electrons_per_grey,
        charge_diffusion_um=blur_um,
        read_noise_e=0.0,
        shot_noise=False,
    )
    field = GammaField(NOMINAL_GY_H * fluence, photon_energy_kev=CO60_KEV, direction=(0, 0, 1), level=level)
    dark = np.full((N_FRAMES, 256, 256), max(offset, 0) * electrons_per_grey, np.float32)
    frames = add_noise(dark, field, sensor, exposure_s=1 / 12, seed=1, camera=0).frames
    return np.clip(frames.astype(int) + round(min(offset, 0)), 0, 255)


def histogram_distance(frames):
    """Earth mover's distance to the real histogram, in bins of 8 grey."""
    bins = np.bincount(frames.ravel() // 8, minlength=32) / frames.size
    return float(np.abs(np.cumsum(bins - REAL_BINS / REAL_BINS.sum())).sum())


def fit(level, fluences, blurs_um):
    """Best of a grid of fluence and blur, gain and offset by simplex search in each: distance and parameters."""
    best = (np.inf, ())
    for fluence in fluences:
        for blur_um in blurs_um:
            found = minimize(
                lambda p, b=blur_um, f=fluence: histogram_distance(chain(level, (np.exp(p[0]), p[1], b, f))),
                [np.log(2.5), 2.0],
                method="Nelder-Mead",
                options={"maxfev": 25, "initial_simplex": [[np.log(1.8), 4.0], [np.log(3.0), 4.0], [np.log(2.2), 0.0]]},
            )
            if found.fun < best[0]:
                best = (found.fun, (np.exp(found.x[0]), found.x[1], blur_um, fluence))
    return best


@pytest.fixture(scope="module")
def fitted():
    return fit("tracks", FLUENCES[:2], BLURS_UM[1:])


def assert_like_the_camera(distance):
    assert distance <= 0.15


def test_the_histogram_of_tracks_is_a_real_cameras(fitted):
    assert_like_the_camera(fitted[0])


def test_salt_with_the_same_four_parameters_is_at_least_three_times_worse(fitted):
    distance, _ = fit("salt", SALT_FLUENCES, BLURS_UM[1:2])  # diffusion does not act on white pixels
    assert distance >= 3 * fitted[0]
    with pytest.raises(AssertionError):
        assert_like_the_camera(distance)


def test_mean_and_tail_of_the_fit_are_the_real_cameras(fitted):
    frames = chain("tracks", fitted[1])
    assert frames.mean() == pytest.approx(16.7, rel=0.2)
    assert frames.std() == pytest.approx(27.9, rel=0.2)
    shares = [np.mean(frames > grey) for grey in (16, 32, 64, 128)]
    assert shares == pytest.approx([0.276, 0.144, 0.059, 0.0153], rel=0.4)


def clusters_of(frames, above):
    """Longer sides of the bounding boxes, and areas, of 8-connected clusters above a grey level."""
    boxes = [
        cv2.connectedComponentsWithStats((frame > above).astype(np.uint8), connectivity=8)[2][1:] for frame in frames
    ]
    table = np.concatenate(boxes)
    return table[:, [cv2.CC_STAT_WIDTH, cv2.CC_STAT_HEIGHT]].max(axis=1), table[:, cv2.CC_STAT_AREA]


def assert_tracks_among_dots(side_px):
    assert 0.08 <= np.mean(side_px >= 5) <= 0.20


def test_clusters_of_the_fit_are_a_real_cameras(fitted):
    side_px, area_px = clusters_of(chain("tracks", fitted[1]), 64)
    assert_tracks_among_dots(side_px)
    assert np.mean(side_px >= 10) == pytest.approx(0.01, abs=0.01)
    assert area_px.mean() == pytest.approx(4.8, rel=0.25)
    assert len(side_px) / (N_FRAMES * 256 * 256) * 1e6 == pytest.approx(12_400, rel=0.3)


def test_the_cluster_law_catches_salt(fitted):
    side_px, _ = clusters_of(chain("salt", (2.0, 4.0, 1.25, fitted[1][3])), 64)
    with pytest.raises(AssertionError):
        assert_tracks_among_dots(side_px)


def correlation_spread(frames, reach_px=16):
    """Standard deviation of the correlation of two of the frames (n, height, width) if they are independent.

    Within a frame pixels are not: the variance is the sum over lags of the squared autocorrelation, over the pixels
    (Bartlett, J. R. Stat. Soc. Suppl. 8, 1946, for series).
    """
    centred = frames - frames.mean(axis=(1, 2), keepdims=True)
    auto = np.fft.ifft2(np.abs(np.fft.fft2(centred)) ** 2).real.mean(axis=0)
    near = np.r_[-reach_px : reach_px + 1]
    return float(np.sqrt((auto[np.ix_(near, near)] ** 2).sum()) / auto[0, 0] / np.sqrt(frames[0].size))


def worst_correlation(frames):
    return float(np.abs(np.corrcoef(frames.reshape(len(frames), -1)) - np.eye(len(frames))).max())


def test_frames_are_as_independent_as_the_real_cameras(fitted):
    # the real camera's correlate by up to 0.016. Logarithms: two saturated hits that meet by chance, in one pair of
    # frames of a hundred, would make 0.07. Of 5 standard deviations chance gives 2 in a million
    frames = np.log1p(chain("tracks", fitted[1]))
    bound = 5.0 * correlation_spread(frames)
    assert bound < 0.06
    assert worst_correlation(frames) < bound
    shared = np.log1p(chain("tracks", (*fitted[1][:3], fitted[1][3] / 4))[:1])  # a quarter as many, in all of them
    assert worst_correlation(np.maximum(frames, shared)) > bound
