"""Gamma hits for frames that exist already: a clip folder, or a folder of images, a user's own included.

Only what radiation adds is added: such frames carry the noise of their own sensor.
"""

import os
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from leakloc.clip import MAX_INPUT_BYTES
from leakloc.footage import image_paths
from leakloc.image_file import read_grey_image
from leakloc.outside_file import read_json, read_regular_file
from noise import GammaField, GammaHits, Sensor, add_noise
from noise.sensor import Tone
from scenarios.clip_folder import ESTIMATORS_FILES, ESTIMATORS_FOLDERS, encode_png, has_manifest, verify_input
from scenarios.mistakes import shown
from scenarios.output_folder import check_apart, made_by, write_file, write_json
from scenarios.rules import MAX_HITS, most_hits

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
    destination: Path,
    noise: tuple[GammaField, Sensor],
    exposure: Exposure,
    new_folder: Callable[[Path], AbstractContextManager[Path]],
) -> int:
    """Write a copy of the frames in `source` with gamma hits, and hits.csv per camera; returns the number of hits.

    `source` is a folder of images, or holds left/ and right/ with rig.yaml and input.json, which are copied. The sensor
    lends its geometry, scale and tone; its own noise is left off. Raises FramesError, DamagedClipError, OutputError.
    """
    field, sensor = noise
    check_apart(source, destination)
    cameras = _cameras(source)
    n_hits = 0
    with new_folder(destination) as folder:
        for camera in cameras:
            names, frames = read_frames(source / camera)
            _check_hits(field, sensor, exposure.exposure_s, frames)
            noisy = add_noise(
                frames,
                field,
                sensor.without_noise(),
                exposure_s=exposure.exposure_s,
                seed=exposure.seed,
                camera=camera or "left",
            )
            _write_frames(folder / camera, names, noisy.frames)
            write_file(folder / (f"hits_{camera}.csv" if camera else "hits.csv"), _csv(noisy.hits))
            n_hits += len(noisy.hits)
        for name in ESTIMATORS_FILES:
            if os.path.lexists(source / name):
                write_file(folder / name, _copied(source / name))
        write_json(folder / "noise.json", _marker(field, sensor, exposure))
    return n_hits


def recorded_exposure_s(source: Path) -> float | None:
    """Exposure that input.json of a clip states, or None."""
    path = source / "input.json"
    value = _recorded(path, "exposure_s")
    if value is None:
        return None
    if isinstance(value, bool) or not isinstance(value, int | float) or not 0.0 < value < 1e4:
        raise FramesError(f"{path}: exposure_s must be > 0 s, got {shown(value)}")
    return float(value)


def recorded_tone(source: Path) -> Tone | None:
    """Tone that input.json of a clip states, or None."""
    path = source / "input.json"
    value: Tone | None = _recorded(path, "tone")
    if value not in (None, "linear", "srgb"):
        raise FramesError(f"{path}: tone must be linear or srgb, got {shown(value)}")
    return value


def _recorded(path: Path, key: str) -> Any:
    """A value of input.json; None where there is no such file, or no such key in it."""
    if not os.path.lexists(path):
        return None
    try:
        return read_json(path, MAX_INPUT_BYTES).get(key)
    except AttributeError:
        raise FramesError(f"{path}: must be an object with a key {key}") from None
    except ValueError as error:
        raise FramesError(f"{path}: {error}") from None


def read_frames(folder: Path) -> tuple[list[str], np.ndarray]:
    """Names and grey uint8 frames (frames, height, width) of a folder of images, in the order of their numbers.

    Colour is turned to grey. Raises FramesError or leakloc's ClipError naming the image that is unreadable, of more
    than 8 bit or of another size than the first.
    """
    paths = image_paths(folder)
    frames: list[np.ndarray] = []
    with ThreadPoolExecutor(2) as threads:
        for path, frame in zip(paths, threads.map(_read_frame, paths), strict=True):
            if frames and frame.shape != frames[0].shape:
                raise FramesError(
                    f"{path}: must be as large as the first, {_size(frames[0])} px, got {_size(frame)} px"
                )
            frames.append(frame)
            if len(frames) * frame.size > MAX_PIXELS:
                raise FramesError(f"{folder}: images of more than {MAX_PIXELS:.3g} px together")
    return [path.name for path in paths], np.stack(frames)


def _cameras(source: Path) -> list[str]:
    """Return the folders of frames in `source`: both views of a clip, whose images are checked, or itself."""
    there = [side for side in ESTIMATORS_FOLDERS if (source / side).is_dir()]
    if not there:
        return [""]
    if len(there) < len(ESTIMATORS_FOLDERS):
        raise FramesError(f"{source}: must hold left/ and right/, or images themselves; got {there[0]}/ alone")
    if has_manifest(source):
        verify_input(source)
    return there


def _copied(path: Path) -> bytes:
    try:
        return read_regular_file(path, MAX_INPUT_BYTES)
    except ValueError as error:
        raise FramesError(f"{path}: {error}") from None


def _check_hits(field: GammaField, sensor: Sensor, exposure_s: float, frames: np.ndarray) -> None:
    rate = field.dose_rate_at(0.0)
    n_hits = most_hits(rate * exposure_s * len(frames) / 3600.0, sensor.pitch_um, frames.shape[1:])
    if n_hits > MAX_HITS:
        raise FramesError(f"{rate:g} Gy/h makes up to {n_hits:.2g} hits a camera, more than {MAX_HITS:.2g}")


def _read_frame(path: Path) -> np.ndarray:
    try:
        frame = read_grey_image(path)
    except ValueError as error:
        raise FramesError(f"{path}: {error}") from None
    if frame.dtype != np.uint8:
        raise FramesError(f"{path}: must have 8 bit, got {8 * frame.itemsize}")
    return frame


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
