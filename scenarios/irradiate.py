"""Gamma hits for frames that exist already: a clip folder, or a folder of images, a user's own included.

Only what radiation adds is added: such frames carry the noise of their own sensor.
"""

import json
import re
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager
from dataclasses import dataclass, fields, replace
from pathlib import Path

import cv2
import numpy as np

from noise import GammaField, GammaHits, Sensor, add_noise
from scenarios.clip_folder import ESTIMATORS_FILES, ESTIMATORS_FOLDERS, encode_png
from scenarios.output_folder import made_by, write_file, write_json

IMAGE_SUFFIXES = {".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp", ".pgm"}
MAX_FRAMES = 2000
MAX_FRAME_BYTES = 256 << 20
MAX_PIXELS = 2_000_000_000
"""Of one camera: decoded, 2 GB."""


class FramesError(ValueError):
    """Frames that cannot be read; the message names the file and the rule."""


@dataclass(frozen=True)
class Exposure:
    """What the hits depend on beside field and sensor."""

    exposure_s: float
    seed: int


def irradiate(
    source: Path,
    field: GammaField,
    sensor: Sensor,
    exposure: Exposure,
    staged: AbstractContextManager[Path],
) -> int:
    """Write a copy of the frames in `source` with gamma hits, and hits.csv per camera; returns the number of hits.

    `source` is a folder of images, or holds left/ and right/ with rig.yaml and input.json, which are copied. `sensor`
    lends its geometry, scale and tone; its own noise is left off. Raises FramesError.
    """
    ideal = replace(sensor.without_noise(), charge_diffusion_um=sensor.charge_diffusion_um)
    cameras = [side for side in ESTIMATORS_FOLDERS if (source / side).is_dir()] or [""]
    n_hits = 0
    with staged as folder:
        for camera in cameras:
            names, frames = read_frames(source / camera)
            noisy = add_noise(
                frames, field, ideal, exposure_s=exposure.exposure_s, seed=exposure.seed, camera=camera or "left"
            )
            _write_frames(folder / camera, names, noisy.frames)
            write_file(folder / camera / "hits.csv" if not camera else folder / f"hits_{camera}.csv", _csv(noisy.hits))
            n_hits += len(noisy.hits)
        for name in ESTIMATORS_FILES:
            if (source / name).is_file():
                write_file(folder / name, (source / name).read_bytes())
        write_json(folder / "noise.json", _marker(field, sensor, exposure))
    return n_hits


def recorded_exposure_s(source: Path) -> float | None:
    """Exposure that input.json of a clip states, or None."""
    path = source / "input.json"
    if not path.is_file() or path.stat().st_size > 1_000_000:
        return None
    try:
        value = json.loads(path.read_text(encoding="utf-8")).get("exposure_s")
    except (ValueError, AttributeError, RecursionError):
        raise FramesError(f"{path}: not valid JSON with a key exposure_s") from None
    if not isinstance(value, int | float) or not 0.0 < value < 1e4:
        raise FramesError(f"{path}: exposure_s must be > 0 s, got {value!r}")
    return float(value)


def read_frames(folder: Path) -> tuple[list[str], np.ndarray]:
    """Names and grey uint8 frames (frames, height, width) of a folder of images, in the order of their numbers.

    Colour is turned to grey (Rec. 601 luma). Raises FramesError naming the image that is unreadable, of more than 8 bit
    or of another size than the first.
    """
    try:
        paths = sorted(
            (path for path in folder.iterdir() if path.suffix.lower() in IMAGE_SUFFIXES), key=_number_then_name
        )
    except OSError as error:
        raise FramesError(f"{folder}: cannot be read: {error.strerror}") from None
    if not paths:
        raise FramesError(f"{folder}: holds no images ({', '.join(sorted(IMAGE_SUFFIXES))}) and no left/ and right/")
    if len(paths) > MAX_FRAMES:
        raise FramesError(f"{folder}: holds {len(paths)} images, more than {MAX_FRAMES}")
    twice = sorted({path.name for path in paths if sum(path.stem == other.stem for other in paths) > 1})
    if twice:
        raise FramesError(f"{folder / twice[0]}: another image has the same name but for its ending")
    first = _read_frame(paths[0])
    if len(paths) * first.size > MAX_PIXELS:
        raise FramesError(f"{folder}: {len(paths)} images of {first.size} px are more than {MAX_PIXELS:.3g} px")
    frames = np.empty((len(paths), *first.shape), np.uint8)
    with ThreadPoolExecutor(2) as threads:
        for i, frame in enumerate(threads.map(_read_frame, paths)):
            if frame.shape != first.shape:
                raise FramesError(
                    f"{paths[i]}: must be as large as the first, {_size(first)} px, got {_size(frame)} px"
                )
            frames[i] = frame
    return [path.name for path in paths], frames


def _read_frame(path: Path) -> np.ndarray:
    if not path.is_file():
        raise FramesError(f"{path}: must be a regular file")
    if path.stat().st_size > MAX_FRAME_BYTES:
        raise FramesError(f"{path}: must be at most {MAX_FRAME_BYTES} bytes")
    raw = np.frombuffer(path.read_bytes(), np.uint8)
    try:
        frame = cv2.imdecode(raw, cv2.IMREAD_ANYDEPTH | cv2.IMREAD_GRAYSCALE) if len(raw) else None
    except cv2.error:
        frame = None
    if frame is None:
        raise FramesError(f"{path}: is no readable image")
    if frame.dtype != np.uint8:
        raise FramesError(f"{path}: must have 8 bit, got {8 * frame.itemsize}")
    return frame


def _number_then_name(path: Path) -> tuple[int, str]:
    numbers = re.findall(r"\d+", path.stem)
    return (int(numbers[-1]) if numbers else -1, path.name)


def _size(frame: np.ndarray) -> str:
    return f"{frame.shape[1]} x {frame.shape[0]}"


def _write_frames(folder: Path, names: list[str], frames: np.ndarray) -> None:
    folder.mkdir(exist_ok=True)
    for name, frame in zip(names, frames, strict=True):
        write_file(folder / Path(name).with_suffix(".png").name, encode_png(frame))


def _csv(hits: GammaHits) -> str:
    columns = [field.name for field in fields(hits)]
    rows: Iterator[tuple[float, ...]] = zip(*(getattr(hits, name).tolist() for name in columns), strict=True)
    form: Callable[[float], str] = "{:.6g}".format
    return "\n".join([",".join(columns), *(",".join(map(form, row)) for row in rows)]) + "\n"


def _marker(field: GammaField, sensor: Sensor, exposure: Exposure) -> dict[str, object]:
    return {
        "made_by": made_by(),
        "dose_rate_gy_h": field.dose_rate_gy_h,
        "photon_energy_kev": field.photon_energy_kev,
        "level": field.level,
        "exposure_s": exposure.exposure_s,
        "pitch_um": sensor.pitch_um,
        "thickness_um": sensor.thickness_um,
        "electrons_per_grey": sensor.electrons_per_grey,
        "tone": sensor.tone,
        "seed": exposure.seed,
    }
