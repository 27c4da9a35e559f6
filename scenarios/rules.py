"""Rules between the values of a scenario: what no single field can know."""

import math
from collections.abc import Iterator

from scenarios.leaks import lead_s
from scenarios.mistakes import Violation
from scenarios.scenario import MAX_DROPS_PER_LEAK, Scenario

MAX_CLIP_PIXELS = 2_000_000_000
"""Both cameras, all frames: 4 GB as float32 for one camera of a stereo pair."""

MAX_BARS = 10_000
"""Of all gratings: twelve triangles each."""

SHORTEST_PIPE_M = 0.0001

MAX_HITS = 30_000_000
"""Of one camera: their table takes some 2 GB."""

MOST_TRACKS_PER_CM2_GY = 1.8e9
"""At 1.5 MeV; 1.13e9 at Cs-137."""

LONGEST_TRACK_UM = 300.0
"""Tracks that enter this far outside may reach the image."""


def violations(scenario: Scenario) -> list[Violation]:
    """Return all broken rules, in the order of the file's sections."""
    return [
        *_cameras_inside(scenario),
        *_shutter_times(scenario),
        *_clip_size(scenario),
        *_hits(scenario),
        *_lamps_inside(scenario),
        *_leaks_inside(scenario),
        *_drop_times(scenario),
        *_layout(scenario),
        *_structures(scenario),
    ]


def _beyond_wall(scenario: Scenario, x_m: float, y_m: float, margin_m: float = 0.0) -> str | None:
    """What a place beyond the wall must do, or None."""
    range_m, radius_m = math.hypot(x_m, y_m), scenario.pedestal.radius_m
    if range_m + margin_m < radius_m:
        return None
    return f"be inside the pedestal: {range_m:.3f} m from its axis, radius {radius_m:g} m"


def _beyond_floor_or_ceiling(scenario: Scenario, z_m: float, margin_m: float = 0.0) -> str | None:
    """What a place below the floor or above the ceiling must do, or None."""
    pedestal = scenario.pedestal
    low_m, high_m = (pedestal.centre_z_m + side * pedestal.height_m / 2.0 for side in (-1.0, 1.0))
    if low_m + margin_m < z_m < high_m - margin_m:
        return None
    return f"be between floor ({low_m:g} m) and ceiling ({high_m:g} m)"


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
        if broken := _beyond_wall(scenario, eye[0], eye[1]) or _beyond_floor_or_ceiling(scenario, eye[2]):
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


def most_hits(dose_gy: float, pitch_um: float, shape: tuple[int, int]) -> float:
    """Upper bound of the tracks that a dose draws in an image of (height, width) pixels and around it."""
    around_um = 2.0 * LONGEST_TRACK_UM
    area_um2 = math.prod(side * pitch_um + around_um for side in shape)
    return MOST_TRACKS_PER_CM2_GY * dose_gy * area_um2 * 1e-8


def _hits(scenario: Scenario) -> Iterator[Violation]:
    rig, recording = scenario.rig, scenario.recording
    dose_gy = scenario.gamma.dose_rate_gy_h * recording.exposure_s * recording.n_frames / 3600.0
    n_hits = most_hits(dose_gy, scenario.sensor.pitch_um, (rig.height_px, rig.width_px))
    if n_hits > MAX_HITS:
        rule = f"makes up to {n_hits:.2g} hits a camera, more than {MAX_HITS:.2g}: must be smaller, or the clip"
        keys = ("recording.exposure_s", "recording.n_frames", "sensor.pitch_um", "rig.width_px", "rig.height_px")
        yield Violation("gamma.dose_rate_gy_h", scenario.gamma.dose_rate_gy_h, rule, ("gamma.dose_rate_gy_h", *keys))


def _lamps_inside(scenario: Scenario) -> Iterator[Violation]:
    for i, lamp in enumerate(scenario.lamp):
        reads = (f"lamp.{i}", *PEDESTAL)
        x_m, y_m, z_m = lamp.position_m
        for broken in (
            _beyond_wall(scenario, x_m, y_m, lamp.radius_m),
            _beyond_floor_or_ceiling(scenario, z_m, lamp.radius_m),
        ):
            if broken:
                yield Violation(f"lamp.{i}.position_m", list(lamp.position_m), f"must, whole, {broken}", reads)


def _leaks_inside(scenario: Scenario) -> Iterator[Violation]:
    for i, leak in enumerate(scenario.leak):
        reads = (f"leak.{i}", *PEDESTAL)
        if broken := _beyond_wall(scenario, leak.x_m, leak.y_m, leak.drop_radius_m):
            yield Violation(f"leak.{i}.x_m", (leak.x_m, leak.y_m), f"must {broken}", reads)
        if broken := _beyond_floor_or_ceiling(scenario, leak.z_m, leak.drop_radius_m):
            yield Violation(f"leak.{i}.z_m", leak.z_m, f"must {broken}", reads)


def _drop_times(scenario: Scenario) -> Iterator[Violation]:
    recording, pedestal = scenario.recording, scenario.pedestal
    for i, leak in enumerate(scenario.leak):
        fall_m = max(leak.z_m - pedestal.centre_z_m + pedestal.height_m / 2.0, 0.0)
        in_air_s = recording.n_frames / recording.fps + lead_s(recording) + math.sqrt(2.0 * fall_m / 9.81)
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
    if broken := _beyond_floor_or_ceiling(scenario, layout.z_m, layout.drop_radius_m):
        yield Violation("layout.z_m", layout.z_m, f"must {broken}", ("layout", *PEDESTAL))
    # Whole layouts are drawn until one has no pair too close: the expected number of close pairs in a layout at
    # random must be small enough that one in exp(-7) or so has none.
    room_m2 = math.pi / 2.0 * (scenario.pedestal.radius_m - layout.wall_margin_m) ** 2
    close_pairs = layout.n_leaks * (layout.n_leaks - 1) / 2.0 * math.pi * layout.min_separation_m**2 / room_m2
    if close_pairs > 7.0:
        rule = f"{layout.n_leaks} leaks do not fit that far apart into the half disc: must be smaller"
        yield Violation("layout.min_separation_m", layout.min_separation_m, rule, ("layout", *PEDESTAL))


def _structures(scenario: Scenario) -> Iterator[Violation]:
    n_bars = 0.0
    for i, table in enumerate(scenario.structure):
        reads = (f"structure.{i}",)
        if table.kind == "pipe" and math.dist(table.start_m, table.end_m) < SHORTEST_PIPE_M:
            rule = f"must be at least {SHORTEST_PIPE_M:g} m from start_m"
            yield Violation(f"structure.{i}.end_m", list(table.end_m), rule, reads)
        if table.kind == "grating":
            if table.bar_m >= table.pitch_m:
                rule = f"must be less than pitch_m = {table.pitch_m:g}"
                yield Violation(f"structure.{i}.bar_m", table.bar_m, rule, reads)
            n_bars += sum(side_m / table.pitch_m + 1.0 for side_m in table.size_m)
            if n_bars > MAX_BARS:
                rule = f"all gratings must have at most {MAX_BARS} bars together"
                yield Violation(f"structure.{i}.pitch_m", table.pitch_m, rule, ("structure",))
