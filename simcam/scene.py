"""What is in front of the cameras: the pedestal, its lamps, its leaks and the structure in it. World axes, metres."""

from dataclasses import dataclass, field

import numpy as np

from simcam.fall import GRAVITY_M_S2
from simcam.lens import FloatArray
from simcam.structures import Structure
from simcam.texture import RustTexture, Texture

__all__ = ["GRAVITY_M_S2", "Lamp", "Leak", "Pedestal", "Scene"]


@dataclass(frozen=True)
class Pedestal:
    """A closed upright cylinder on the world's z axis, `height_m` tall about z = `centre_z_m`, with matt surfaces."""

    radius_m: float = 2.5
    height_m: float = 7.0
    centre_z_m: float = 0.0
    texture: Texture = field(default_factory=RustTexture)

    def __post_init__(self) -> None:
        """Check the size."""
        for name in ("radius_m", "height_m"):
            if not 0 < getattr(self, name) < np.inf:
                raise ValueError(f"Pedestal: {name} must be > 0 and finite, got {getattr(self, name)}")

    @property
    def floor_z_m(self) -> float:
        """Height of the floor."""
        return self.centre_z_m - self.height_m / 2

    @property
    def ceiling_z_m(self) -> float:
        """Height of the ceiling."""
        return self.centre_z_m + self.height_m / 2

    def holds(self, point_world_m: FloatArray, margin_m: float = 0.0) -> bool:
        """Whether a point (3,) is inside by at least `margin_m`."""
        x, y, z = point_world_m
        inside = np.hypot(x, y) + margin_m < self.radius_m
        return bool(inside and self.floor_z_m + margin_m < z < self.ceiling_z_m - margin_m)


@dataclass(frozen=True)
class Lamp:
    """A uniformly bright sphere; `power_w` is its radiant flux, so its intensity is power / (4 pi) W/sr."""

    position_m: tuple[float, float, float] = (-2.3, 0.0, 0.4)
    radius_m: float = 0.1
    power_w: float = 25.0

    def __post_init__(self) -> None:
        """Check radius and power."""
        if len(self.position_m) != 3:
            raise ValueError(f"Lamp: position_m must be (x, y, z), got {self.position_m}")
        if not self.radius_m > 0:
            raise ValueError(f"Lamp: radius_m must be > 0 (a point lamp has no penumbra), got {self.radius_m}")
        if not self.power_w >= 0:
            raise ValueError(f"Lamp: power_w must be >= 0, got {self.power_w}")

    @property
    def intensity_w_sr(self) -> float:
        """Radiant intensity, W/sr."""
        return self.power_w / (4 * np.pi)

    @property
    def radiance_w_m2_sr(self) -> float:
        """Radiance of the lamp's surface, W m^-2 sr^-1."""
        return self.intensity_w_sr / (np.pi * self.radius_m**2)


@dataclass(frozen=True, eq=False)
class Leak:
    """Drops of one radius released at rest at (x, y, z) at `drop_times_s`; each falls as z - g (t - t0)^2 / 2."""

    x_m: float
    y_m: float
    z_m: float
    drop_radius_m: float
    drop_times_s: FloatArray

    def __post_init__(self) -> None:
        """Check the radius and sort nothing: the times are kept as given, finite, one dimension."""
        if not 0 < self.drop_radius_m < 0.1:
            raise ValueError(f"Leak: drop_radius_m must lie in (0, 0.1), got {self.drop_radius_m}")
        times = np.array(self.drop_times_s, float)
        if times.ndim != 1 or not np.isfinite(times).all():
            raise ValueError(f"Leak: drop_times_s must be a finite 1-D array, got shape {times.shape}")
        times.setflags(write=False)
        object.__setattr__(self, "drop_times_s", times)

    @property
    def position_m(self) -> FloatArray:
        """Where the drops are released, (3,)."""
        return np.array([self.x_m, self.y_m, self.z_m])


@dataclass(frozen=True, eq=False)
class Scene:
    """A lit pedestal with leaks; `bounces` is how many times light is passed on between the walls.

    Physics that can be switched off to find out why an estimator fails: without `drop_shadows`, drops take no light
    from wall, floor and structure (what is seen through a drop still has that drop's own shadow).
    """

    pedestal: Pedestal = field(default_factory=Pedestal)
    lamps: tuple[Lamp, ...] = (Lamp(),)
    leaks: tuple[Leak, ...] = ()
    structures: tuple[Structure, ...] = ()
    bounces: int = 8
    drop_shadows: bool = True

    def __post_init__(self) -> None:
        """Check that lamps and leaks are inside the pedestal."""
        for name in ("lamps", "leaks", "structures"):
            object.__setattr__(self, name, tuple(getattr(self, name)))
        if self.bounces < 0:
            raise ValueError(f"Scene: bounces must be >= 0, got {self.bounces}")
        for index, lamp in enumerate(self.lamps):
            if not self.pedestal.holds(np.asarray(lamp.position_m), lamp.radius_m):
                raise ValueError(f"Scene: lamp {index} at {lamp.position_m} is not inside the pedestal with its radius")
        for index, leak in enumerate(self.leaks):
            if not self.pedestal.holds(leak.position_m, leak.drop_radius_m):
                raise ValueError(f"Scene: leak {index} at {tuple(leak.position_m)} is not inside the pedestal")
