"""Progress of a hunt: how much of its time or its scenes is spent, and what was met."""

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from tqdm import tqdm

from scenarios.atlas import Tried
from scenarios.failures import failures
from scenarios.progress import SECONDS_BETWEEN_LINES


@contextmanager
def hunting(n_scenes: int | None, budget_s: float | None) -> Iterator[Callable[[Tried], None]]:
    """Yield a function that is told every scene tried; a bar on a terminal, a line now and then elsewhere."""
    start_s = time.monotonic()
    met: dict[str, None] = {}
    done, last_s = 0, start_s
    bar = None
    if sys.stderr.isatty():
        form = "{desc} |{bar}| {percentage:3.0f} % {elapsed}, {postfix}"
        bar = tqdm(total=1.0, desc="hunting", bar_format=form, dynamic_ncols=True)

    def share() -> float:
        of_time = 0.0 if budget_s is None else (time.monotonic() - start_s) / budget_s
        return min(max(of_time, 0.0 if n_scenes is None else done / n_scenes), 1.0)

    def tell(tried: Tried) -> None:
        nonlocal done, last_s
        done += 1
        met.update(dict.fromkeys(sorted(failure.code for failure in failures(tried.run))))
        words = f"{done} scenes, {', '.join(met) or 'nothing wrong yet'}"
        if bar is not None:
            bar.set_postfix_str(words, refresh=False)
            bar.update(share() - bar.n)
        elif time.monotonic() - last_s >= SECONDS_BETWEEN_LINES:
            last_s = time.monotonic()
            print(f"hunting: {100 * share():.0f} %, {words}", file=sys.stderr, flush=True)  # noqa: T201

    try:
        yield tell
    finally:
        if bar is not None:
            bar.close()
