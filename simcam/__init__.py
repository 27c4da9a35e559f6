"""What the cameras see: a ray-cast stereo simulator of a lit pedestal with falling drops.

The static scene is ray-cast once per rig and scene and kept; each frame recomputes only the pixels that a drop or its
shadow touches. Output: float32 linear expected photo-electrons; noise and sensor are the `noise` package's.
"""

from simcam.camera import Camera
from simcam.masks import drop_centres, drop_mask, shadow_mask, static_depth
from simcam.recording import Recording, responsivity
from simcam.render import StereoClip, render_clip, render_view
from simcam.rig import Lens, Pose, StereoRig, Tilt, stereo_rig
from simcam.scene import Lamp, Leak, Pedestal, Scene
from simcam.structures import Box, Grating, Mesh, Pipe, mesh_file
from simcam.texture import ImageTexture, RustTexture, UniformTexture
from simcam.truth import LeakTruth, LeakView, Truth, ground_truth

__all__ = [
    "Box",
    "Camera",
    "Grating",
    "ImageTexture",
    "Lamp",
    "Leak",
    "LeakTruth",
    "LeakView",
    "Lens",
    "Mesh",
    "Pedestal",
    "Pipe",
    "Pose",
    "Recording",
    "RustTexture",
    "Scene",
    "StereoClip",
    "StereoRig",
    "Tilt",
    "Truth",
    "UniformTexture",
    "drop_centres",
    "drop_mask",
    "ground_truth",
    "mesh_file",
    "render_clip",
    "render_view",
    "responsivity",
    "shadow_mask",
    "static_depth",
    "stereo_rig",
]
