"""How a clip is exposed: frame times, exposure, rolling shutter, point-spread and the sensor's response."""

from dataclasses import dataclass

import numpy as np

from simcam.lens import FloatArray

PLANCK_J_S = 6.62607015e-34  # exact, SI 2019
LIGHT_SPEED_M_S = 299_792_458.0  # exact


def responsivity(
    f_number: float = 2.0, pitch_um: float = 3.0, quantum_efficiency: float = 0.6, wavelength_nm: float = 550.0
) -> float:
    """Photo-electrons per second per W m^-2 sr^-1 of scene radiance, pi / (4 N^2) p^2 QE lambda / (h c).

    The camera equation on the axis (Horn, Robot Vision, 10.3); cos^4 fall-off is left out.
    """
    photon_j = PLANCK_J_S * LIGHT_SPEED_M_S / (wavelength_nm * 1e-9)
    return np.pi / (4 * f_number**2) * (pitch_um * 1e-6) ** 2 * quantum_efficiency / photon_j


@dataclass(frozen=True)
class Recording:
    """Frame n is centred on n / fps; with a rolling shutter the rows follow each other over `readout_s`.

    `psf_sigma_px` is a Gaussian blur on top of the pixel's square; `responsivity` as the function of that name gives.
    """

    n_frames: int = 24
    fps: float = 12.0
    exposure_s: float = 1 / 12
    readout_s: float = 0.0
    psf_sigma_px: float = 0.0
    responsivity: float = responsivity()

    def __post_init__(self) -> None:
        """Check that every number can be a recording's."""
        if self.n_frames < 1:
            raise ValueError(f"Recording: n_frames must be >= 1, got {self.n_frames}")
        for name in ("fps", "exposure_s", "responsivity"):
            if not 0 < getattr(self, name) < np.inf:
                raise ValueError(f"Recording: {name} must be > 0 and finite, got {getattr(self, name)}")
        for name in ("readout_s", "psf_sigma_px"):
            if not 0 <= getattr(self, name) < np.inf:
                raise ValueError(f"Recording: {name} must be >= 0 and finite, got {getattr(self, name)}")

    def row_delays_s(self, height_px: int) -> FloatArray:
        """Exposure delay (height,) of every row against the frame's time; the image's middle has none."""
        return self.readout_s * ((np.arange(height_px) + 0.5) / height_px - 0.5)

    def opens_s(self, frame: FloatArray | int) -> FloatArray:
        """Start of the exposure of a row without delay."""
        return np.asarray(frame) / self.fps - self.exposure_s / 2

    def closes_s(self, frame: FloatArray | int) -> FloatArray:
        """End of the exposure of a row without delay."""
        return np.asarray(frame) / self.fps + self.exposure_s / 2
