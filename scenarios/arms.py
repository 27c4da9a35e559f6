"""Arms and scenes of a campaign: every combination of its axes, and in every arm the same seeds."""

import itertools
from collections.abc import Iterator
from dataclasses import dataclass

from scenarios.campaign import Campaign, Value
from scenarios.draws import seed_of_clip
from scenarios.scenario import Scenario
from scenarios.scenario_file import read_scenario, with_overrides
from scenarios.scenario_toml import inline_toml
from scenarios.space import STRATA, samples


@dataclass(frozen=True)
class Setting:
    """One axis at one of its places: the axis's name, the place's number and value or name, and what it overrides."""

    axis: str
    place: int
    value: Value
    overrides: tuple[str, ...]


@dataclass(frozen=True)
class Arm:
    """One combination of settings, one an axis; a campaign without axes has one arm."""

    number: int
    settings: tuple[Setting, ...]

    @property
    def values(self) -> dict[str, Value]:
        """Value or variant by axis."""
        return {setting.axis: setting.value for setting in self.settings}

    @property
    def overrides(self) -> tuple[str, ...]:
        """What the arm overrides in the base scenario."""
        return tuple(override for setting in self.settings for override in setting.overrides)


@dataclass(frozen=True)
class Scene:
    """One clip to render, with what `read_scenario` takes to make its scenario again: name, overrides and seed."""

    number: int
    arm: Arm
    repeat: int
    base: str
    overrides: tuple[str, ...]
    scenario: Scenario

    @property
    def seed(self) -> int:
        """Seed of all draws of the clip."""
        return self.scenario.seed


def arms_of(campaign: Campaign) -> list[Arm]:
    """Return every combination of the campaign's axes and choices, the last one fastest."""
    axes = [
        [Setting(axis.key, i, value, (f"{axis.key}={inline_toml(value)}",)) for i, value in enumerate(axis.values)]
        for axis in campaign.axis
    ] + [
        [Setting(choice.name, i, variant.name, variant.set) for i, variant in enumerate(choice.variant)]
        for choice in campaign.choice
    ]
    return [Arm(number, settings) for number, settings in enumerate(itertools.product(*axes))]


def scenes_of(campaign: Campaign, base: str) -> list[Scene]:
    """Return the scenes of a campaign that holds no mistake; `base` is the base scenario's shipped name or path.

    Common random numbers: repeat r has the seed `seed_of_clip(campaign.seed, r)` in every arm, whatever the arms are;
    but for choices whose variants are scenes of their own, where repeats are counted through.
    """
    return list(_scenes_of_space(campaign) if campaign.space is not None else _scenes_of_sweep(campaign, base))


def _scenes_of_sweep(campaign: Campaign, base: str) -> Iterator[Scene]:
    for arm in arms_of(campaign):
        overrides = (*campaign.set, *arm.overrides)
        scenario = read_scenario(base, overrides)
        for repeat in range(campaign.repeats):
            seed = seed_of_clip(campaign.seed, _draw(campaign, arm, repeat))
            number = arm.number * campaign.repeats + repeat
            yield Scene(number, arm, repeat, base, overrides, scenario.model_copy(update={"seed": seed}))


def _draw(campaign: Campaign, arm: Arm, repeat: int) -> int:
    """Number of the draws of a repeat in an arm."""
    block = 0
    for choice, setting in zip(campaign.choice, arm.settings[len(campaign.axis) :], strict=True):
        if choice.draws == "own":
            block = block * len(choice.variant) + setting.place
    return block * campaign.repeats + repeat


def _scenes_of_space(campaign: Campaign) -> Iterator[Scene]:
    assert campaign.space is not None
    stratum = campaign.space.stratum
    (space,) = (space for space in STRATA if space.name == stratum)
    (arm,) = arms_of(campaign)
    for number, sample in enumerate(samples(space, campaign.space.scenes, campaign.seed)):
        place = f"{stratum}:{number}:{campaign.seed}"
        yield Scene(number, arm, number, place, campaign.set, with_overrides(sample, campaign.set))
