"""Damage to texts and bytes, drawn by a random generator: what slips of the keyboard, disks and enemies do."""

import random
import re

ODD_VALUES = (
    *(
        "nan",
        "inf",
        "-inf",
        "1e308",
        "-1e308",
        "1e-320",
        "-0.0",
        "0",
        "-1",
        "1",
        "true",
        '""',
        '"x"',
        "[]",
        "{}",
        "[[]]",
    ),
    *("9223372036854775808", "-9223372036854775809", "9" * 5000, "0x" + "f" * 5000, "1_0", "1e999", "1979-05-27"),
    *("07:32:00", "[1, 2]", "[1.0, 2.0, 3.0]", "[nan, 0.0, 0.0]", "{ a = 1 }", "[" * 60 + "]" * 60, "[" * 5000),
    *('"\\u0000"', '"\\u001b[31m"', '"../../../etc/passwd"', '"/dev/zero"', "'''", '"""', "[{}, {}]", "[[], 1]", "2e9"),
    *("{" * 50 + "}" * 50, "0.0001", "1e-9", "100.0", "99.0", "null", "None", "0b1", "0o7", "1.", ".5", "+1", '"é"'),
)
ODD_LINES = (
    *(
        "[rig]",
        "[[leak]]",
        "[[lamp]]",
        "[[structure]]",
        "[layout]",
        "[gamma]",
        "[",
        "]",
        "=",
        "= 1",
        "a",
        "a =",
        "[a.b]",
    ),
    *(
        "a" + ".a" * 40 + " = 1",
        "[" + ".".join(["a"] * 40) + "]",
        '"\\u0000" = 1',
        "'' = 1",
        "[[a]]",
        "seed = 1",
        "x = 1",
    ),
    *(
        '[[structure]]\nkind = "mesh"\npath = "../../../dev/zero"',
        '[[structure]]\nkind = "box"',
        "\ufeff",
        "\x00",
        "\x7f",
    ),
    *("# \x1b[2J", "leak = []", "lamp = 3", "rig = []", "rig.rig = 1", "[rig.rig]", "set = ['a=1']", "methods = ['x']"),
)
ODD_BYTES = (
    b"\x00",
    b"\xff",
    b"\xfe\xff",
    b"\xef\xbb\xbf",
    b"\r",
    b"\x1b[2J",
    b"\xc0\x80",
    b"\xed\xa0\x80",
    b"\n" * 50,
)

NUMBER = re.compile(r"(?<![\w.])-?\d+(\.\d+)?(e-?\d+)?(?![\w.])")
WORD = re.compile(r"[A-Za-z_]\w*")


def damaged_text(text: str, rng: random.Random) -> bytes:
    """A text with one to three slips in it, as bytes."""
    for _ in range(rng.choice((1, 1, 1, 2, 3))):
        text = rng.choice(TEXT_SLIPS)(text, rng)
    raw = text.encode("utf-8", "surrogatepass")
    return damaged_bytes(raw, rng) if rng.random() < 0.2 else raw


def damaged_bytes(raw: bytes, rng: random.Random) -> bytes:
    """Bytes with a flipped, lost, doubled, moved or foreign part, or cut short."""
    if not raw:
        return rng.choice(ODD_BYTES)
    at, length = rng.randrange(len(raw)), rng.choice((1, 1, 2, 8, 64, 1000))
    part = raw[at : at + length]
    kind = rng.randrange(9)
    if kind == 0:
        return raw[:at] + bytes([raw[at] ^ (1 << rng.randrange(8))]) + raw[at + 1 :]
    if kind == 1:
        return raw[:at]
    if kind == 2:
        return raw[:at] + raw[at + length :]
    if kind == 3:
        return raw[:at] + part + raw[at:]
    if kind == 4:
        return raw[:at] + bytes(len(part)) + raw[at + length :]
    if kind == 5:
        return raw[:at] + rng.choice(ODD_BYTES) + raw[at:]
    if kind == 6:
        return raw[:at] + rng.randbytes(len(part)) + raw[at + length :]
    if kind == 7:
        to = rng.randrange(len(raw))
        return raw[:to] + part + raw[to + length :]
    return raw + rng.choice((raw, part, rng.randbytes(length)))


def _value(text, rng):
    """Another value for a number."""
    found = list(NUMBER.finditer(text))
    if not found:
        return text
    number = rng.choice(found)
    other = (
        rng.choice(ODD_VALUES) if rng.random() < 0.7 else repr(float(number[0]) * rng.choice((-1, 0.1, 0.9, 1.1, 3)))
    )
    return text[: number.start()] + other + text[number.end() :]


def _word(text, rng):
    """A word in the place of another, or misspelt."""
    found = list(WORD.finditer(text))
    if not found:
        return text
    word = rng.choice(found)
    other = rng.choice(found)[0] if rng.random() < 0.6 else word[0][:-1] + rng.choice("axz_9")
    return text[: word.start()] + other + text[word.end() :]


def _line(text, rng):
    """A line lost, doubled, moved or foreign."""
    lines = text.split("\n")
    at = rng.randrange(len(lines))
    kind = rng.randrange(5)
    if kind == 0:
        del lines[at]
    elif kind == 1:
        lines.insert(at, rng.choice(lines))
    elif kind == 2:
        lines.insert(rng.randrange(len(lines)), lines.pop(at))
    elif kind == 3:
        lines.insert(at, rng.choice(ODD_LINES))
    else:
        lines[at:at] = [lines[at]] * rng.choice((2, 50, 300))
    return "\n".join(lines)


def _character(text, rng):
    """A character lost, doubled or foreign."""
    if not text:
        return text
    at = rng.randrange(len(text))
    return (
        text[:at] + rng.choice(("", text[at] * 2, rng.choice("[]{}=\"'.,#-0é\t\x00"))) + text[at + rng.randrange(2) :]
    )


TEXT_SLIPS = (_value, _value, _value, _word, _word, _line, _line, _character)
