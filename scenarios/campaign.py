"""A campaign: a base scenario by a sweep or a space, times repeats, times methods; what its file may say."""

from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field

from scenarios.scenario import Model, list_of_at_most

MAX_ARMS = 500
MAX_RUNS = 100_000
MAX_AXES = 8
MAX_VALUES = 100
MAX_OVERRIDES = 100
MAX_METHODS = 3

Value = bool | int | float | str
"""Of a scenario's key."""


def _scalar(value: Any) -> Any:
    """A union would give a message for each of its kinds."""
    if not isinstance(value, bool | int | float | str):
        raise ValueError("must be a number, a text or true or false")
    return value


Scalar = Annotated[Value, BeforeValidator(_scalar)]
Overrides = Annotated[
    tuple[Annotated[str, Field(max_length=1000)], ...], list_of_at_most(MAX_OVERRIDES), Field(max_length=MAX_OVERRIDES)
]


class AxisTable(Model):
    """One key of the scenario, and the values that it takes in turn."""

    key: str = Field(min_length=1, max_length=100, description="of the scenario, say gamma.dose_rate_gy_h")
    label: str = Field("", max_length=100, description="for figures, with the unit; the key when left out")
    values: Annotated[tuple[Scalar, ...], list_of_at_most(MAX_VALUES)] = Field(max_length=MAX_VALUES)


class VariantTable(Model):
    """One situation of a choice."""

    name: str = Field(min_length=1, max_length=100)
    set: Overrides = Field((), description='overrides, each "key.path=value" as after --set')


class ChoiceTable(Model):
    """An axis of named variants: what differs between them takes more than one key."""

    name: str = Field(min_length=1, max_length=100, description="what is chosen, say lamps")
    variant: Annotated[tuple[VariantTable, ...], list_of_at_most(MAX_VALUES)] = Field(max_length=MAX_VALUES)
    draws: Literal["common", "own"] = Field(
        "common", description="own: variants are different scenes, each with other seeds, as if they were repeats"
    )


class SpaceTable(Model):
    """Scenes of a stratum of the bench, quasi-random, in the place of a base scenario and its sweep."""

    stratum: Literal["easy", "nominal", "hard"]
    scenes: int = Field(ge=1, le=MAX_RUNS)


class Campaign(Model):
    """One study: every arm of the sweep is repeated with the same seeds, and every method sees the same clips."""

    name: str = Field("", max_length=100)
    description: str = Field("", max_length=2000)
    scenario: str | None = Field(
        None, min_length=1, max_length=1000, description="shipped name, or a path from the campaign file on"
    )
    set: Overrides = Field((), description='overrides of every arm, each "key.path=value" as after --set')
    axis: Annotated[tuple[AxisTable, ...], list_of_at_most(MAX_AXES)] = Field((), max_length=MAX_AXES)
    choice: Annotated[tuple[ChoiceTable, ...], list_of_at_most(MAX_AXES)] = Field((), max_length=MAX_AXES)
    space: SpaceTable | None = None
    repeats: int = Field(1, ge=1, le=MAX_RUNS, description="of every arm; repeat r has the same seed in all arms")
    seed: int = Field(0, ge=0, lt=10**9)
    methods: Annotated[tuple[Literal["paper", "robust", "naive"], ...], list_of_at_most(MAX_METHODS)] = Field(
        ("robust",), max_length=MAX_METHODS, description="foreign estimators are named on the command line alone"
    )
    scene_limit_s: float = Field(
        300.0, ge=1.0, le=36_000.0, description="a scene that takes longer with all its methods is a time-out"
    )

    @property
    def n_arms(self) -> int:
        """Combinations of values and variants."""
        n_arms = 1
        for axis in self.axis:
            n_arms *= len(axis.values)
        for choice in self.choice:
            n_arms *= len(choice.variant)
        return n_arms

    @property
    def n_scenes(self) -> int:
        """Clips to render."""
        return self.n_arms * self.repeats if self.space is None else self.space.scenes
