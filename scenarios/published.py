"""What the paper published of its method, to be put beside what this tool finds."""

from dataclasses import dataclass

SOURCE = (
    'R. Komatsu et al., "Leakage Position Estimation of Cooling Water Using a Stereo Camera for Fukushima Daiichi '
    'Nuclear Power Plant", Applied Sciences, 2021'
)
LEVELS_GY_H = {"L": 1.7, "M": 3.3, "H": 10.0}
"""The paper's levels of noise: H is about 10 Gy/h, M 33 % and L 17 % of it."""


@dataclass(frozen=True)
class Published:
    """One row of the paper's tables: leaks found out of all, and mean and standard deviation of their errors, m."""

    table: str
    experiment: str
    setting: str
    found: int
    of: int
    mean_error_m: float
    sd_error_m: float


PUBLISHED = (
    Published("Tables 2, 3", "separated", "L", 26, 30, 0.22, 0.25),
    Published("Tables 2, 3", "separated", "M", 26, 30, 0.22, 0.24),
    Published("Tables 2, 3", "separated", "H", 26, 30, 0.22, 0.23),
    Published("Table 4", "frames", "3 frames", 27, 30, 0.37, 0.78),
    Published("Table 4", "frames", "6 frames", 27, 30, 0.36, 0.84),
    Published("Table 4", "frames", "12 frames", 27, 30, 0.34, 0.67),
    Published("Table 4", "frames", "18 frames", 26, 30, 0.22, 0.24),
    Published("Table 4", "frames", "24 frames", 26, 30, 0.22, 0.23),
    Published("Table 5", "crowded", "L", 22, 24, 0.05, 0.05),
    Published("Table 5", "crowded", "M", 22, 24, 0.05, 0.06),
    Published("Table 5", "crowded", "H", 22, 24, 0.06, 0.07),
)


def published(experiment: str, setting: str) -> Published | None:
    """Return the paper's row of an experiment at a setting, or None where it gives no number."""
    return next((row for row in PUBLISHED if (row.experiment, row.setting) == (experiment, setting)), None)
