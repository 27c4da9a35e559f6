"""TOML from outside, parsed in bearable time and memory into data that any function may walk through."""

import re
import tomllib
from typing import Any

from leakloc.outside_file import MAX_DEPTH, check_depth

PART = r"""(?:[\w-]++|"[^"\n]*+"|'[^'\n]*+')"""
LONG_KEY = re.compile(rf"(?<![\w-]){PART}(?:[ \t]*\.[ \t]*{PART}){{{MAX_DEPTH}}}")
"""a.b.c ... of too many parts: a table in a table each, and the standard library's parser takes minutes for 1 MB."""

MAX_INTEGER = 2**63
MAX_ENTRIES = 150_000
"""Commas and lines of a text: the standard library's parser takes some 5 microseconds for each."""

KEY_LINE = re.compile(r"^[^\n=\"'#\[]*=", re.MULTILINE)
MAX_KEYS = 30_000
"""Lines with a key: one takes three times as long as a line with a number of a list."""


def parse_toml(text: str) -> dict[str, Any]:
    """Parse TOML; whole numbers must have 64 bit, as TOML says, and tables must not nest deeper than 32.

    At most MAX_ENTRIES commas and lines and MAX_KEYS keys. Raises ValueError with what is wrong and, for syntax, the
    line and column.
    """
    if (entries := text.count(",") + text.count("\n")) > MAX_ENTRIES:
        raise ValueError(f"must have at most {MAX_ENTRIES} commas and lines, got {entries}")
    if (keys := len(KEY_LINE.findall(text))) > MAX_KEYS:
        raise ValueError(f"must have at most {MAX_KEYS} keys, got {keys}")
    if LONG_KEY.search(text):
        raise ValueError(f"not valid TOML: a key must have at most {MAX_DEPTH} parts")
    try:
        data = tomllib.loads(text)
        check_depth(data)
    except tomllib.TOMLDecodeError as error:
        raise ValueError(f"not valid TOML: {error}") from None
    except RecursionError:
        raise ValueError("not valid TOML: nested too deeply") from None
    except ValueError as error:  # thousands of digits, or too deep
        raise ValueError(f"not valid TOML: {error}".partition(";")[0]) from None
    _check_integers(data)
    return data


def _check_integers(data: Any) -> None:
    if isinstance(data, dict | list):
        for inner in data.values() if isinstance(data, dict) else data:
            _check_integers(inner)
    elif isinstance(data, int) and not -MAX_INTEGER <= data < MAX_INTEGER:
        raise ValueError("not valid TOML: a whole number must have at most 64 bit")
