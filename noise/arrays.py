"""Names of array types: `Array` holds real numbers, `Frames` unsigned grey values."""

from typing import Any

from numpy.typing import NDArray

Array = NDArray[Any]
Frames = NDArray[Any]
