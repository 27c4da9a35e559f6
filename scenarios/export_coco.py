"""Drops and their shadows as COCO instance annotations, from the masks that the simulator makes beside its pictures.

An instance is a connected part of the mask of one leak in one image: as a rule the streak of one drop, or its shadow.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np

import simcam
from scenarios.build import build_recording, build_scene, true_rig
from scenarios.run_length import decoded, encoded
from scenarios.scenario import Scenario

CATEGORIES = {"drop": 1, "shadow": 2}
LEAST_SHARE = 1e-3
"""Of pixel and exposure that a drop covers, or of a lamp that it hides: nobody sees less."""
LEAST_OF_PEAK = 0.25
"""A pixel belongs to an instance when it is covered at least this share of what the most covered pixel of it is."""


@dataclass(frozen=True)
class Instance:
    """A drop or shadow in one image: its category, leak, and the pixels that it covers, (height, width) bool."""

    category: str
    leak: int
    pixels: np.ndarray


def coco_annotations(scenario: Scenario) -> dict[str, Any]:
    """Return the annotations of a resolved scenario's clip; file names are those inside the clip folder."""
    rig, recording = true_rig(scenario), build_recording(scenario)
    images: list[dict[str, Any]] = []
    annotations: list[dict[str, Any]] = []
    for side, camera in (("left", rig.left), ("right", rig.right)):
        for frame in range(recording.n_frames):
            image = len(images) + 1
            name = f"{side}/{frame:04d}.png"
            size = {"width": camera.width_px, "height": camera.height_px}
            images.append({"id": image, "file_name": name, **size, "camera": side, "frame": frame})
            for instance in instances(build_scene(scenario), camera, recording, frame):
                annotations.append(_annotation(instance, len(annotations) + 1, image))
    return {
        "info": {"description": scenario.description or scenario.name, "version": "1.0"},
        "images": images,
        "annotations": annotations,
        "categories": [{"id": number, "name": name, "supercategory": "leak"} for name, number in CATEGORIES.items()],
    }


def instances(
    scene: simcam.Scene, camera: simcam.Camera, recording: simcam.Recording, frame: int
) -> Iterator[Instance]:
    """Yield the drops and shadows of every leak in one image."""
    for number, leak in enumerate(scene.leaks):
        alone = replace(scene, leaks=(leak,))
        for category, mask_of in (("drop", simcam.drop_mask), ("shadow", simcam.shadow_mask)):
            for pixels in parts(mask_of(alone, camera, recording, frame)):
                yield Instance(category, number, pixels)


def parts(share: np.ndarray) -> Iterator[np.ndarray]:
    """Yield the connected parts of a soft mask, each (height, width) bool, from the top on; diagonals connect.

    Every part is cut at a share of its own peak: a drop that falls fast covers each pixel more briefly than a slow one.
    """
    n_parts, labels = cv2.connectedComponents((share >= LEAST_SHARE).astype(np.uint8), connectivity=8)
    for label in range(1, n_parts):
        here = np.where(labels == label, share, 0.0)
        yield here >= LEAST_OF_PEAK * here.max()


def _annotation(instance: Instance, number: int, image: int) -> dict[str, Any]:
    rows, columns = np.nonzero(instance.pixels)
    code = encoded(instance.pixels)
    assert np.array_equal(decoded(code), instance.pixels)
    left, top = int(columns.min()), int(rows.min())
    return {
        "id": number,
        "image_id": image,
        "category_id": CATEGORIES[instance.category],
        "leak_id": instance.leak,
        "segmentation": code,
        "area": len(rows),
        "bbox": [left, top, int(columns.max()) - left + 1, int(rows.max()) - top + 1],
        "iscrowd": 0,
    }
