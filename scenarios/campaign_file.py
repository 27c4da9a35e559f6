"""Read campaign files: TOML in, a frozen campaign with its scenes or *all* of its mistakes out."""

import hashlib
import json
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from scenarios.arms import Arm, Scene, arms_of, scenes_of
from scenarios.campaign import MAX_ARMS, MAX_RUNS, Campaign
from scenarios.meshes import mesh_hashes
from scenarios.mistakes import FileRules, Violation, capped, checked
from scenarios.scenario_file import ScenarioError, read_scenario
from scenarios.shelf import Shelf

SWEEP_KEYS = ("scenario", "axis", "choice", "repeats")


class CampaignError(ValueError):
    """A campaign that cannot be run; the message has one line a mistake."""


CAMPAIGNS = Shelf("campaign", "campaigns", CampaignError)


@dataclass(frozen=True)
class CampaignFile:
    """A campaign without mistakes, what its file is called in messages, and where its base scenario is."""

    source: str
    campaign: Campaign
    base: str

    def scenes(self) -> list[Scene]:
        """Return all scenes, by number."""
        return scenes_of(self.campaign, self.base)

    def fingerprint(self) -> str:
        """SHA-256 of everything that the file says, the base scenario as it reads now included."""
        scenario = read_scenario(self.base) if self.campaign.space is None else None
        base = scenario.model_dump(mode="json") if scenario else None
        said = {"campaign": self.campaign.model_dump(mode="json"), "base": base}
        if scenario and (meshes := mesh_hashes(scenario)):
            said["meshes"] = meshes
        return hashlib.sha256(json.dumps(said, sort_keys=True).encode()).hexdigest()


def read_campaign(path_or_name: str | Path) -> CampaignFile:
    """Read a campaign file, or a shipped campaign by its name; raises CampaignError with all mistakes.

    Every arm is read as a scenario, so that a mistake in any of them is known before the first scene is rendered.
    """
    source, text = CAMPAIGNS.text_of(path_or_name)
    campaign, lines = checked(CAMPAIGNS.parsed(text, source), source, CAMPAIGN_RULES)
    if campaign is not None:
        base = _base_of(campaign, path_or_name)
        lines = capped([*lines, *_mistakes_in_arms(campaign, source, base)], source)
    if lines:
        raise CampaignError("\n".join(lines))
    assert campaign is not None
    return CampaignFile(source, campaign, base)


def repeated(file: CampaignFile, repeats: int) -> CampaignFile:
    """Return a campaign with another number of repeats; raises CampaignError where a file could not have it."""
    if file.campaign.space is not None:
        raise CampaignError(f"{file.source}: repeats: belongs to a sweep; a [space] has scenes")
    campaign = file.campaign.model_copy(update={"repeats": repeats})
    if lines := [f"{file.source}: {broken.key}: {broken.rule}, got {broken.value}" for broken in _size(campaign)]:
        raise CampaignError("\n".join(lines))
    return CampaignFile(file.source, campaign, file.base)


def violations(campaign: Campaign) -> list[Violation]:
    """Return all broken rules between a campaign's values."""
    return [
        *_either_space_or_sweep(campaign),
        *_repeated(campaign),
        *_empty(campaign),
        *_seeds(campaign),
        *_size(campaign),
    ]


CAMPAIGN_RULES = FileRules(
    Campaign,
    violations,
    faultless_rows={
        "axis": {"key": "seed", "values": [0]},
        "choice": {"name": "nothing", "variant": [{"name": "nothing"}]},
    },
)


def _base_of(campaign: Campaign, path_or_name: str | Path) -> str:
    """Name or path of the base scenario; a path starts at the campaign file."""
    if campaign.scenario is None:
        return ""
    beside = Path(path_or_name).parent / campaign.scenario
    return str(beside) if Path(path_or_name).is_file() and beside.is_file() else campaign.scenario


def _either_space_or_sweep(campaign: Campaign) -> Iterator[Violation]:
    if campaign.space is None and campaign.scenario is None:
        yield Violation("scenario", None, "a scenario to sweep or a [space] is required", ("scenario", "space"))
    for key in SWEEP_KEYS if campaign.space is not None else ():
        if key in campaign.model_fields_set:
            rule = f"must not stand beside [space], which has scenes of its own: {key} belongs to a sweep"
            yield Violation(key, getattr(campaign, key), rule, (key, "space"))


def _repeated(campaign: Campaign) -> Iterator[Violation]:
    names = [axis.key for axis in campaign.axis] + [choice.name for choice in campaign.choice]
    yield from _twice("axis", "an axis", names, ("axis", "choice"))
    yield from _twice("methods", "a method", campaign.methods, ("methods",))
    for i, axis in enumerate(campaign.axis):
        key = f"axis.{i}.values"
        yield from _twice(key, "a value", [repr(value) for value in axis.values], (key,))
    for i, choice in enumerate(campaign.choice):
        key = f"choice.{i}.variant"
        yield from _twice(key, "a variant", [variant.name for variant in choice.variant], (key,))


def _twice(key: str, what: str, names: Iterable[str], reads: tuple[str, ...]) -> Iterator[Violation]:
    for name, count in Counter(names).items():
        if count > 1:
            yield Violation(key, name, f"{what} must not stand there twice", reads)


def _empty(campaign: Campaign) -> Iterator[Violation]:
    keys = [(f"axis.{i}.values", axis.values) for i, axis in enumerate(campaign.axis)]
    for key, places in keys + [(f"choice.{i}.variant", choice.variant) for i, choice in enumerate(campaign.choice)]:
        if not places:
            yield Violation(key, [], "must have at least one entry", (key,))


def _seeds(campaign: Campaign) -> Iterator[Violation]:
    """The campaign's seed gives every repeat its own, the same in all arms: an arm must not have another."""
    rule = "must not set the seed: repeat r has the same in all arms"
    for i, axis in enumerate(campaign.axis):
        if axis.key == "seed":
            yield Violation(f"axis.{i}.key", axis.key, rule, (f"axis.{i}",))
    sets = [("set", campaign.set)] + [
        (f"choice.{i}.variant.{j}.set", variant.set)
        for i, choice in enumerate(campaign.choice)
        for j, variant in enumerate(choice.variant)
    ]
    for key, overrides in sets:
        for override in overrides:
            if override.partition("=")[0].strip() == "seed":
                yield Violation(key, override, rule, (key,))


def _size(campaign: Campaign) -> Iterator[Violation]:
    reads = ("axis", "choice", "space", "repeats", "methods")
    if campaign.n_arms > MAX_ARMS:
        yield Violation("axis", campaign.n_arms, f"must have at most {MAX_ARMS} combinations of all axes", reads[:2])
    n_runs = campaign.n_scenes * max(len(campaign.methods), 1)
    if n_runs > MAX_RUNS:
        key = "repeats" if campaign.space is None else "space.scenes"
        yield Violation(key, n_runs, f"must make at most {MAX_RUNS} runs of scenes and methods", reads)


def _mistakes_in_arms(campaign: Campaign, source: str, base: str) -> list[str]:
    """Lines of what is wrong with the scenarios of a campaign, each line once, with the settings that bring it about.

    Nothing is said of the arms when there are too many of them or the base scenario is bad by itself.
    """
    if campaign.space is not None:
        lines = _mistakes_in(f"{campaign.space.stratum}:0", campaign.set) or _mistakes_in_samples(campaign, base)
        return [f"{source}: set: {line}" for line in lines]
    if campaign.n_arms > MAX_ARMS or campaign.scenario is None:
        return []
    if mistakes := _mistakes_in(base, ()):
        return [f"{source}: scenario: {line}" for line in mistakes]
    arms, before = arms_of(campaign), _mistakes_in(base, campaign.set)
    guilty: dict[str, list[Arm]] = defaultdict(list)
    for arm in arms:
        for line in _mistakes_in(base, (*campaign.set, *arm.overrides)):
            guilty[line].append(arm)
    return [
        f"{source}: {'set' if line in before and len(bad) == len(arms) else _cause(campaign, bad)}: {line}"
        for line, bad in guilty.items()
    ]


def _mistakes_in(base: str, overrides: tuple[str, ...]) -> list[str]:
    try:
        mesh_hashes(read_scenario(base, overrides))
    except ScenarioError as error:
        return str(error).splitlines()
    return []


def _mistakes_in_samples(campaign: Campaign, base: str) -> list[str]:
    """What is wrong with the first scene of a space that cannot be."""
    try:
        scenes_of(campaign, base)
    except ScenarioError as error:
        return str(error).splitlines()
    return []


def _cause(campaign: Campaign, guilty: list[Arm]) -> str:
    """Keys of the settings that all guilty arms share; an axis with one place is blamed only when no other can be."""
    keys = [f"axis.{i}.values" for i in range(len(campaign.axis))]
    keys += [f"choice.{i}.variant" for i in range(len(campaign.choice))]
    n_places = [*(len(axis.values) for axis in campaign.axis), *(len(choice.variant) for choice in campaign.choice)]
    shared = {
        f"{key}.{settings[0].place}": n
        for key, n, *settings in zip(keys, n_places, *(arm.settings for arm in guilty), strict=True)
        if len({setting.place for setting in settings}) == 1
    }
    return " with ".join([key for key, n in shared.items() if n > 1] or shared) or "axis"
