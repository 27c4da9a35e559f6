"""Where the leaks are and when their drops fall: what a scenario leaves to chance, drawn from its seed."""

import math

import numpy as np

from scenarios.draws import Stream, rng_for
from scenarios.scenario import Drip, LayoutTable, LeakTable, PedestalTable, RecordingTable, Scenario

G_M_S2 = 9.81
MAX_TRIES = 20_000
ROUNDED_M = 2e-4  # by which rounding may move a leak, and more


def resolved(scenario: Scenario) -> Scenario:
    """Return the scenario with nothing left to chance but the image noise: leaks placed, drop times listed.

    Resolving a resolved scenario changes nothing.
    """
    leaks = scenario.leak if scenario.layout is None else draw_layout(scenario.layout, scenario.pedestal, scenario.seed)
    timed = tuple(_with_drop_times(leak, i, scenario) for i, leak in enumerate(leaks))
    return scenario.model_copy(update={"leak": timed, "layout": None})


def draw_layout(layout: LayoutTable, pedestal: PedestalTable, seed: int) -> tuple[LeakTable, ...]:
    """Leaks uniform in the half disc x >= 0, none closer to another than the least separation.

    The whole layout is redrawn when a leak finds no room: keeping the first ones would favour the rim.
    """
    rng = rng_for(seed, Stream.LAYOUT)
    reach_m = pedestal.radius_m - max(layout.wall_margin_m, layout.drop_radius_m + ROUNDED_M)
    for _ in range(MAX_TRIES):
        range_m = reach_m * np.sqrt(rng.random(layout.n_leaks))
        azimuth = rng.uniform(-math.pi / 2.0, math.pi / 2.0, layout.n_leaks)
        places = np.column_stack([range_m * np.cos(azimuth), range_m * np.sin(azimuth)])
        gaps = np.linalg.norm(places[:, None] - places[None], axis=-1)[np.triu_indices(layout.n_leaks, 1)]
        if np.all(gaps >= layout.min_separation_m):
            drip = {name: getattr(layout, name) for name in Drip.model_fields}
            return tuple(LeakTable(x_m=float(x), y_m=float(y), **drip) for x, y in places.round(4))
    raise ValueError(f"layout: no room found for {layout.n_leaks} leaks {layout.min_separation_m} m apart")


def lead_s(recording: RecordingTable) -> float:
    """How long before frame 0's middle drops must be in the air: it opens at most that much earlier, s."""
    return max(1.0, (recording.exposure_s + recording.readout_s) / 2.0)


def draw_drop_times(
    drip: Drip, floor_z_m: float, end_s: float, *, begin_s: float = -1.0, rng: np.random.Generator
) -> np.ndarray:
    """Release times, s, of every drop that is in the air at any time from `begin_s` to `end_s`.

    The first time has a uniform phase; each interval is the period times 1 +- jitter. Later drops do not depend on
    how long the clip is.
    """
    fall_s = math.sqrt(2.0 * max(drip.z_m - floor_z_m, 0.0) / G_M_S2)
    start_s = begin_s - fall_s - drip.drip_period_s * rng.random()
    n_drops = math.ceil((end_s - start_s) / (drip.drip_period_s * (1.0 - drip.drip_jitter))) + 1
    intervals_s = drip.drip_period_s * (1.0 + drip.drip_jitter * rng.uniform(-1.0, 1.0, n_drops))
    times_s = start_s + np.cumsum(intervals_s)
    return np.round(times_s[times_s < end_s], 6)


def _with_drop_times(leak: LeakTable, i: int, scenario: Scenario) -> LeakTable:
    if leak.drop_times_s is not None:
        return leak
    recording, pedestal = scenario.recording, scenario.pedestal
    end_s = recording.n_frames / recording.fps
    floor_z_m = pedestal.centre_z_m - pedestal.height_m / 2.0
    rng = rng_for(scenario.seed, Stream.DRIPS, i)
    times_s = draw_drop_times(leak, floor_z_m, end_s, begin_s=-lead_s(recording), rng=rng)
    return leak.model_copy(update={"drop_times_s": tuple(float(t) for t in times_s)})
