"""Typical errors of the figures of a report: `depthmocap bench gait`, simulated recordings with exact truth."""

EXPECTED: dict[str, float] = {
    "stride_length_m": 0.00302,
    "cadence_steps_per_min": 0.619,
    "speed_m_per_s": 0.00902,
    "step_width_m": 0.0058,
    "stance_share": 0.0367,
    "stride_time_s": 0.00638,
    "hip_flexion_deg": 6.17,
    "hip_adduction_deg": 5.33,
    "hip_internal_rotation_deg": 8.58,
    "knee_flexion_deg": 3.34,
    "ankle_dorsiflexion_deg": 5.36,
    "ankle_inversion_deg": 6.28,
    "ankle_internal_rotation_deg": 2.12,
    "shoulder_plane_of_elevation_deg": 27.9,
    "shoulder_elevation_deg": 4.57,
    "shoulder_internal_rotation_deg": 34.4,
    "elbow_flexion_deg": 8.56,
    "rise_duration_s": 0.0359,
}
"""Mean absolute errors by figure, in the figure's unit; of ranges of motion by joint and motion, degrees."""
