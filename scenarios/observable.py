"""The verdict *observable*, from geometry and photometry alone: nothing of it comes from an estimator.

Observable: in view of both cameras; visible over at least a quarter of the rows in both; its drop column at least
1.5 drop widths + 3 px from every other leak's in both; and a noise-free column aggregate of at least 5 standard
deviations of the aggregate under the clip's noise, in both.
"""

import math

import numpy as np

import simcam
from noise import expected_column_sd, shown_grey
from scenarios.build import gamma_field, image_sensor
from scenarios.scenario import Scenario
from scenarios.truth import LeakTruth, ShadowColumns, TrueCamera, TrueRig, Truth

LEAST_VISIBLE_FRACTION = 0.25
LEAST_SNR = 5.0
SEPARATION_DROP_WIDTHS = 1.5
SEPARATION_PX = 3.0
CAMERAS = ("left", "right")


def state_truth(scenario: Scenario, clean: simcam.StereoClip, seen: simcam.Truth) -> Truth:
    """Return the truth of a resolved scenario from its noise-free frames and the geometry that simcam states."""
    snr = {
        side: column_snr(scenario, getattr(clean, side), [getattr(leak, side) for leak in seen.leaks])
        for side in CAMERAS
    }
    leaks = tuple(
        _leak_truth(scenario, seen, number, min(snr["left"][number], snr["right"][number]))
        for number in range(len(seen.leaks))
    )
    rig = TrueRig(
        left=_camera(seen.rig.left),
        right=_camera(seen.rig.right),
        baseline_m=scenario.rig.baseline_m,
        pedestal_radius_m=scenario.pedestal.radius_m,
    )
    return Truth(leaks=leaks, rig=rig)


def column_snr(scenario: Scenario, frames_e: np.ndarray, views: list[simcam.LeakView]) -> list[float]:
    """Noise-free column aggregate at each leak's column over its predicted standard deviation; NaN out of view.

    The aggregate is eq. 3 of the paper on what a noise-free sensor shows, the best column within the drop: what is
    white stays white whatever falls before it.
    """
    return [_snr_of(scenario, frames_e[:, :, drop_columns(view, frames_e.shape[2])]) for view in views]


def _snr_of(scenario: Scenario, strip_e: np.ndarray) -> float:
    """Signal over noise of the best column of a strip (frames, rows, columns); NaN without columns."""
    n_frames, n_rows, n_columns = strip_e.shape
    if n_columns == 0:
        return math.nan
    sensor = image_sensor(scenario)
    strip_grey = shown_grey(strip_e, sensor)
    profile_grey = np.abs(strip_grey - np.median(strip_grey, axis=0)).mean(axis=(0, 1))
    best = int(profile_grey.argmax())
    sd_grey = expected_column_sd(
        float(np.median(strip_e[:, :, best], axis=0).mean()),
        gamma_field(scenario),
        sensor,
        exposure_s=scenario.recording.exposure_s,
        n_rows=n_rows,
        n_frames=n_frames,
    )
    if sd_grey == 0.0:  # every noise is switched off: what makes a level's difference at all stands out
        return math.inf if profile_grey[best] * n_rows * n_frames >= 1.0 else 0.0
    return float(profile_grey[best] / sd_grey)


def drop_columns(view: simcam.LeakView, width_px: int) -> np.ndarray:
    """Columns of the image that a leak's drops cover at mid-row; empty out of the image."""
    if math.isnan(view.column_px):
        return np.arange(0)
    first = max(math.floor(view.column_px - view.drop_width_px / 2.0), 0)
    last = min(math.ceil(view.column_px + view.drop_width_px / 2.0), width_px - 1)
    return np.arange(first, last + 1)


def reason_not_observable(seen: simcam.Truth, number: int, snr: float) -> str | None:
    """Return the first rule that leak `number` breaks, in words, or None when it is observable."""
    leak = seen.leaks[number]
    if not leak.in_view:
        blind = [side for side in CAMERAS if not getattr(leak, side).in_view]
        return f"out of view ({' and '.join(blind)})"
    if leak.visible_fraction < LEAST_VISIBLE_FRACTION:
        hidden = leak.left.occluded_by or leak.right.occluded_by
        return f"{'occluded' if hidden else 'too few rows'} ({leak.visible_fraction:.0%} of the rows visible)"
    for other, rival in enumerate(seen.leaks):
        if other != number and _merge(leak, rival):
            return f"merged with leak {other}"
    if not snr >= LEAST_SNR:
        return f"low signal ({snr:.1f} standard deviations)"
    return None


def _merge(leak: simcam.LeakTruth, rival: simcam.LeakTruth) -> bool:
    """Whether two leaks' drop columns are too close in either view."""
    for side in CAMERAS:
        one, other = getattr(leak, side), getattr(rival, side)
        width_px = np.fmax(one.drop_width_px, other.drop_width_px)
        if abs(one.column_px - other.column_px) < SEPARATION_DROP_WIDTHS * width_px + SEPARATION_PX:
            return True
    return False


def _leak_truth(scenario: Scenario, seen: simcam.Truth, number: int, snr: float) -> LeakTruth:
    leak, view = scenario.leak[number], seen.leaks[number]
    reason = reason_not_observable(seen, number, snr)
    return LeakTruth(
        id=number,
        x_m=leak.x_m,
        y_m=leak.y_m,
        z_m=leak.z_m,
        left_column_px=_defined(view.left.column_px),
        right_column_px=_defined(view.right.column_px),
        shadow_columns_px=ShadowColumns(
            left=tuple(map(_defined, view.left.shadow_columns_px)),
            right=tuple(map(_defined, view.right.shadow_columns_px)),
        ),
        in_view=view.in_view,
        visible_fraction=view.visible_fraction,
        observable=reason is None,
        reason=reason,
        column_snr=_defined(snr),
    )


def _camera(camera: simcam.Camera) -> TrueCamera:
    fields = {
        "width_px": camera.width_px,
        "height_px": camera.height_px,
        "camera_matrix": camera.camera_matrix.tolist(),
        "distortion": camera.distortion.tolist(),
        "world_from_camera": camera.world_from_camera.tolist(),
    }
    return TrueCamera.model_validate(fields, strict=False)  # lists for tuples


def _defined(value: float) -> float | None:
    """Undefined is null in files."""
    return float(value) if math.isfinite(value) else None
