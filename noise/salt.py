"""Salt noise, the baseline that others use: as many white single pixels as there would be tracks.

Impulse noise (Gonzalez and Woods, Digital Image Processing, section 5.2): a struck pixel is white whatever the gain,
and neither diffusion nor optics spread it.
"""

from __future__ import annotations

import numpy as np

from noise.arrays import Array
from noise.hits import GammaHits
from noise.sensor import Sensor
from noise.silicon import PAIR_ENERGY_KEV


def salt_hits(mean_number: float, charge_e: Array, sensor: Sensor, *, rng: np.random.Generator) -> GammaHits:
    """Add a full well to Poisson-many uniform pixels of an image (height, width), in place; the truth, as of frame 0.

    Lengths are 0 and azimuths undefined (NaN); the charge is the full well, whatever the physics says.
    """
    height, width = charge_e.shape
    n = int(rng.poisson(mean_number))
    x_px, y_px = rng.random(n) * width - 0.5, rng.random(n) * height - 0.5
    index = np.floor(y_px + 0.5).astype(np.int64) * width + np.floor(x_px + 0.5).astype(np.int64)
    np.add.at(charge_e.reshape(-1), index, charge_e.dtype.type(sensor.full_well_e))
    charge = np.full(n, sensor.full_well_e)
    return GammaHits(
        frame=np.zeros(n, dtype=np.int32),
        x_px=x_px,
        y_px=y_px,
        length_px=np.zeros(n),
        azimuth_rad=np.full(n, np.nan),
        deposit_kev=charge * PAIR_ENERGY_KEV,
        charge_e=charge,
    )
