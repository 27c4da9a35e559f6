"""Free fall from rest: z(t) = z0 - g (t - t0)^2 / 2 (Galilei); no drag, no wind."""

import numpy as np

from simcam.lens import FloatArray

GRAVITY_M_S2 = 9.81  # the value the reference clips were made with


def fall_depth(fall_s: FloatArray | float) -> FloatArray:
    """Metres fallen after `fall_s` seconds; 0 before the release."""
    fall_s = np.maximum(fall_s, 0.0)
    return 0.5 * GRAVITY_M_S2 * fall_s * fall_s


def fall_time(depth_m: FloatArray | float) -> FloatArray:
    """Seconds from the release until a drop has fallen `depth_m`; 0 above the leak."""
    return np.sqrt(2.0 / GRAVITY_M_S2 * np.maximum(depth_m, 0.0))
