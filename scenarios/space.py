"""Spaces of scenarios: one definition of what varies, from which samples, Hypothesis strategies and axis labels come.

Every value stands on a grid that starts at its plain value, so that a failing example shrinks towards the plain scene:
one leak, round numbers, no misalignment, no noise.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from scenarios.draws import seed_of_clip
from scenarios.scenario import LayoutTable, LeakTable, Scenario

if TYPE_CHECKING:
    from hypothesis.strategies import SearchStrategy

GRID_M = 0.05
"""Leaks of strategies stand on this grid, so that shrunk examples have round places."""

LEAKS_TABLE = "layout"
"""Axes of this table set how every leak drips, wherever it stands."""

PAPER_DRIP: Mapping[str, Any] = MappingProxyType(
    {"z_m": 2.0, "drop_radius_m": 0.0115, "drip_period_s": 0.27, "drip_jitter": 0.1}
)


@dataclass(frozen=True)
class Axis:
    """One thing that varies: the scenario's key, its range, its grid from the plain value on, and words for people."""

    key: str
    low: float
    high: float
    step: float
    plain: float
    unit: str
    label: str

    def __post_init__(self) -> None:
        """Check that the range holds a value of the grid."""
        if not (self.step > 0.0 and self.low <= self.high and self._last() >= self._first()):
            raise ValueError(
                f"Axis {self.key}: no multiple of {self.step} from {self.plain} in [{self.low}, {self.high}]"
            )

    def _first(self) -> int:
        return math.ceil((self.low - self.plain) / self.step - 1e-9)

    def _last(self) -> int:
        return math.floor((self.high - self.plain) / self.step + 1e-9)

    def at_step(self, steps: int) -> float:
        """Value `steps` grid steps from the plain one."""
        return round(self.plain + steps * self.step, 9)

    @property
    def n_values(self) -> int:
        """How many values of the grid are in the range."""
        return self._last() - self._first() + 1

    def at(self, share: float) -> float:
        """Value at a share in [0, 1) of the range, each grid value with the same share."""
        return self.at_step(self._first() + min(int(share * self.n_values), self.n_values - 1))

    def share_of(self, value: float) -> float:
        """Share in [0, 1] of the range that a value stands at, the middle of its grid value's; clipped to the range."""
        step = round((value - self.plain) / self.step) - self._first()
        return min(max((step + 0.5) / self.n_values, 0.0), 1.0)

    def steps(self) -> "SearchStrategy[int]":
        """Strategy of grid steps; shrinks to the plain value, or to the nearest end when that is out of range."""
        from hypothesis import strategies as st

        nearest = min(max(0, self._first()), self._last())
        return st.integers(self._first() - nearest, self._last() - nearest).map(lambda step: step + nearest)


@dataclass(frozen=True)
class Space:
    """Axes with their ranges, and the leaks: how many, how far apart, how far from the wall, and how they drip.

    What no axis sets is that of `base` (the defaults where it is None), whose leaks stand where `max_leaks` is 0. Axes
    of the table `layout` set how every leak drips.
    """

    name: str
    axes: tuple[Axis, ...]
    max_leaks: int
    min_separation_m: float = 0.4
    wall_margin_m: float = 0.2
    width_px: int = 480
    height_px: int = 270
    base: Scenario | None = None
    drip: Mapping[str, Any] = field(default_factory=lambda: PAPER_DRIP)

    @property
    def base_scenario(self) -> Scenario:
        """What no axis sets; not made before it is asked for, for no process of an estimator holds a scenario."""
        return self.base or Scenario()

    def labels(self) -> dict[str, str]:
        """Axis labels by key, with unit."""
        return {axis.key: f"{axis.label} ({axis.unit})" if axis.unit else axis.label for axis in self.axes}

    def within(self, name: str, max_leaks: int, ranges: Mapping[str, tuple[float, float]]) -> "Space":
        """Return a part of this space, with narrower ranges."""
        unknown = set(ranges) - {axis.key for axis in self.axes}
        if unknown:
            raise ValueError(f"Space {self.name}: has no axis {', '.join(sorted(unknown))}")
        axes = tuple(
            replace(axis, low=ranges[axis.key][0], high=ranges[axis.key][1]) if axis.key in ranges else axis
            for axis in self.axes
        )
        return replace(self, name=name, max_leaks=max_leaks, axes=axes)


FULL = Space(
    "full",
    (
        Axis("rig.baseline_m", 0.1, 0.8, 0.05, 0.5, "m", "baseline"),
        Axis("rig.hfov_deg", 50.0, 110.0, 5.0, 70.0, "deg", "field of view"),
        Axis("recording.n_frames", 3, 48, 1, 24, "", "frames"),
        Axis("gamma.dose_rate_gy_h", 0.0, 50.0, 1.0, 0.0, "Gy/h", "dose rate"),
        Axis("rig.roll_deg", -3.0, 3.0, 0.25, 0.0, "deg", "roll"),
        Axis("rig.pitch_deg", -3.0, 3.0, 0.25, 0.0, "deg", "pitch"),
    ),
    max_leaks=7,
)
"""Everything that the property suite varies, to its ends."""

EASY = FULL.within(
    "easy",
    3,
    {
        "rig.baseline_m": (0.4, 0.6),
        "rig.hfov_deg": (60.0, 80.0),
        "recording.n_frames": (18, 36),
        "gamma.dose_rate_gy_h": (0.0, 5.0),
        "rig.roll_deg": (0.0, 0.0),
        "rig.pitch_deg": (0.0, 0.0),
    },
)
NOMINAL = FULL.within(
    "nominal",
    4,
    {
        "rig.baseline_m": (0.3, 0.7),
        "rig.hfov_deg": (55.0, 90.0),
        "recording.n_frames": (12, 48),
        "gamma.dose_rate_gy_h": (0.0, 20.0),
        "rig.roll_deg": (-1.0, 1.0),
        "rig.pitch_deg": (-1.0, 1.0),
    },
)
HARD = replace(FULL, name="hard")
STRATA = (EASY, NOMINAL, HARD)


def samples(space: Space, n: int, seed: int) -> Iterator[Scenario]:
    """Quasi-random scenarios of a space (scrambled Halton): the first n do not depend on how many follow."""
    from scipy.stats import qmc  # half a second of imports that most commands do not need

    points = qmc.Halton(len(space.axes) + 1, rng=np.random.default_rng(seed)).random(n)
    for number, point in enumerate(points):
        yield sample_at(space, point, seed_of_clip(seed, number))


def sample_at(space: Space, point: Sequence[float], seed: int) -> Scenario:
    """Return the scenario at shares of the axes' ranges and, last, of the number of leaks; their places are random."""
    values = {axis.key: axis.at(share) for axis, share in zip(space.axes, point, strict=False)}
    scenario = scenario_at(space, values, seed)
    if space.max_leaks == 0:
        return scenario
    layout = LayoutTable(
        n_leaks=1 + min(int(point[-1] * space.max_leaks), space.max_leaks - 1),
        min_separation_m=space.min_separation_m,
        wall_margin_m=space.wall_margin_m,
        **drip_at(space, values),
    )
    return scenario.model_copy(update={"layout": layout})


def scene_of(stratum: str, number: int, seed: int) -> Scenario:
    """Scene `number` of a stratum's samples."""
    (space,) = (space for space in STRATA if space.name == stratum)
    *_, scenario = samples(space, number + 1, seed)
    return scenario


def scenarios(space: Space) -> "SearchStrategy[Scenario]":
    """Hypothesis strategy of a space: fewer leaks, plain values and the seed 0 are simpler."""
    from hypothesis import strategies as st

    def built(steps: tuple[int, ...], places: list[tuple[int, int]], seed: int) -> Scenario:
        values = {axis.key: axis.at_step(step) for axis, step in zip(space.axes, steps, strict=True)}
        leaks = tuple(LeakTable(x_m=round(x * GRID_M, 9), y_m=round(y * GRID_M, 9), **PAPER_DRIP) for x, y in places)
        return scenario_at(space, values, seed).model_copy(update={"leak": leaks})

    return st.builds(
        built,
        st.tuples(*(axis.steps() for axis in space.axes)),
        _places(space),
        st.integers(0, 2**16),
    )


def scenario_at(space: Space, values: Mapping[str, float], seed: int) -> Scenario:
    """Return the scenario with the axes at `values` and no leaks but those of the space's base."""
    tables: dict[str, dict[str, Any]] = {"rig": {"width_px": space.width_px, "height_px": space.height_px}}
    for key, value in values.items():
        table, _, name = key.partition(".")
        if table != LEAKS_TABLE:
            whole = Scenario.model_fields[table].annotation.model_fields[name].annotation is int  # type: ignore[union-attr]
            tables.setdefault(table, {})[name] = int(value) if whole else value
    base = space.base_scenario
    changed = {name: type(was).model_validate({**dict(was), **tables[name]}) for name, was in base if name in tables}
    return base.model_copy(update={"name": space.name, "seed": seed, **changed})


def drip_at(space: Space, values: Mapping[str, float]) -> dict[str, Any]:
    """Return how every leak drips where the axes are at `values`."""
    own = {key.partition(".")[2]: value for key, value in values.items() if key.startswith(f"{LEAKS_TABLE}.")}
    return {**space.drip, **own}


def _places(space: Space) -> "SearchStrategy[list[tuple[int, int]]]":
    """Grid places of leaks in the half disc, far enough apart; shrinks to one leak at (1, 0) m."""
    from hypothesis import strategies as st

    reach = 2.5 - space.wall_margin_m
    middle = round(1.0 / GRID_M)
    end = math.floor(reach / GRID_M)

    def inside(place: tuple[int, int]) -> bool:
        return math.hypot(*place) * GRID_M <= reach

    def apart(places: list[tuple[int, int]]) -> bool:
        return all(
            math.dist(one, other) * GRID_M >= space.min_separation_m
            for i, one in enumerate(places)
            for other in places[:i]
        )

    place = st.tuples(st.integers(-middle, end - middle).map(lambda x: x + middle), st.integers(-end, end)).filter(
        inside
    )
    return st.lists(place, min_size=1, max_size=space.max_leaks).filter(apart)
