"""Progress for people and for logs: a bar on a terminal, a plain line now and then elsewhere."""

import sys
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import TypeVar

from tqdm import tqdm

Item = TypeVar("Item")
SECONDS_BETWEEN_LINES = 10.0


def progress(items: Iterable[Item], what: str, total: int) -> Iterator[Item]:
    """Yield the items, showing how many are done, the rate and the time left on standard error."""
    if sys.stderr.isatty():
        yield from tqdm(items, desc=what, total=total, unit="", dynamic_ncols=True)
        return
    start_s = last_s = time.monotonic()
    for done, item in enumerate(items, 1):
        yield item
        now_s = time.monotonic()
        if now_s - last_s >= SECONDS_BETWEEN_LINES or done == total:
            last_s = now_s
            rate = done / max(now_s - start_s, 1e-9)
            left = f", {(total - done) / rate:.0f} s left" if done < total else ""
            print(f"{what}: {done} of {total}, {rate:.3g} / s{left}", file=sys.stderr, flush=True)  # noqa: T201


@contextmanager
def stages(what: str, n_stages: int) -> Iterator[Callable[[str], None]]:
    """Yield a function that is told the name of each stage as it begins."""
    if not sys.stderr.isatty():
        yield lambda name: print(f"{what}: {name}", file=sys.stderr, flush=True)  # noqa: T201
        return
    with tqdm(total=n_stages, desc=what, bar_format="{desc:<28} |{bar}| {n_fmt}/{total_fmt} {elapsed}") as bar:

        def begin(name: str) -> None:
            bar.set_description(name)
            bar.update(1)

        yield begin


def told_as_it_goes(items: Iterable[Item], what: str) -> Iterator[Item]:
    """Yield items whose number nobody knows before, showing how many there were."""
    if sys.stderr.isatty():
        yield from tqdm(items, desc=what, unit="", dynamic_ncols=True)
        return
    last_s = time.monotonic()
    for done, item in enumerate(items, 1):
        yield item
        if time.monotonic() - last_s >= SECONDS_BETWEEN_LINES:
            last_s = time.monotonic()
            print(f"{what}: {done}", file=sys.stderr, flush=True)  # noqa: T201


@contextmanager
def counting(what: str) -> Iterator[Callable[[int], object]]:
    """Yield a function that is told how many more are done; nobody knows how many there will be."""
    if sys.stderr.isatty():
        with tqdm(desc=what, unit="", dynamic_ncols=True) as bar:
            yield bar.update
        return
    done, last_s = 0, time.monotonic()

    def tell(n: int) -> None:
        nonlocal done, last_s
        done += n
        if time.monotonic() - last_s >= SECONDS_BETWEEN_LINES:
            last_s = time.monotonic()
            print(f"{what}: {done}", file=sys.stderr, flush=True)  # noqa: T201

    yield tell
