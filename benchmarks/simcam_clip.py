"""simcam's clip beside its brute-force definition and beside path-traced clips: speed, agreement, memory.

One run prints every number: `python benchmarks/simcam_clip.py` (about a minute); with the name of a part, that part.
"""

import resource
import sys
import time
from collections import defaultdict
from pathlib import Path

import cv2
import numpy as np

sys.path.insert(0, str(Path(__file__).parent.parent / "tests" / "simcam"))

from brute_force import BruteForce
from reference_clips import REFERENCE, VIEWS, compared, described, disc_light, linear, pooled_light, read_reference
from reference_drops import close_ups, glint_light, inside, without_glints

import simcam.streaks
from simcam import (
    Lamp,
    Leak,
    Lens,
    Pedestal,
    Recording,
    RustTexture,
    Scene,
    UniformTexture,
    render_clip,
    render_view,
    shadow_mask,
    stereo_rig,
)
from simcam.dropview import no_glints
from simcam.raycast import rays_cast
from simcam.static import forget_static_layers, light_scene, static_view

PLACES = ((0.8, 0.06), (1.5, -0.9), (0.3, 0.7))  # three separated leaks
PERIOD_S = 0.2
GREY_E = 33.0
PRESETS_PSF_PX = 0.6  # the widest point-spread of the shipped scenarios
REPEATS = 5
FEW = 15  # streaks below which a median is noise


def main() -> None:
    parts = {
        "speed": speed,
        "agreement": agreement,
        "background": background,
        "drops": drops,
        "clips": clips,
        "penumbra": penumbra,
    }
    for name in sys.argv[1:] or parts:
        print(f"-- {name}")
        parts[name]()


def dripping(period_s: float = PERIOD_S) -> Scene:
    leaks = tuple(Leak(x, y, 2.0, 0.006, np.arange(-1.3, 2.2, period_s) + 0.05 * x) for x, y in PLACES)
    return Scene(Pedestal(texture=RustTexture()), (Lamp(),), leaks)


def seconds(work) -> float:
    return min(_once(work) for _ in range(REPEATS))


def _once(work) -> float:
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def line(name: str, text: str) -> None:
    print(f"{name:<58} {text}")


def speed() -> None:
    scene, rig, recording = dripping(), stereo_rig(), Recording()
    scene.pedestal.texture.maps()

    def static_layers() -> None:
        forget_static_layers()
        light_scene(scene)
        render_clip(Scene(scene.pedestal, scene.lamps), rig, Recording(1))

    first_ever = _once(lambda: render_clip(scene, rig, recording))
    line("first clip of the process, everything included", f"{first_ever:.2f} s")
    peak_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    line("peak memory of the process after it (400 MB)", f"{peak_mb:.0f} MB, {2 * 24 * 2.07:.0f} of it the clip")
    static_s = seconds(static_layers)
    line("static layer, both views, first time (target 0.5 s)", f"{static_s:.3f} s")
    render_clip(scene, rig, recording)
    clip_s = seconds(lambda: render_clip(scene, rig, recording))
    still_s = seconds(lambda: render_clip(Scene(scene.pedestal, scene.lamps), rig, recording))
    line("moving layer, 24 stereo frames, 3 leaks (target 0.3 s)", f"{clip_s:.3f} s with the copy of the static frames")
    spread = Recording(psf_sigma_px=PRESETS_PSF_PX)
    spread_s = seconds(lambda: render_clip(scene, rig, spread))
    line("  with the presets' point-spread of the lens", f"{spread_s:.3f} s")
    line("  of it frames without drops", f"{still_s:.3f} s")
    count = rays_cast()
    render_clip(Scene(scene.pedestal, scene.lamps), rig, recording)
    line("rays at the static scene in a second clip (target 0)", f"{rays_cast() - count}")
    periods = [0.4, 0.2, 0.1, 0.05]
    by_drops = [seconds(lambda p=period: render_clip(dripping(p), rig, recording)) for period in periods]
    falls = [sum(len(leak.drop_times_s) for leak in dripping(period).leaks) for period in periods]
    slope, start = np.polyfit(falls, by_drops, 1)
    line(f"cost for {falls} drops", f"{np.round(by_drops, 3)} s: {1e3 * slope:.2f} ms per drop + {start:.3f} s")
    lengths = [6, 12, 24, 48]
    by_frames = [seconds(lambda n=n: render_clip(scene, rig, Recording(n))) for n in lengths]
    slope, start = np.polyfit(lengths, by_frames, 1)
    line(f"cost for {lengths} frames", f"{np.round(by_frames, 3)} s: {1e3 * slope:.2f} ms per frame + {start:.3f} s")
    brute = BruteForce(scene, rig.left, recording)
    moment_s = min(_once(lambda: brute.moment(0.0)) for _ in range(3))
    image_s = moment_s * brute.moments
    line("brute force, one image (64 moments of every ray)", f"{image_s:.1f} s, from {moment_s:.3f} s per moment")
    line("ratio for a first clip (target 20)", f"{48 * image_s / (static_s + clip_s):.0f} x")


def agreement() -> None:
    lens, recording = Lens(70.0, 240, 136), Recording(1, 12.0, 1 / 12)
    worst, share = 0.0, 1.0
    for seed in range(4):
        rng = np.random.default_rng(seed)
        leaks = tuple(
            Leak(rng.uniform(-0.5, 2), rng.uniform(-0.8, 0.8), 1.5, rng.uniform(0.004, 0.012), rng.uniform(-0.6, 0, 3))
            for _ in range(2)
        )
        scene, camera = Scene(Pedestal(texture=RustTexture(seed)), (Lamp(),), leaks), stereo_rig(lens=lens).left
        off = np.abs(render_view(scene, camera, recording)[0] - BruteForce(scene, camera, recording).frame(0)) / GREY_E
        worst, share = max(worst, off.max()), min(share, np.mean(off <= 1))
    line("fast against brute force: within 1 grey (99.9 %), worst (3)", f"{100 * share:.3f} %, {worst:.2f} grey")


def background() -> None:
    _, description = read_reference("separated")
    scene, rig, _ = described(description, UniformTexture(0.3))
    for view in VIEWS:
        image = cv2.imread(str(REFERENCE / f"uniform_{view}.png"), cv2.IMREAD_UNCHANGED)
        theirs, ours = _blocks(linear(image)), _blocks(static_view(scene, getattr(rig, view)).direct.sum(axis=0))
        ratio = theirs / ((theirs * ours).sum() / (ours * ours).sum() * ours)
        correlation = np.corrcoef(theirs.ravel(), ours.ravel())[0, 1]
        line(f"{view}: correlation (0.999), ratio (1 %)", f"{correlation:.5f}, {ratio.min():.4f} to {ratio.max():.4f}")


def _blocks(image):
    return image.reshape(18, 30, 32, 30).mean(axis=(1, 3))


def drops() -> None:
    rng = np.random.default_rng(0)
    ratios, glints, counts = [], [], []
    for one in close_ups():
        theirs, ours = without_glints(one)
        total = [(drop / wall)[inside(one)].mean() for drop, wall in _pairs(one)]
        light, place = zip(*(glint_light(*pair) for pair in _pairs(one)), strict=True)
        paths = light[0] * one.reference_wall.mean() / one.lamp_path_light
        apart = np.linalg.norm(place[1] - place[0]) / one.radius
        line(
            f"drop {one.name}: total, glint light, place/r, correlation",
            f"{total[1] / total[0]:.3f} {light[1] / light[0]:.2f} {apart:.3f} "
            f"{np.corrcoef(theirs, ours)[0, 1]:.3f}   ({paths:.0f} paths met the lamp; std {theirs.std():.3f})",
        )
        off = (light[1] - light[0]) * one.reference_wall.mean()
        counts.append((off / np.sqrt(light[1] * one.reference_wall.mean() * one.lamp_path_light), paths))
        ratios.append(total)
        glints.append(light)
    total, glint = np.sum(ratios, axis=0), np.sum(glints, axis=0)
    line("all drops: total light (5 %), glint light (20 %)", f"{total[1] / total[0]:.3f} {glint[1] / glint[0]:.3f}")
    off, paths = np.transpose(counts)
    line("a glint against the counting noise of the reference's paths", f"rms {np.sqrt(np.mean(off**2)):.2f} sigma")
    within = np.mean([abs(rng.poisson(k, 1000) / max(k, 1) - 1) < 0.2 for k in paths], axis=1)
    line(
        "chance that the reference, rendered anew, is within 20 % of itself", f"{np.array2string(within, precision=2)}"
    )


def _pairs(one):
    return (one.reference, one.reference_wall), (one.ours, one.ours_wall)


def clips() -> None:
    rows = defaultdict(list)
    for name in ("separated", "crowded"):
        for kind, view, leak, theirs, ours in compared(name, render_clip):
            change = [getattr(ours, key) - getattr(theirs, key) for key in ("column_px", "first_row", "last_row")]
            rows[kind, view, leak].append(change)
    for kind, single_px in (("drop", 0.5), ("shadow", 1.0)):
        groups = {key: np.array(values) for key, values in rows.items() if key[0] == kind}
        together = np.concatenate(list(groups.values()))
        medians = [abs(np.median(values[:, 0])) for values in groups.values() if len(values) >= FEW]
        line(
            f"{kind} column, worst median of leak and view (0.2 px)", f"{max(medians):.3f} px of {len(medians)} groups"
        )
        within = np.mean(np.abs(together[:, 0]) < single_px)
        line(f"{kind} streaks within {single_px} px (95 %)", f"{100 * within:.1f} % of {len(together)}")
        if kind == "drop":
            ends = np.mean(np.abs(together[:, 1:]) <= 1, axis=0)
            line(
                "ends: medians (0), within 1 row (90 %)",
                f"{np.median(together[:, 1:], axis=0)} {np.round(100 * ends, 1)} %",
            )
    glints, simcam.streaks.drop_glints = simcam.streaks.drop_glints, lambda _, nodes: no_glints(len(nodes.fall_s))
    found = {}
    for hidden in (1.0, 0.55, 0.1):
        light = pooled_light("separated", render_clip, hidden)
        drop, shadow = (light[kind].sum(axis=0) for kind in ("drop", "shadow"))
        noise = light["drop"][:, 0].std() * np.sqrt(len(light["drop"])) / disc_light("separated")
        line(
            f"unseen wall {hidden} x seen: shadow ratio, drop ref and ours / disc",
            f"{shadow[1] / shadow[0]:.3f} {drop[0] / disc_light('separated'):+.4f} "
            f"{drop[1] / disc_light('separated'):+.4f} (reference's noise {noise:.4f})",
        )
        found[hidden] = (drop[1], shadow[1] / shadow[0])
    per_hidden = np.polyfit(list(found), [values[0] for values in found.values()], 1)
    shadows = np.polyfit(list(found), [values[1] for values in found.values()], 2)
    noise *= disc_light("separated")
    mirrored = (drop[0] + noise * np.array([-1, 0, 1]) - per_hidden[1]) / per_hidden[0]
    line("unseen wall as the drops mirror it, -1, 0, +1 sigma", f"{np.round(mirrored, 2)} x seen")
    line("  shadow ratio there (10 %)", f"{np.round(np.polyval(shadows, mirrored), 3)}")
    simcam.streaks.drop_glints = glints


def penumbra() -> None:
    column, peak = {}, {}
    for x_m in (0.0, 2.4):
        leak = Leak(x_m, 0.0, 2.0, 0.006, np.arange(-1.2, 0.1, 0.11))
        scene = Scene(Pedestal(texture=UniformTexture(0.3)), (Lamp((-2.3, 0.0, 0.0), 0.1),), (leak,))
        column[x_m] = shadow_mask(scene, stereo_rig().left, Recording(), 0).sum(axis=0).max()
        peak[x_m] = min(1.0, (0.006 / (2.5 - x_m)) ** 2 / (0.1 / 4.8) ** 2)
    line(
        "mid-pedestal over near-wall shadow: peak (0.1), column sum",
        f"{peak[0] / peak[2.4]:.3f} {column[0] / column[2.4]:.3f}",
    )
    for radius_m in (0.006, 0.012, 0.018):
        disc_m = 0.1 * 2.5 / 4.8
        line(f"  closed form of the column ratio, drop radius {radius_m} m", f"{min(1, radius_m / disc_m):.3f}")
    line(
        "static radiance at the middle of the left view",
        f"{static_view(dripping(), stereo_rig().left).radiance[270, 480]:.4f}",
    )


if __name__ == "__main__":
    main()
