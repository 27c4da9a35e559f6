"""A key for things by what they hold, so that equal scenes share one cached static layer."""

import hashlib
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import fields, is_dataclass
from threading import Lock
from typing import Any, Generic, TypeVar

import numpy as np

Value = TypeVar("Value")


def content_key(*things: Any) -> bytes:
    """Digest of dataclasses, tuples, arrays and plain values; equal content, equal key."""
    digest = hashlib.blake2b(digest_size=20)
    for thing in things:
        _feed(digest, thing)
    return digest.digest()


def _feed(digest: Any, thing: Any) -> None:
    digest.update(type(thing).__name__.encode())
    if is_dataclass(thing):
        for item in fields(thing):
            digest.update(item.name.encode())
            _feed(digest, getattr(thing, item.name))
    elif isinstance(thing, np.ndarray):
        digest.update(f"{thing.dtype.str}{thing.shape}".encode())
        digest.update(np.ascontiguousarray(thing).tobytes())
    elif isinstance(thing, (tuple, list)):
        digest.update(str(len(thing)).encode())
        for item in thing:
            _feed(digest, item)
    elif thing is None or isinstance(thing, (bool, int, float, str, np.number)):
        digest.update(repr(thing).encode())
    else:
        raise TypeError(f"content_key: no key for a {type(thing).__name__}")


class ContentCache(Generic[Value]):
    """The last few results by content, thread-safe; the oldest goes first."""

    def __init__(self, size: int) -> None:
        """Keep `size` results."""
        self._size, self._lock = size, Lock()
        self._kept: OrderedDict[bytes, Value] = OrderedDict()

    def get(self, key: bytes, make: Callable[[], Value]) -> Value:
        """The kept result under `key`, or a new one."""
        with self._lock:
            if key in self._kept:
                self._kept.move_to_end(key)
                return self._kept[key]
        made = make()
        with self._lock:
            self._kept[key] = made
            while len(self._kept) > self._size:
                self._kept.popitem(last=False)
        return made

    def clear(self) -> None:
        """Forget everything."""
        with self._lock:
            self._kept.clear()
