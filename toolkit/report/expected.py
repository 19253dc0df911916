"""Typical errors of the figures of a report: `depthmocap bench gait`, simulated recordings with exact truth."""

EXPECTED: dict[str, float] = {
    "stride_length_m": 0.00813,
    "cadence_steps_per_min": 0.235,
    "speed_m_per_s": 0.00728,
    "step_width_m": 0.00742,
    "stance_share": 0.00425,
    "stride_time_s": 0.00255,
    "hip_flexion_deg": 7.72,
    "hip_adduction_deg": 6.24,
    "hip_internal_rotation_deg": 10,
    "knee_flexion_deg": 2.63,
    "ankle_dorsiflexion_deg": 9,
    "ankle_inversion_deg": 8.82,
    "ankle_internal_rotation_deg": 3.95,
    "shoulder_plane_of_elevation_deg": 50.9,
    "shoulder_elevation_deg": 7.73,
    "shoulder_internal_rotation_deg": 60.5,
    "elbow_flexion_deg": 10.1,
    "rise_duration_s": 0.0176,
}
"""Mean absolute errors by figure, in the figure's unit; of ranges of motion by joint and motion, degrees."""
