"""Read scenario files: TOML in, a frozen scenario or *all* of its mistakes out, each with file, key, value and rule."""

import difflib
import re
import tomllib
from collections.abc import Iterator, Sequence
from importlib.resources import files
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ValidationError

from scenarios.rules import violations
from scenarios.scenario import Scenario
from scenarios.space import scene_of

MAX_FILE_BYTES = 1_000_000
SHOWN_VALUE_CHARS = 60
BENCH_SCENE = re.compile(r"(?P<stratum>easy|nominal|hard):(?P<number>\d{1,5})(:(?P<seed>\d{1,9}))?")

ROW_ERRORS = {"missing", "union_tag_invalid", "union_tag_not_found", "model_type", "model_attributes_type"}

FAULTLESS_ROWS: dict[str, dict[str, Any]] = {
    "lamp": {},
    "leak": {"x_m": 0.0, "y_m": 0.0},
    "structure": {"kind": "box", "centre_m": [0.0, 0.0, 0.0], "size_m": [0.1, 0.1, 0.1]},
}

TYPE_RULES = {
    "float_type": "must be a number",
    "int_type": "must be a whole number",
    "int_from_float": "must be a whole number",
    "finite_number": "must be finite",
    "string_type": "must be a text in quotes",
    "tuple_type": "must be a list",
    "model_type": "must be a table",
    "model_attributes_type": "must be a table",
    "dict_type": "must be a table",
    "missing": "is required",
}


class ScenarioError(ValueError):
    """A scenario that cannot be used; the message has one line a mistake."""


def library_names() -> list[str]:
    """Names of the shipped scenarios."""
    return sorted(entry.name[:-5] for entry in _library().iterdir() if entry.name.endswith(".toml"))


def read_scenario(path_or_name: str | Path, overrides: Sequence[str] = (), seed: int | None = None) -> Scenario:
    """Read a scenario file, a shipped scenario by its name or a scene of the bench, with `key.path=value` overrides.

    A scene of the bench is `stratum:number`, or `stratum:number:seed` of another run than seed 0. A path wins over a
    name only when such a file exists. Raises ScenarioError with all mistakes.
    """
    source, data = _data_of(path_or_name)
    mistakes = [mistake for override in overrides if (mistake := _mistake_in(override, data))]
    if seed is not None:
        data["seed"] = seed
    try:
        scenario = validated(data, source)
    except ScenarioError as error:
        raise ScenarioError("\n".join([*mistakes, str(error)])) from None
    if mistakes:
        raise ScenarioError("\n".join(mistakes))
    return scenario.model_copy(update={"structure": tuple(_at_home(table, source) for table in scenario.structure)})


def parse_toml(text: str, source: str) -> dict[str, Any]:
    """Parse TOML; a syntax error names the source, line and column."""
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise ScenarioError(f"{source}: not valid TOML: {error}") from None
    except RecursionError:
        raise ScenarioError(f"{source}: not valid TOML: nested too deeply") from None


def validated(data: dict[str, Any], source: str) -> Scenario:
    """Turn parsed data into a scenario, or raise ScenarioError with every broken rule."""
    lines: list[str] = []
    bad_keys: set[str] = set()
    scenario: Scenario | None
    try:
        scenario = Scenario.model_validate(data)
    except ValidationError as error:
        details = error.errors(include_url=False)
        lines = [_line(source, detail) for detail in details]
        bad_keys = {_key(detail["loc"]) for detail in details}
        scenario = _without(data, details)
    if scenario is not None:
        lines += [
            f"{source}: {broken.key}: {broken.rule}, got {_shown(broken.value)}"
            for broken in violations(scenario)
            if not _touches(broken.reads, bad_keys)
        ]
    if lines:
        raise ScenarioError("\n".join(lines))
    assert scenario is not None
    return scenario


def _library() -> Any:
    return files("scenarios") / "library"


def _data_of(path_or_name: str | Path) -> tuple[str, dict[str, Any]]:
    name = str(path_or_name)
    if not Path(name).exists() and (place := BENCH_SCENE.fullmatch(name)):
        return name, scene_of(place["stratum"], int(place["number"]), int(place["seed"] or 0)).model_dump(
            mode="json", exclude_none=True
        )
    source, text = _text_of(path_or_name)
    return source, parse_toml(text, source)


def _text_of(path_or_name: str | Path) -> tuple[str, str]:
    path = Path(path_or_name)
    name = str(path_or_name)
    if not path.exists():
        if name in library_names():
            return f"{name} (shipped)", (_library() / f"{name}.toml").read_text(encoding="utf-8")
        close = difflib.get_close_matches(name, library_names(), n=1)
        hint = f'; did you mean "{close[0]}"?' if close else f"; shipped scenarios: {', '.join(library_names())}"
        raise ScenarioError(f"{name}: no such file or shipped scenario{hint}")
    if not path.is_file():
        if path.is_dir() and name in library_names():
            return f"{name} (shipped)", (_library() / f"{name}.toml").read_text(encoding="utf-8")
        raise ScenarioError(f"{name}: must be a regular file")
    if path.stat().st_size > MAX_FILE_BYTES:
        raise ScenarioError(f"{name}: must be at most {MAX_FILE_BYTES} bytes, got {path.stat().st_size}")
    try:
        return name, path.read_text(encoding="utf-8")
    except UnicodeDecodeError as error:
        raise ScenarioError(f"{name}: must be UTF-8 text: byte {error.start} is not") from None
    except OSError as error:
        raise ScenarioError(f"{name}: cannot be read: {error.strerror}") from None


def _at_home(table: Any, source: str) -> Any:
    """A relative mesh path starts at the scenario file."""
    return table.model_copy(update={"path": str(Path(source).parent / table.path)}) if table.kind == "mesh" else table


def _mistake_in(override: str, data: dict[str, Any]) -> str | None:
    """Apply an override; returns what is wrong with it, or None."""
    try:
        _apply(override, data)
    except ScenarioError as error:
        return str(error)
    return None


def _apply(override: str, data: dict[str, Any]) -> None:
    """Set one `a.b.0.c=value` in parsed data; the value is TOML, or else a plain text."""
    key, equals, text = override.partition("=")
    parts = key.strip().split(".")
    if not equals or not all(parts):
        raise ScenarioError(f"--set {override}: must have the form key.path=value")
    if "\n" in text:
        raise ScenarioError(f"--set {key}: must be one line")
    try:
        value = tomllib.loads(f"value = {text}")["value"]
    except (tomllib.TOMLDecodeError, RecursionError):
        value = text.strip()
    here: Any = data
    if len(parts) > 1 and parts[1].isdecimal() and parts[0] in Scenario.model_fields:
        data.setdefault(parts[0], Scenario().model_dump(mode="json", exclude_none=True)[parts[0]])
    for i, part in enumerate(parts[:-1]):
        here = here.setdefault(part, {}) if isinstance(here, dict) else _item(here, part, f"--set {override}")
        if not isinstance(here, dict | list):
            raise ScenarioError(f"--set {override}: {'.'.join(parts[: i + 1])} must be a table to have keys in it")
    if isinstance(here, dict):
        here[parts[-1]] = value
    else:
        here[_index(here, parts[-1], f"--set {override}")] = value


def _item(rows: list[Any], part: str, who: str) -> Any:
    return rows[_index(rows, part, who)]


def _index(rows: list[Any], part: str, who: str) -> int:
    if not (part.isdecimal() and int(part) < len(rows)):
        raise ScenarioError(f"{who}: {part!r} must be an index below {len(rows)}")
    return int(part)


def _line(source: str, detail: Any) -> str:
    key, kind, value = _key(detail["loc"]), detail["type"], detail["input"]
    if kind == "missing":
        return f"{source}: {key} is required"
    if kind == "extra_forbidden":
        close = difflib.get_close_matches(str(detail["loc"][-1]), _known_keys(detail["loc"][:-1]), n=1, cutoff=0.5)
        hint = f'; did you mean "{close[0]}"?' if close else ""
        return f"{source}: {key} is not a known key{hint} (value {_shown(value)})"
    return f"{source}: {key} {_rule(kind, detail)}, got {_shown(value)}"


def _rule(kind: str, detail: Any) -> str:
    context = detail.get("ctx", {})
    for bound, sign in (("gt", ">"), ("ge", ">="), ("lt", "<"), ("le", "<=")):
        if bound in context:
            return f"must be {sign} {_bound(context[bound])}"
    if kind == "union_tag_invalid":
        return f"must have a kind of {context['expected_tags']}"
    if kind == "union_tag_not_found":
        return "must have a key kind"
    if kind == "literal_error":
        return f"must be {context['expected']}"
    if kind in ("too_long", "string_too_long"):
        return f"must have at most {context['max_length']} entries"
    return TYPE_RULES.get(kind, f"is refused ({detail['msg']})")


def _bound(value: float) -> str:
    return str(value) if isinstance(value, int) else f"{value:g}"


def _known_keys(location: Sequence[int | str]) -> list[str]:
    """Keys of the table at a location of the scenario's models."""
    models: list[type[BaseModel]] = [Scenario]
    for part in location:
        if isinstance(part, int):
            continue
        kinds = [model for model in models if part in _kinds(model)]
        fields = [model.model_fields[part] for model in models if part in model.model_fields]
        models = kinds or [inner for field in fields for inner in _models_in(field.annotation)]
    return sorted({name for model in models for name in model.model_fields})


def _kinds(model: type[BaseModel]) -> tuple[str, ...]:
    """Values of `kind` that choose this model among those that may stand in one place."""
    field = model.model_fields.get("kind")
    return getattr(field.annotation, "__args__", ()) if field else ()


def _models_in(annotation: Any) -> Iterator[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    for part in getattr(annotation, "__args__", ()):
        yield from _models_in(part)


def _without(data: dict[str, Any], details: Sequence[Any]) -> Scenario | None:
    """Return the scenario with its bad keys left out, so that rules between the good ones can be checked too.

    A row of a list that lacks something is replaced whole, so that the others keep their numbers.
    """
    good = _copied(data)
    for detail in details:
        location = detail["loc"]
        if len(location) > 1 and isinstance(location[1], int) and detail["type"] in ROW_ERRORS:
            _leave_out(good, location[:2])
        else:
            _leave_out(good, location)
    try:
        return Scenario.model_validate(good)
    except ValidationError:
        return None


def _leave_out(data: Any, location: Sequence[int | str]) -> None:
    """Take what stands at a location out of parsed data: a key; or a row, in whose place one without fault is put."""
    here = data
    try:
        for part in location[:-1]:
            here = here[part]
        if isinstance(here, dict):
            here.pop(location[-1], None)
        elif isinstance(here, list):
            here[int(location[-1])] = FAULTLESS_ROWS.get(str(location[0]))
    except (KeyError, IndexError, TypeError):
        return


def _copied(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _copied(item) for key, item in value.items()}
    return [_copied(item) for item in value] if isinstance(value, list) else value


def _touches(reads: Sequence[str], bad_keys: set[str]) -> bool:
    return any(
        key == bad or key.startswith(f"{bad}.") or bad.startswith(f"{key}.") for key in reads for bad in bad_keys
    )


def _key(location: Sequence[int | str]) -> str:
    """Key as it stands in the file: pydantic puts a structure's kind between its number and its field."""
    parts = [part for i, part in enumerate(location) if not (i == 2 and location[0] == "structure")]
    return ".".join(str(part) for part in parts)


def _shown(value: object) -> str:
    text = repr(value)
    return text if len(text) <= SHOWN_VALUE_CHARS else f"{text[: SHOWN_VALUE_CHARS - 3]}..."
