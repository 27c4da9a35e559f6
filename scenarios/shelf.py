"""Shelves: files of one kind; some are shipped, each by its name, the others stand anywhere, each by its path."""

import difflib
import os
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any

from leakloc.outside_file import read_regular_file
from scenarios.toml_text import parse_toml

MAX_FILE_BYTES = 1_000_000
MAX_NAME = 100


@dataclass(frozen=True)
class Shelf:
    """Shipped files of one kind ("scenario"), their folder in this package, and the error of a file that is bad."""

    kind: str
    folder: str
    error: type[ValueError]

    def names(self) -> list[str]:
        """Names of the shipped files."""
        return sorted(entry.name[:-5] for entry in self._shipped().iterdir() if entry.name.endswith(".toml"))

    def text_of(self, path_or_name: str | Path) -> tuple[str, str]:
        """Return what to call the file in messages, and its text; a path wins over a name when it exists.

        Raises the shelf's error where there is no such file or name, or what is there is no text of a sane size.
        """
        path, name = Path(path_or_name), str(path_or_name)
        if name in self.names() and not os.path.isfile(path):
            return f"{name} (shipped)", (self._shipped() / f"{name}.toml").read_text(encoding="utf-8")
        if not os.path.lexists(path):
            close = difflib.get_close_matches(name[:MAX_NAME], self.names(), n=1)
            hint = f'; did you mean "{close[0]}"?' if close else f"; shipped {self.kind}s: {', '.join(self.names())}"
            raise self.error(f"{name}: no such file or shipped {self.kind}{hint}")
        try:
            return name, read_regular_file(path, MAX_FILE_BYTES).decode("utf-8")
        except UnicodeDecodeError as error:
            raise self.error(f"{name}: must be UTF-8 text: byte {error.start} is not") from None
        except ValueError as error:
            raise self.error(f"{name}: {error}") from None

    def parsed(self, text: str, source: str) -> dict[str, Any]:
        """Parse TOML; a syntax error names the source, line and column."""
        try:
            return parse_toml(text)
        except ValueError as error:
            raise self.error(f"{source}: {error}") from None

    def _shipped(self) -> Any:
        return files("scenarios") / self.folder
