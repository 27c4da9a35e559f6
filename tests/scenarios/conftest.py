"""Make small campaigns and other people's estimators importable by their names, here and in worker processes."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
