"""A scenario: one situation in a pedestal, as frozen models with units in the names of their fields.

The models hold what a scenario file may say, the range of every value and nothing else; rules between values are in
`rules.py`, reading files in `scenario_file.py`, and turning a scenario into a scene in `build.py`.
"""

from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field

MAX_LEAKS = 100
MAX_LAMPS = 16
MAX_STRUCTURES = 64
MAX_DROPS_PER_LEAK = 2000
MAX_FRAMES = 1000


def tuple_of_list(value: Any) -> Any:
    """TOML knows lists alone; the frozen models keep tuples."""
    return tuple(value) if isinstance(value, list) else value


def list_of_at_most(max_length: int) -> BeforeValidator:
    """As `tuple_of_list`; one that is too long is refused before its entries are looked at, each with its mistakes."""

    def short_tuple(value: Any) -> Any:
        if isinstance(value, list | tuple) and len(value) > max_length:
            raise ValueError(f"must have at most {max_length} entries")
        return tuple_of_list(value)

    return BeforeValidator(short_tuple)


class Model(BaseModel):
    """Frozen, no unknown keys, no silent conversion of types, finite numbers."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)


Metres = Annotated[float, Field(ge=-100.0, le=100.0)]
Degrees = Annotated[float, Field(ge=-180.0, le=180.0)]
Reflectance = Annotated[float, Field(gt=0.0, lt=1.0)]
Point = Annotated[tuple[Metres, Metres, Metres], BeforeValidator(tuple_of_list)]
Side = Annotated[float, Field(ge=0.0001, le=100.0)]
Distortion = Annotated[
    tuple[
        Annotated[float, Field(ge=-1.0, le=1.0)],
        Annotated[float, Field(ge=-1.0, le=1.0)],
        Annotated[float, Field(ge=-0.1, le=0.1)],
        Annotated[float, Field(ge=-0.1, le=0.1)],
        Annotated[float, Field(ge=-1.0, le=1.0)],
    ],
    BeforeValidator(tuple_of_list),
]


class RigTable(Model):
    """The stereo camera as it truly stands; angles are R = Rz(yaw) Ry(pitch) Rx(roll) about the rig's origin."""

    position_m: Point = Field((-2.4, 0.0, 0.0), description="middle of the baseline, world frame")
    baseline_m: float = Field(0.5, gt=0.0, le=10.0, description="distance between the cameras")
    hfov_deg: float = Field(70.0, ge=10.0, le=150.0, description="horizontal field of view")
    width_px: int = Field(960, ge=16, le=4096)
    height_px: int = Field(540, ge=16, le=4096)
    roll_deg: Degrees = Field(0.0, description="+ lifts the left side")
    pitch_deg: Degrees = Field(0.0, description="+ looks down")
    yaw_deg: Degrees = Field(0.0, description="+ turns left")
    right_roll_deg: Degrees = Field(0.0, description="error of the right camera against the left, about its own centre")
    right_pitch_deg: Degrees = Field(0.0, description="error of the right camera against the left")
    right_yaw_deg: Degrees = Field(0.0, description="error of the right camera against the left")
    distortion: Distortion = Field((0.0, 0.0, 0.0, 0.0, 0.0), description="Brown k1 k2 p1 p2 k3, both cameras")
    psf_sigma_px: float = Field(0.5, ge=0.0, le=5.0, description="point-spread of lens and pixel, Gaussian")
    f_number: float = Field(2.0, ge=0.5, le=32.0)
    quantum_efficiency: float = Field(0.6, gt=0.0, le=1.0)


class BelievedRigTable(Model):
    """What the estimator is told where that differs from the truth; angles left out are level, the rest is right."""

    roll_deg: Degrees = 0.0
    pitch_deg: Degrees = 0.0
    yaw_deg: Degrees = 0.0
    baseline_m: float | None = Field(None, gt=0.0, le=10.0)
    hfov_deg: float | None = Field(None, ge=10.0, le=150.0)
    lamps: Literal["known", "unknown"] = Field("known", description="whether rig.yaml lists the lamps")
    pedestal: Literal["known", "unknown"] = Field("known", description="whether rig.yaml gives the pedestal's radius")


class RecordingTable(Model):
    """When the shutters are open: frame n is centred on n / fps."""

    fps: float = Field(12.0, gt=0.0, le=1000.0)
    n_frames: int = Field(24, ge=1, le=MAX_FRAMES)
    exposure_s: float = Field(1.0 / 12.0, gt=0.0, le=10.0)
    readout_s: float = Field(0.0, ge=0.0, le=1.0, description="rolling shutter: time from the first to the last row")


class GammaTable(Model):
    """The gamma field at the camera."""

    dose_rate_gy_h: float = Field(10.0, ge=0.0, le=10_000.0, description="air kerma; L, M, H = 1.7, 3.3, 10")
    photon_energy_kev: float = Field(661.7, ge=300.0, le=1500.0, description="661.7 is Cs-137")


class SensorTable(Model):
    """The image sensor of both cameras."""

    pitch_um: float = Field(3.0, ge=0.5, le=50.0)
    thickness_um: float = Field(5.0, ge=0.5, le=50.0, description="sensitive layer of silicon")
    electrons_per_grey: float = Field(33.0, gt=0.0, le=10_000.0)
    read_noise_e: float = Field(3.0, ge=0.0, le=1000.0)
    charge_diffusion_um: float = Field(1.2, ge=0.0, le=20.0)
    tone: Literal["linear", "srgb"] = "linear"


class EffectsTable(Model):
    """Physics that can be switched off to find out why an estimator fails."""

    drop_shadows: bool = True
    shot_noise: bool = True


class PedestalTable(Model):
    """The cylinder below the vessel."""

    radius_m: float = Field(2.5, gt=0.1, le=50.0)
    height_m: float = Field(7.0, gt=0.1, le=100.0)
    centre_z_m: Metres = Field(0.0, description="height of the cylinder's middle above the cameras")
    texture: Literal["rust", "uniform"] = "rust"
    texture_seed: int = Field(0, ge=0, lt=2**31, description="the wall stays the same when the scenario's seed changes")
    reflectance: float = Field(0.08, gt=0.0, lt=1.0, description="diffuse, of a uniform wall: the mean of a rusty one")
    steel_reflectance: float = Field(0.05, gt=0.0, lt=1.0, description="diffuse, of a rusty wall where it is bare")
    rust_reflectance: float = Field(0.11, gt=0.0, lt=1.0, description="diffuse, of a rusty wall where it is rusty")


class LampTable(Model):
    """A spherical lamp; power is radiant flux."""

    position_m: Point = (-2.3, 0.0, 0.4)
    radius_m: float = Field(0.1, gt=0.0, le=1.0)
    power_w: float = Field(178.0, gt=0.0, le=100_000.0)


class BoxTable(Model):
    """A box, turned about the vertical."""

    kind: Literal["box"]
    centre_m: Point
    size_m: Annotated[tuple[Side, Side, Side], BeforeValidator(tuple_of_list)]
    yaw_deg: Degrees = 0.0
    reflectance: Reflectance = 0.08


class PipeTable(Model):
    """A closed cylinder between two points."""

    kind: Literal["pipe"]
    start_m: Point
    end_m: Point
    radius_m: float = Field(0.05, ge=0.0001, le=5.0)
    reflectance: Reflectance = 0.08


class GratingTable(Model):
    """A level grating of bars."""

    kind: Literal["grating"]
    centre_m: Point
    size_m: Annotated[tuple[Side, Side], BeforeValidator(tuple_of_list)]
    pitch_m: float = Field(0.1, gt=0.001, le=10.0)
    bar_m: float = Field(0.01, gt=0.0001, le=10.0)
    reflectance: Reflectance = 0.08


class MeshTable(Model):
    """A mesh file, STL, PLY, OBJ or OFF; a relative path starts at the scenario file."""

    kind: Literal["mesh"]
    path: str = Field(min_length=1, max_length=1000)
    scale: float = Field(1.0, gt=0.0, le=1000.0, description="metres per unit of the file")
    reflectance: Reflectance = 0.08


StructureTable = Annotated[BoxTable | PipeTable | GratingTable | MeshTable, Field(discriminator="kind")]


class Drip(Model):
    """How a leak drips: what every leak and every random layout says."""

    z_m: Metres = Field(2.0, description="height of the outlet above the cameras")
    drop_radius_m: float = Field(0.0025, gt=0.0, le=0.05, description="physical drops of water reach 0.003")
    drip_period_s: float = Field(0.2, ge=0.001, le=100.0, description="mean time between drops")
    drip_jitter: float = Field(0.1, ge=0.0, lt=1.0, description="each interval is period * (1 +- jitter), uniform")


class LeakTable(Drip):
    """One leak; explicit drop times replace period and jitter."""

    x_m: Metres
    y_m: Metres
    drop_times_s: Annotated[
        tuple[Annotated[float, Field(ge=-1000.0, le=1000.0)], ...] | None, list_of_at_most(MAX_DROPS_PER_LEAK)
    ] = Field(None, max_length=MAX_DROPS_PER_LEAK, description="times of release; frame 0 is centred on 0")


class LayoutTable(Drip):
    """Leaks at random places, drawn anew from every seed: uniform in the half disc x >= 0, as in the paper."""

    n_leaks: int = Field(3, ge=0, le=MAX_LEAKS)
    min_separation_m: float = Field(0.5, ge=0.0, le=10.0)
    wall_margin_m: float = Field(0.2, ge=0.0, le=10.0, description="least distance of a leak from the wall")


class RegressionTable(Model):
    """What is expected of a kept counterexample; no clip depends on it."""

    method: Literal["paper", "robust"]
    code: str = Field(min_length=1, max_length=100, description="outcome code of the failure, say missed.unexplained")
    status: Literal["open", "fixed", "accepted-limit"] = Field(
        description="open, accepted-limit: must fail with that code; fixed: nothing may be wrong"
    )
    note: str = Field("", max_length=500, description="what is behind it")


class Scenario(Model):
    """One situation: everything that a clip depends on, and what is expected where that is a kept counterexample."""

    name: str = Field("", max_length=100)
    description: str = Field("", max_length=2000)
    seed: int = Field(0, ge=0, lt=2**63, description="every random draw of the clip follows from it")
    rig: RigTable = RigTable()
    believed_rig: BelievedRigTable = BelievedRigTable()
    recording: RecordingTable = RecordingTable()
    gamma: GammaTable = GammaTable()
    sensor: SensorTable = SensorTable()
    effects: EffectsTable = EffectsTable()
    pedestal: PedestalTable = PedestalTable()
    lamp: Annotated[tuple[LampTable, ...], list_of_at_most(MAX_LAMPS)] = Field(
        (LampTable(),), max_length=MAX_LAMPS, description="the paper's one lamp unless listed; lamp = [] is darkness"
    )
    leak: Annotated[tuple[LeakTable, ...], list_of_at_most(MAX_LEAKS)] = Field((), max_length=MAX_LEAKS)
    layout: LayoutTable | None = None
    structure: Annotated[tuple[StructureTable, ...], list_of_at_most(MAX_STRUCTURES)] = Field(
        (), max_length=MAX_STRUCTURES
    )
    regression: RegressionTable | None = Field(None, description="of a counterexample that the tests replay")
