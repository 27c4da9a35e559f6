"""YAML of calibrations that others write (ROS, Kalibr): mappings of numbers and words, and nothing that can grow."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray

from leakloc.outside_file import check_depth
from leakloc.rig import RigError

MAX_YAML_CHARACTERS = 1 << 16  # a calibration has about 2000; the parser takes a second for this many


LAST_MARK = re.compile(r"\n(---|\.\.\.)\s*\Z")
"""What ROS's command line ends a message with: the mark of another document, which does not come."""


class _Loader(yaml.SafeLoader):
    """Plain data only, and nothing named once to be repeated: repeats of repeats grow without bound.

    Nor is a value read that says what it is: the parser believes a "!!int" of no digits, and stumbles.
    """

    def compose_node(self, parent: yaml.Node | None, index: Any) -> yaml.Node | None:
        if self.check_event(yaml.AliasEvent):
            raise yaml.YAMLError("aliases are not read")
        if getattr(self.peek_event(), "tag", None) is not None:
            raise yaml.YAMLError("tags are not read")
        return super().compose_node(parent, index)


def load_mapping(text: str) -> dict[str, Any]:
    """The mapping that a YAML text holds. Raises RigError with what is wrong, without the file's name."""
    if len(text) > MAX_YAML_CHARACTERS:
        raise RigError(f"must have at most {MAX_YAML_CHARACTERS} characters, got {len(text)}")
    try:
        content = yaml.load(LAST_MARK.sub("\n", text), _Loader)  # a SafeLoader
    except RecursionError:
        raise RigError("not YAML: nested too deeply") from None
    except (yaml.YAMLError, ValueError, TypeError) as error:  # the last two: odd numbers, odd keys
        reason = str(getattr(error, "problem", None) or error)
        raise RigError(f"not YAML: {reason[:200]}".replace("\n", " ")) from None
    if not isinstance(content, dict):
        raise RigError("must be YAML with keys at the top")
    try:
        check_depth(content)
    except ValueError as error:
        raise RigError(str(error)) from None
    return content


def need(mapping: dict[str, Any], *names: str) -> Any:
    """The value under the first of these names that is there. Raises RigError if none is."""
    for name in names:
        if name in mapping:
            return mapping[name]
    raise RigError(
        f"{' or '.join(names)} must be given, got only {', '.join(map(str, list(mapping)[:20])) or 'nothing'}"
    )


def numbers(key: str, value: Any) -> NDArray[np.float64]:
    """A list of numbers, or of lists of them; "1e-05" is a word to YAML 1.1 and a number here. Raises RigError."""
    try:
        found = np.array(value, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        raise RigError(f"{key} must be numbers, got {str(value)[:80]}") from None
    if isinstance(value, str | bool) or found.ndim == 0 or not np.isfinite(found).all():
        raise RigError(f"{key} must be a list of finite numbers, got {str(value)[:80]}")
    return found


def shaped(key: str, value: Any, *shape: int) -> NDArray[np.float64]:
    """As `numbers`, with as many entries as the shape has, flat or in rows. Raises RigError."""
    found = numbers(key, value)
    if found.size != np.prod(shape):
        raise RigError(f"{key} must have {int(np.prod(shape))} numbers, got {found.size}")
    return found.reshape(shape)
