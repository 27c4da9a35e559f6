"""Mistakes in a TOML file: all of them at once, each a line with file, key, value, rule and a "did you mean"."""

import difflib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Generic, TypeVar

from pydantic import BaseModel, ValidationError

SHOWN_VALUE_CHARS = 60
MAX_LINES = 50
"""Of one file: who made more mistakes meant something else."""

ROW_ERRORS = {"missing", "union_tag_invalid", "union_tag_not_found", "model_type", "model_attributes_type"}

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

Content = TypeVar("Content", bound=BaseModel)


@dataclass(frozen=True)
class Violation:
    """One broken rule between values: the key to blame, its value, the rule, and every key that the rule reads."""

    key: str
    value: object
    rule: str
    reads: tuple[str, ...]


@dataclass(frozen=True)
class FileRules(Generic[Content]):
    """What a kind of file may hold: its model, the rules between values, and faultless rows of its lists, by key."""

    model: type[Content]
    violations: Callable[[Content], Sequence[Violation]]
    faultless_rows: Mapping[str, dict[str, Any]] = field(default_factory=dict)


def checked(data: dict[str, Any], source: str, rules: FileRules[Content]) -> tuple[Content | None, list[str]]:
    """Return the content of parsed data and the lines of its mistakes; of more than 50, the first ones and how many.

    With mistakes the content is that of the good keys alone, or None where nothing is left to go on with.
    """
    lines: list[str] = []
    bad_keys: set[str] = set()
    content: Content | None
    try:
        content = rules.model.model_validate(data)
    except ValidationError as error:
        details = error.errors(include_url=False)
        if len(details) > MAX_LINES:
            lines = [_line(source, detail, rules.model) for detail in details[:MAX_LINES]]
            return None, [*lines, _more(source, len(details) - MAX_LINES)]
        lines = [_line(source, detail, rules.model) for detail in details]
        bad_keys = {_key(detail["loc"]) for detail in details}
        content = _without(data, details, rules)
    if content is not None:
        lines += [
            f"{source}: {broken.key}: {broken.rule}, got {shown(broken.value)}"
            for broken in rules.violations(content)
            if not _touches(broken.reads, bad_keys)
        ]
    return content, capped(lines, source)


def nearest(word: str, known: Sequence[str]) -> str:
    """Return '; did you mean "..."?' with the known word most like this one, or nothing."""
    close = difflib.get_close_matches(word[:SHOWN_VALUE_CHARS], known, n=1, cutoff=0.5)
    return f'; did you mean "{close[0]}"?' if close else ""


def shown(value: object) -> str:
    """A value as a line of text shows it, and no more of a long one is looked at."""
    text = repr(value[:SHOWN_VALUE_CHARS] if isinstance(value, str | list | tuple) else value)
    cut = isinstance(value, str | list | tuple) and len(value) > SHOWN_VALUE_CHARS
    return text if len(text) <= SHOWN_VALUE_CHARS and not cut else f"{text[: SHOWN_VALUE_CHARS - 3]}..."


def capped(lines: list[str], source: str) -> list[str]:
    """As many lines as a person reads, and how many were left out."""
    return [*lines[:MAX_LINES], _more(source, len(lines) - MAX_LINES)] if len(lines) > MAX_LINES else lines


def _more(source: str, n_left_out: int) -> str:
    return f"{source}: and {n_left_out} more mistakes"


def _line(source: str, detail: Any, root: type[BaseModel]) -> str:
    key, kind, value = _key(detail["loc"]), detail["type"], detail["input"]
    if kind == "missing":
        return f"{source}: {key} is required"
    if kind == "extra_forbidden":
        hint = nearest(str(detail["loc"][-1]), _known_keys(root, detail["loc"][:-1]))
        return f"{source}: {key} is not a known key{hint} (value {shown(value)})"
    return f"{source}: {key} {_rule(kind, detail)}, got {shown(value)}"


def _rule(kind: str, detail: Any) -> str:
    context = detail.get("ctx", {})
    for bound, sign in (("gt", ">"), ("ge", ">="), ("lt", "<"), ("le", "<=")):
        if bound in context:
            return f"must be {sign} {_bound(context[bound])}"
    if kind == "union_tag_invalid":
        return f"must have a kind of {context['expected_tags']}"
    if kind == "union_tag_not_found":
        return "must have a key kind"
    if kind == "value_error":
        return str(context["error"])
    if kind == "literal_error":
        return f"must be {context['expected']}"
    if kind in ("too_long", "string_too_long"):
        return f"must have at most {context['max_length']} entries"
    if kind in ("too_short", "string_too_short"):
        return f"must have at least {context['min_length']} entries"
    return TYPE_RULES.get(kind, f"is refused ({detail['msg']})")


def _bound(value: float) -> str:
    return str(value) if isinstance(value, int) else f"{value:g}"


def _known_keys(root: type[BaseModel], location: Sequence[int | str]) -> list[str]:
    """Keys of the table at a location of a file's models."""
    models: list[type[BaseModel]] = [root]
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


def _without(data: dict[str, Any], details: Sequence[Any], rules: FileRules[Content]) -> Content | None:
    """Return the content with its bad keys left out, so that rules between the good ones can be checked too.

    A row of a list that lacks something is replaced whole, so that the others keep their numbers. Where that is not
    enough, for the row cannot be without the bad key, every row with a bad key is.
    """
    places = [detail["loc"] for detail in details]
    keys = [
        _row(place) if detail["type"] in ROW_ERRORS else place for place, detail in zip(places, details, strict=True)
    ]
    rows = [_row(place) if place[0] in rules.faultless_rows else place[:1] for place in places]
    for bad in (keys, rows):
        good = _copied(data)
        for place in bad:
            _leave_out(good, place, rules.faultless_rows)
        try:
            return rules.model.model_validate(good)
        except ValidationError:
            continue
    return None


def _row(location: tuple[int | str, ...]) -> tuple[int | str, ...]:
    """Location of the row that a location is in, or the location itself outside of rows."""
    return location[:2] if len(location) > 1 and isinstance(location[1], int) else location


def _leave_out(data: Any, location: Sequence[int | str], faultless_rows: Mapping[str, dict[str, Any]]) -> None:
    """Take what stands at a location out of parsed data: a key; or a row, in whose place one without fault is put."""
    here = data
    try:
        for part in location[:-1]:
            here = here[part]
        if isinstance(here, dict):
            here.pop(location[-1], None)
        elif isinstance(here, list):
            here[int(location[-1])] = _copied(faultless_rows.get(str(location[0])))  # what follows may leave out of it
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
    return shown_key([part for i, part in enumerate(location) if not (i == 2 and location[0] == "structure")])


def shown_key(location: Sequence[int | str]) -> str:
    """A key as a line of text shows it."""
    return ".".join(_plain(str(part)) for part in location)


def _plain(part: str) -> str:
    """A part of a key as a line of text shows it: TOML allows any text in quotes, line ends and all."""
    return part if part.isprintable() and len(part) <= SHOWN_VALUE_CHARS else shown(part)
