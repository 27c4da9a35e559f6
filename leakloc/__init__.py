"""Where the leaks are: estimators that see frames and a believed rig, never the scene or the truth.

clip = read_clip("clip")
estimate = locate(clip.left, clip.right, clip.rig)
write_result(estimate, "result.json")
"""

from leakloc.clip import Clip, ClipError, read_clip
from leakloc.estimate import Estimate, LeakEstimate
from leakloc.methods import METHODS, locate
from leakloc.paper import PaperOptions
from leakloc.result import ResultError, read_result, result_schema, write_result
from leakloc.rig import Rig, RigError
from leakloc.rig_file import read_rig, write_rig

__all__ = [
    "METHODS",
    "Clip",
    "ClipError",
    "Estimate",
    "LeakEstimate",
    "PaperOptions",
    "ResultError",
    "Rig",
    "RigError",
    "locate",
    "read_clip",
    "read_result",
    "read_rig",
    "result_schema",
    "write_result",
    "write_rig",
]
