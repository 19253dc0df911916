"""Typical errors of the figures of a report: `depthmocap bench gait`, simulated recordings with exact truth."""

EXPECTED: dict[str, float] = {
    "stride_length_m": 0.00399,
    "cadence_steps_per_min": 0.698,
    "speed_m_per_s": 0.0109,
    "step_width_m": 0.00553,
    "stance_share": 0.0376,
    "stride_time_s": 0.00717,
    "hip_flexion_deg": 6.62,
    "hip_adduction_deg": 5.81,
    "hip_internal_rotation_deg": 9.15,
    "knee_flexion_deg": 3.76,
    "ankle_dorsiflexion_deg": 5.3,
    "ankle_inversion_deg": 7.03,
    "ankle_internal_rotation_deg": 2.18,
    "shoulder_plane_of_elevation_deg": 35.4,
    "shoulder_elevation_deg": 4.69,
    "shoulder_internal_rotation_deg": 39.5,
    "elbow_flexion_deg": 10.0,
    "rise_duration_s": 0.0359,
}
"""Mean absolute errors by figure, in the figure's unit; of ranges of motion by joint and motion, degrees."""
