"""Scatter and bias of the robust method's columns beside the Cramer-Rao bound of a streak's position.

One scene, many noises. The bound is that of a shift of the whole streak along the row, from its own noise-free pixels:
variance 1 / sum((dI/du)^2 / sigma^2), sigma the pixel's photon, read and rounding noise; hits, which the best estimator
would cut out at the cost of a tenth of the pixels, are left out of it. Bias is against the projected centre.

One run prints every number: `python benchmarks/leakloc_bound.py` (about a minute).
"""

import numpy as np

import simcam
from leakloc import locate
from scenarios.build import build_recording, build_scene, image_sensor, true_rig
from scenarios.leaks import resolved
from scenarios.scenario_file import read_scenario
from scenarios.simulate import simulate

NOISES = 16
DOSES_GY_H = {"M": 3.3, "H": 10.0}
SCENE_SEED = 1001


def main():
    whole = resolved(read_scenario("separated", [], seed=SCENE_SEED))
    bounds = [bound_px(whole, number) for number in range(len(whole.leak))]
    print(f"{'dose':<5}{'leak':<16}{'view':<7}{'bound px':>9}{'scatter px':>11}{'ratio (3)':>10}{'bias px':>9}")
    for name, dose in DOSES_GY_H.items():
        ratios = report(name, whole, dose, bounds)
        print(f"{name:<5}median ratio of scatter to bound (target 3): {np.median(ratios):.1f}")


def report(name, whole, dose, bounds):
    found = [estimated(whole, dose, seed) for seed in range(NOISES)]
    ratios = []
    for number, leak in enumerate(whole.leak):
        for view, side in enumerate(("left", "right")):
            off = np.array([clip[number][view] for clip in found if number in clip])
            scatter, bound = off.std(ddof=1), bounds[number][view]
            ratios.append(scatter / bound)
            place = f"{leak.x_m:.2f} {leak.y_m:.2f}"
            print(f"{name:<5}{place:<16}{side:<7}{bound:>9.4f}{scatter:>11.4f}{ratios[-1]:>10.1f}{off.mean():>9.3f}")
    return ratios


def estimated(whole, dose, seed):
    """Errors in px of both columns, by the leak's number, of the leaks found under one noise."""
    gamma = whole.gamma.model_copy(update={"dose_rate_gy_h": dose})
    clip = simulate(whole.model_copy(update={"seed": seed, "gamma": gamma}))
    errors = {}
    for leak in locate(clip.left, clip.right, clip.believed_rig).leaks:
        apart = [np.hypot(leak.x_m - true.x_m, leak.y_m - true.y_m) for true in clip.truth.leaks]
        true = clip.truth.leaks[int(np.argmin(apart))]
        if min(apart) < 0.3:
            left, right = leak.left_column_px - true.left_column_px, leak.right_column_px - true.right_column_px
            errors[int(np.argmin(apart))] = (left, right)
    return errors


def bound_px(whole, number):
    """Least standard deviation of a leak's column in either view, px."""
    scene, recording, sensor = build_scene(whole), build_recording(whole), image_sensor(whole)
    alone = simcam.Scene(scene.pedestal, scene.lamps, (scene.leaks[number],), drop_shadows=False)
    none = simcam.Scene(scene.pedestal, scene.lamps)
    clip, still = (simcam.render_clip(one, true_rig(whole), recording) for one in (alone, none))
    bounds = []
    for view in ("left", "right"):
        moving, background = getattr(clip, view), getattr(still, view)[0]
        slope = np.gradient(moving - background, axis=2)
        variance = moving + sensor.read_noise_e**2 + sensor.electrons_per_grey**2 / 12
        bounds.append(float(1 / np.sqrt((slope.astype(float) ** 2 / variance).sum())))
    return bounds


if __name__ == "__main__":
    main()
