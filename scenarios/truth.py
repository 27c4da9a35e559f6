"""What is true of a clip: where the leaks are, how they are seen, and whether an estimator could have found them."""

import json
from pathlib import Path
from typing import Annotated

from pydantic import BaseModel, ConfigDict, FailFast, Field, ValidationError, model_validator

from leakloc.outside_file import read_regular_file
from scenarios.mistakes import capped, shown_key

MAX_TRUTH_BYTES = 1_000_000
"""Of 100 leaks and 16 lamps some 200 000."""


class TruthError(ValueError):
    """A truth file that cannot be used; the message names file, key and rule."""


Row3 = tuple[float, float, float]
Row4 = tuple[float, float, float, float]


class Model(BaseModel):
    """Frozen; undefined is null."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, strict=True)


class ShadowColumns(Model):
    """Column of a leak's shadow, one per lamp, in each raw image; null where the shadow is not in view."""

    left: Annotated[tuple[float | None, ...], FailFast()]
    right: Annotated[tuple[float | None, ...], FailFast()]


class LeakTruth(Model):
    """One leak. Columns are where its line crosses row (H-1)/2 of the raw image."""

    id: int = Field(ge=0)
    x_m: float
    y_m: float
    z_m: float
    left_column_px: float | None
    right_column_px: float | None
    shadow_columns_px: ShadowColumns
    in_view: bool = Field(description="at least 3 px inside both images at mid-row")
    visible_fraction: float = Field(ge=0.0, le=1.0, description="of the rows, in the worse of the two views")
    observable: bool
    reason: str | None = Field(description="why the leak is not observable; null when it is")
    column_snr: float | None = Field(description="noise-free column aggregate over its standard deviation, worse view")


class TrueCamera(Model):
    """One camera as it truly stands (camera axes: x right, y down, z forward)."""

    width_px: int = Field(gt=0)
    height_px: int = Field(gt=0)
    camera_matrix: tuple[Row3, Row3, Row3]
    distortion: tuple[float, float, float, float, float]
    world_from_camera: tuple[Row4, Row4, Row4, Row4]


class TrueRig(Model):
    """The rig that the clip was rendered with."""

    left: TrueCamera
    right: TrueCamera
    baseline_m: float = Field(gt=0.0)
    pedestal_radius_m: float = Field(gt=0.0)


class Truth(Model):
    """Content of truth.json."""

    leaks: Annotated[tuple[LeakTruth, ...], FailFast()]
    rig: TrueRig

    @model_validator(mode="after")
    def _ids_are_unique(self) -> "Truth":
        if len({leak.id for leak in self.leaks}) < len(self.leaks):
            raise ValueError("every leak must have an id of its own")
        if self.rig.left.camera_matrix[0][0] <= 0.0:
            raise ValueError("rig.left.camera_matrix must have a focal length > 0")
        return self


def truth_json(truth: Truth) -> str:
    """Content of truth.json."""
    return json.dumps(truth.model_dump(mode="json"), indent=1, allow_nan=False) + "\n"


def read_truth(path: Path) -> Truth:
    """Read truth.json; raises TruthError with file, key and rule."""
    try:
        return Truth.model_validate_json(read_regular_file(path, MAX_TRUTH_BYTES))
    except ValidationError as error:
        lines = [
            f"{path}: {shown_key(detail['loc']) or 'content'}: {detail['msg']}"
            for detail in error.errors(include_url=False, include_input=False)
        ]
        raise TruthError("\n".join(capped(lines, str(path)))) from None
    except ValueError as error:
        raise TruthError(f"{path}: {error}") from None
