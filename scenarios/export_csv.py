"""The truth of a clip as CSV, a leak a row; undefined is empty, and shadow columns of several lamps share a cell."""

import csv
import io
from collections.abc import Sequence

from scenarios.truth import LeakTruth, Truth

COLUMNS = (
    *("id", "x_m", "y_m", "z_m", "left_column_px", "right_column_px", "left_shadow_columns_px"),
    *("right_shadow_columns_px", "in_view", "visible_fraction", "observable", "reason", "column_snr"),
)


def truth_csv(truth: Truth) -> str:
    """Return header and rows."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    writer.writerows(map(_row, truth.leaks))
    return text.getvalue()


def read_truth_csv(text: str) -> list[LeakTruth]:
    """Return the leaks of such a table; raises ValueError where it is none."""
    rows = list(csv.reader(io.StringIO(text)))
    if not rows or tuple(rows[0]) != COLUMNS:
        raise ValueError(f"header must be {','.join(COLUMNS)}")
    return [_leak(dict(zip(COLUMNS, row, strict=True))) for row in rows[1:]]


def _row(leak: LeakTruth) -> list[object]:
    shadows = leak.shadow_columns_px
    return [
        *(leak.id, leak.x_m, leak.y_m, leak.z_m, leak.left_column_px, leak.right_column_px),
        *(_joined(shadows.left), _joined(shadows.right)),
        *(int(leak.in_view), leak.visible_fraction, int(leak.observable), leak.reason, leak.column_snr),
    ]


def _leak(cells: dict[str, str]) -> LeakTruth:
    left, right = (cells.pop(f"{side}_shadow_columns_px") for side in ("left", "right"))
    content: dict[str, object] = {key: cell or None for key, cell in cells.items()}
    content["shadow_columns_px"] = {"left": _split(left), "right": _split(right)}
    return LeakTruth.model_validate(content, strict=False)


def _joined(columns: Sequence[float | None]) -> str:
    """Join columns by semicolons; a lamp without a shadow in view leaves a dash."""
    return ";".join("-" if column is None else str(column) for column in columns)


def _split(cell: str) -> tuple[float | None, ...]:
    return tuple(None if word == "-" else float(word) for word in cell.split(";")) if cell else ()
