"""Where the leaks are: estimators that see frames and a believed rig, never the scene or the truth.

clip = read_clip("clip")
estimate = locate(clip.left, clip.right, clip.rig)
write_result(estimate, "result.json")
"""

from leakloc.calibration import read_calibration
from leakloc.clip import Clip, ClipError, read_clip
from leakloc.estimate import Estimate, LeakEstimate
from leakloc.footage import footage_size, read_footage
from leakloc.methods import METHODS, locate
from leakloc.paper import PaperOptions
from leakloc.rectify import Rectified, rectified_rig, rectify
from leakloc.result import ResultError, read_result, result_schema, write_result
from leakloc.rig import Rig, RigError
from leakloc.rig_file import read_rig, write_rig
from leakloc.views import fuse_views, panned

__all__ = [
    "METHODS",
    "Clip",
    "ClipError",
    "Estimate",
    "LeakEstimate",
    "PaperOptions",
    "Rectified",
    "ResultError",
    "Rig",
    "RigError",
    "footage_size",
    "fuse_views",
    "locate",
    "panned",
    "read_calibration",
    "read_clip",
    "read_footage",
    "read_result",
    "read_rig",
    "rectified_rig",
    "rectify",
    "result_schema",
    "write_result",
    "write_rig",
]
