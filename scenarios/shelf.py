"""Shelves: files of one kind; some are shipped, each by its name, the others stand anywhere, each by its path."""

import difflib
import tomllib
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any

MAX_FILE_BYTES = 1_000_000


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
        if name in self.names() and not path.is_file():
            return f"{name} (shipped)", (self._shipped() / f"{name}.toml").read_text(encoding="utf-8")
        if not path.exists():
            close = difflib.get_close_matches(name, self.names(), n=1)
            hint = f'; did you mean "{close[0]}"?' if close else f"; shipped {self.kind}s: {', '.join(self.names())}"
            raise self.error(f"{name}: no such file or shipped {self.kind}{hint}")
        if not path.is_file():
            raise self.error(f"{name}: must be a regular file")
        if path.stat().st_size > MAX_FILE_BYTES:
            raise self.error(f"{name}: must be at most {MAX_FILE_BYTES} bytes, got {path.stat().st_size}")
        try:
            return name, path.read_text(encoding="utf-8")
        except UnicodeDecodeError as error:
            raise self.error(f"{name}: must be UTF-8 text: byte {error.start} is not") from None
        except OSError as error:
            raise self.error(f"{name}: cannot be read: {error.strerror}") from None

    def parsed(self, text: str, source: str) -> dict[str, Any]:
        """Parse TOML; a syntax error names the source, line and column."""
        try:
            return tomllib.loads(text)
        except tomllib.TOMLDecodeError as error:
            raise self.error(f"{source}: not valid TOML: {error}") from None
        except RecursionError:
            raise self.error(f"{source}: not valid TOML: nested too deeply") from None

    def _shipped(self) -> Any:
        return files("scenarios") / self.folder
