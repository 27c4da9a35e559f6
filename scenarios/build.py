"""Turn a resolved scenario into what the lower packages take: scene, true rig, recording, gamma field, believed rig."""

import numpy as np

import simcam
from leakloc import Rig
from noise import GammaField, Sensor
from scenarios.scenario import BoxTable, GratingTable, PipeTable, Scenario, StructureTable
from scenarios.scenario_file import ScenarioError
from simcam.structures import Structure


def build_scene(scenario: Scenario) -> simcam.Scene:
    """Pedestal, lamps and leaks; the scenario must be resolved (drop times listed)."""
    pedestal = scenario.pedestal
    texture = (
        simcam.RustTexture(pedestal.texture_seed, pedestal.steel_reflectance, pedestal.rust_reflectance)
        if pedestal.texture == "rust"
        else simcam.UniformTexture(reflectance=pedestal.reflectance)
    )
    return simcam.Scene(
        pedestal=simcam.Pedestal(pedestal.radius_m, pedestal.height_m, pedestal.centre_z_m, texture),
        lamps=tuple(simcam.Lamp(lamp.position_m, lamp.radius_m, lamp.power_w) for lamp in scenario.lamp),
        leaks=tuple(
            simcam.Leak(leak.x_m, leak.y_m, leak.z_m, leak.drop_radius_m, np.array(leak.drop_times_s, dtype=float))
            for leak in scenario.leak
        ),
        structures=tuple(_structure(table, number) for number, table in enumerate(scenario.structure)),
        drop_shadows=scenario.effects.drop_shadows,
    )


def true_rig(scenario: Scenario) -> simcam.StereoRig:
    """Return the rig as it stands, misalignment included: the one that renders."""
    rig = scenario.rig
    return simcam.stereo_rig(
        pose=simcam.Pose(rig.roll_deg, rig.pitch_deg, rig.yaw_deg, rig.position_m),
        lens=_lens(scenario, rig.hfov_deg),
        baseline_m=rig.baseline_m,
        right_error=simcam.Tilt(rig.right_roll_deg, rig.right_pitch_deg, rig.right_yaw_deg),
    )


def believed_rig(scenario: Scenario) -> Rig:
    """Return the rig as the estimator is told it stands (rig.yaml)."""
    rig, told = scenario.rig, scenario.believed_rig
    cameras = simcam.stereo_rig(
        pose=simcam.Pose(told.roll_deg, told.pitch_deg, told.yaw_deg, rig.position_m),
        lens=_lens(scenario, rig.hfov_deg if told.hfov_deg is None else told.hfov_deg),
        baseline_m=rig.baseline_m if told.baseline_m is None else told.baseline_m,
    )
    left, right = cameras.left, cameras.right
    right_from_left = np.linalg.inv(right.world_from_camera) @ left.world_from_camera
    lamps = np.array([(*lamp.position_m, lamp.radius_m) for lamp in scenario.lamp])
    return Rig(
        K1=left.camera_matrix,
        D1=left.distortion,
        K2=right.camera_matrix,
        D2=right.distortion,
        R=right_from_left[:3, :3],
        T=right_from_left[:3, 3],
        image_size=(rig.width_px, rig.height_px),
        world_from_left=left.world_from_camera,
        lamps=lamps if told.lamps == "known" and len(lamps) else None,
        pedestal_radius=scenario.pedestal.radius_m if told.pedestal == "known" else None,
    )


def build_recording(scenario: Scenario) -> simcam.Recording:
    """When the shutters open, how sharp and how sensitive the cameras are."""
    rig, recording = scenario.rig, scenario.recording
    return simcam.Recording(
        n_frames=recording.n_frames,
        fps=recording.fps,
        exposure_s=recording.exposure_s,
        readout_s=recording.readout_s,
        psf_sigma_px=rig.psf_sigma_px,
        responsivity=simcam.responsivity(
            f_number=rig.f_number, pitch_um=scenario.sensor.pitch_um, quantum_efficiency=rig.quantum_efficiency
        ),
    )


def gamma_field(scenario: Scenario) -> GammaField:
    """Radiation at the cameras."""
    gamma = scenario.gamma
    return GammaField(dose_rate_gy_h=gamma.dose_rate_gy_h, photon_energy_kev=gamma.photon_energy_kev)


def image_sensor(scenario: Scenario) -> Sensor:
    """Return the sensor of both cameras."""
    sensor = scenario.sensor
    return Sensor(
        pitch_um=sensor.pitch_um,
        thickness_um=sensor.thickness_um,
        electrons_per_grey=sensor.electrons_per_grey,
        read_noise_e=sensor.read_noise_e,
        charge_diffusion_um=sensor.charge_diffusion_um,
        tone=sensor.tone,
        shot_noise=scenario.effects.shot_noise,
    )


def _structure(table: StructureTable, number: int) -> Structure:
    match table:
        case BoxTable():
            return simcam.Box(table.centre_m, table.size_m, table.yaw_deg, table.reflectance)
        case PipeTable():
            return simcam.Pipe(table.start_m, table.end_m, table.radius_m, table.reflectance)
        case GratingTable():
            return simcam.Grating(table.centre_m, table.size_m, table.pitch_m, table.bar_m, table.reflectance)
    try:
        return simcam.mesh_file(table.path, scale=table.scale, reflectance=table.reflectance)
    except ValueError as error:
        raise ScenarioError(f"structure.{number}.path: {error}") from None


def _lens(scenario: Scenario, hfov_deg: float) -> simcam.Lens:
    rig = scenario.rig
    return simcam.Lens(hfov_deg, rig.width_px, rig.height_px, rig.distortion)
