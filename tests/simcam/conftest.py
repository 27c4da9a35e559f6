"""Make the brute-force renderer and the reference measures importable by their names."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
