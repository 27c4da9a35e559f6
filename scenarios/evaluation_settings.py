"""What stands for the values that the paper does not publish, read from the scenario that is run."""

from dataclasses import dataclass

from scenarios.scenario import Scenario


@dataclass(frozen=True)
class Assumption:
    """A quantity that the paper leaves open, its key in the scenario, its value and its unit."""

    what: str
    key: str
    value: str
    unit: str


KEYS = (
    ("radius of drops, larger than water allows, as drawn in the paper", "layout.drop_radius_m", "m"),
    ("time between drops of a leak", "layout.drip_period_s", "s"),
    ("jitter of that time", "layout.drip_jitter", ""),
    ("height of the outlets above the cameras", "layout.z_m", "m"),
    ("least distance of a random leak from the wall", "layout.wall_margin_m", "m"),
    ("place of the lamp", "lamp.0.position_m", "m"),
    ("radius of the lamp", "lamp.0.radius_m", "m"),
    ("power of the lamp", "lamp.0.power_w", "W"),
    ("exposure of a frame", "recording.exposure_s", "s"),
    ("gain", "sensor.electrons_per_grey", "electrons / grey"),
    ("read noise", "sensor.read_noise_e", "electrons"),
    ("size of a pixel", "sensor.pitch_um", "um"),
    ("sensitive layer", "sensor.thickness_um", "um"),
    ("tone", "sensor.tone", ""),
    ("aperture", "rig.f_number", ""),
    ("quantum efficiency", "rig.quantum_efficiency", ""),
    ("blur of lens and pixel, sigma", "rig.psf_sigma_px", "px"),
    ("height of the pedestal", "pedestal.height_m", "m"),
    ("reflectance of bare steel", "pedestal.steel_reflectance", ""),
    ("reflectance of rust", "pedestal.rust_reflectance", ""),
)


def assumptions(scenario: Scenario) -> list[Assumption]:
    """Return what a scenario assumes; keys that it does not have are left out."""
    found = []
    for what, key, unit in KEYS:
        value = _value(scenario, key)
        if value is not None:
            found.append(Assumption(what, key, value, unit))
    return found


def _value(scenario: Scenario, key: str) -> str | None:
    here: object = scenario
    for part in key.split("."):
        if isinstance(here, tuple):
            here = here[int(part)] if int(part) < len(here) else None
        else:
            here = getattr(here, part, None)
    if isinstance(here, tuple):
        return ", ".join(f"{number:g}" for number in here)
    return f"{here:.4g}" if isinstance(here, float) else None if here is None else str(here)
