"""Rules between the values of a scenario: what no single field can know."""

import math
from collections.abc import Iterator
from dataclasses import dataclass

from scenarios.scenario import MAX_DROPS_PER_LEAK, Scenario

MAX_CLIP_PIXELS = 2_000_000_000
"""Both cameras, all frames: 4 GB as float32 for one camera of a stereo pair."""


@dataclass(frozen=True)
class Violation:
    """One broken rule: the key to blame, its value, the rule, and every key that the rule reads."""

    key: str
    value: object
    rule: str
    reads: tuple[str, ...]


def violations(scenario: Scenario) -> list[Violation]:
    """Return all broken rules, in the order of the file's sections."""
    return [
        *_cameras_inside(scenario),
        *_shutter_times(scenario),
        *_clip_size(scenario),
        *_lamps_inside(scenario),
        *_leaks_inside(scenario),
        *_drop_times(scenario),
        *_layout(scenario),
    ]


def _pedestal_says(scenario: Scenario, x_m: float, y_m: float, z_m: float, margin_m: float = 0.0) -> str | None:
    """What is wrong with a place that has to be inside the pedestal, or None."""
    pedestal = scenario.pedestal
    range_m = math.hypot(x_m, y_m)
    if range_m + margin_m >= pedestal.radius_m:
        return f"be inside the pedestal: {range_m:.3f} m from its axis, radius {pedestal.radius_m:g} m"
    low_m, high_m = (pedestal.centre_z_m + side * pedestal.height_m / 2.0 for side in (-1.0, 1.0))
    if not low_m + margin_m < z_m < high_m - margin_m:
        return f"be between floor ({low_m:g} m) and ceiling ({high_m:g} m)"
    return None


PEDESTAL = ("pedestal.radius_m", "pedestal.height_m", "pedestal.centre_z_m")


def _cameras_inside(scenario: Scenario) -> Iterator[Violation]:
    rig = scenario.rig
    yaw, roll = math.radians(rig.yaw_deg), math.radians(rig.roll_deg)
    pitch = math.radians(rig.pitch_deg)
    # second column of Rz(yaw) Ry(pitch) Rx(roll): where the rig's left points in the world
    left = (
        math.cos(yaw) * math.sin(pitch) * math.sin(roll) - math.sin(yaw) * math.cos(roll),
        math.sin(yaw) * math.sin(pitch) * math.sin(roll) + math.cos(yaw) * math.cos(roll),
        math.cos(pitch) * math.sin(roll),
    )
    reads = ("rig.position_m", "rig.baseline_m", "rig.roll_deg", "rig.pitch_deg", "rig.yaw_deg", *PEDESTAL)
    for side, sign in (("left", 0.5), ("right", -0.5)):
        eye = [o + sign * rig.baseline_m * axis for o, axis in zip(rig.position_m, left, strict=True)]
        if broken := _pedestal_says(scenario, eye[0], eye[1], eye[2]):
            shown = ", ".join(f"{value:.3f}" for value in eye)
            yield Violation("rig.position_m", list(rig.position_m), f"{side} camera at ({shown}) must {broken}", reads)
            return


def _shutter_times(scenario: Scenario) -> Iterator[Violation]:
    recording = scenario.recording
    frame_s = 1.0 / recording.fps
    if recording.exposure_s > frame_s * (1.0 + 1e-9):
        rule = f"must be at most 1 / fps = {frame_s:.6g} s"
        yield Violation("recording.exposure_s", recording.exposure_s, rule, ("recording.exposure_s", "recording.fps"))
    if recording.readout_s > frame_s * (1.0 + 1e-9):
        rule = f"must be at most 1 / fps = {frame_s:.6g} s"
        yield Violation("recording.readout_s", recording.readout_s, rule, ("recording.readout_s", "recording.fps"))


def _clip_size(scenario: Scenario) -> Iterator[Violation]:
    n_pixels = 2 * scenario.recording.n_frames * scenario.rig.width_px * scenario.rig.height_px
    if n_pixels > MAX_CLIP_PIXELS:
        rule = f"makes a clip of {n_pixels:.3g} px, more than {MAX_CLIP_PIXELS:.3g}: must be fewer or smaller frames"
        yield Violation(
            "recording.n_frames",
            scenario.recording.n_frames,
            rule,
            ("recording.n_frames", "rig.width_px", "rig.height_px"),
        )


def _lamps_inside(scenario: Scenario) -> Iterator[Violation]:
    for i, lamp in enumerate(scenario.lamp):
        reads = (f"lamp.{i}", *PEDESTAL)
        if broken := _pedestal_says(scenario, *lamp.position_m, margin_m=lamp.radius_m):
            yield Violation(f"lamp.{i}.position_m", list(lamp.position_m), f"must, whole, {broken}", reads)


def _leaks_inside(scenario: Scenario) -> Iterator[Violation]:
    for i, leak in enumerate(scenario.leak):
        reads = (f"leak.{i}", *PEDESTAL)
        if broken := _pedestal_says(scenario, leak.x_m, leak.y_m, leak.z_m, leak.drop_radius_m):
            key = f"leak.{i}.z_m" if "floor" in broken else f"leak.{i}.x_m"
            value: object = leak.z_m if "floor" in broken else (leak.x_m, leak.y_m)
            yield Violation(key, value, f"must {broken}", reads)


def _drop_times(scenario: Scenario) -> Iterator[Violation]:
    recording, pedestal = scenario.recording, scenario.pedestal
    for i, leak in enumerate(scenario.leak):
        fall_m = max(leak.z_m - pedestal.centre_z_m + pedestal.height_m / 2.0, 0.0)
        in_air_s = recording.n_frames / recording.fps + 1.0 + math.sqrt(2.0 * fall_m / 9.81)
        n_drops = in_air_s / (leak.drip_period_s * (1.0 - leak.drip_jitter)) + 2.0
        if leak.drop_times_s is None and n_drops > MAX_DROPS_PER_LEAK:
            rule = f"makes more than {MAX_DROPS_PER_LEAK} drops in {in_air_s:.3g} s: must be longer"
            reads = (f"leak.{i}", "recording.n_frames", "recording.fps", *PEDESTAL)
            yield Violation(f"leak.{i}.drip_period_s", leak.drip_period_s, rule, reads)


def _layout(scenario: Scenario) -> Iterator[Violation]:
    layout = scenario.layout
    if layout is None:
        return
    if scenario.leak:
        yield Violation(
            "layout", "[layout]", "must not stand beside [[leak]]: leaks are random or given", ("layout", "leak")
        )
    if layout.wall_margin_m >= scenario.pedestal.radius_m:
        rule = f"must be less than pedestal.radius_m = {scenario.pedestal.radius_m:g}"
        yield Violation("layout.wall_margin_m", layout.wall_margin_m, rule, ("layout", *PEDESTAL))
        return
    if broken := _pedestal_says(scenario, 0.0, 0.0, layout.z_m, layout.drop_radius_m):
        yield Violation("layout.z_m", layout.z_m, f"must {broken}", ("layout", *PEDESTAL))
    # Whole layouts are drawn until one has no pair too close: the expected number of close pairs in a layout at
    # random must be small enough that one in exp(-7) or so has none.
    room_m2 = math.pi / 2.0 * (scenario.pedestal.radius_m - layout.wall_margin_m) ** 2
    close_pairs = layout.n_leaks * (layout.n_leaks - 1) / 2.0 * math.pi * layout.min_separation_m**2 / room_m2
    if close_pairs > 7.0:
        rule = f"{layout.n_leaks} leaks do not fit that far apart into the half disc: must be smaller"
        yield Violation("layout.min_separation_m", layout.min_separation_m, rule, ("layout", *PEDESTAL))
