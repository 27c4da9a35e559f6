"""What a results store is of: one campaign, its estimators, one version; nothing else's results come into it."""

import hashlib
import json
from dataclasses import asdict, dataclass
from pathlib import Path

from scenarios.campaign import Campaign
from scenarios.estimators import EstimatorSpec
from scenarios.stored_run import Run


class StoreError(ValueError):
    """A store that cannot be used; the message names the file and the rule."""


@dataclass(frozen=True)
class Identity:
    """What a store holds results of; results of anything else must not come into it."""

    campaign: Campaign
    fingerprint: str
    estimators: tuple[EstimatorSpec, ...]
    versions: str

    def as_rows(self) -> dict[str, str]:
        """Return the identity as texts by key, their digest included."""
        rows = {
            "campaign": self.campaign.model_dump_json(),
            "fingerprint": self.fingerprint,
            "estimators": json.dumps([asdict(spec) for spec in self.estimators]),
            "versions": self.versions,
        }
        return {**rows, "sha256": hashlib.sha256(json.dumps(rows).encode()).hexdigest()}

    def may_have(self, run: Run) -> bool:
        """Whether a run is of one of the estimators and on the axes of the campaign."""
        axes = {axis.key for axis in self.campaign.axis} | {choice.name for choice in self.campaign.choice}
        return run.values.keys() == axes and run.method in {spec.text for spec in self.estimators}


def check_same(path: Path, stored: Identity, wanted: Identity) -> None:
    """Refuse to mix results of two campaigns, of two lists of estimators or of two versions."""
    advice = "start a new store"
    if stored.fingerprint != wanted.fingerprint:
        name = stored.campaign.name or "without a name"
        raise StoreError(f"{path}: holds results of another campaign ({name}), or this one has changed: {advice}")
    if stored.estimators != wanted.estimators:
        names = ", ".join(spec.text for spec in stored.estimators)
        raise StoreError(f"{path}: holds results of other estimators or time-outs ({names}): {advice}")
    if stored.versions != wanted.versions:
        raise StoreError(f"{path}: was begun with {stored.versions}; here is {wanted.versions}: {advice}")
