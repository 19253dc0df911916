"""Settings of all stages that fill gaps in a track."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class GapSettings:
    """Thresholds, weights and spreads of gap detection, motion priors, foot contact and the choice of trajectories.

    `smoothness_cost`, `prior_cost` and `track_advantage` were chosen on the tuning split of the labelled sequences.

    Attributes
    ----------
    hidden_confidence : mean confidence of a limb's three outer joints below which it is occluded; on the tuning split
        of suite and scenes 0.76 finds 92 % of the limbs with a joint over 100 mm off, with a precision of 46 %
    end_confidence : a gap extends on both sides while the confidence is below this value
    smoothing_frames : frames over which the confidence is averaged
    joined_frames : gaps of one limb with fewer frames between them become one
    shortest_gap : frames; shorter gaps are ignored
    widened_frames : frames added at both ends of a gap, because a limb is mistracked before its confidence drops
    end_share : fraction of a segment at its end in which an alignment with a template may end
    observed_noise : radians, standard deviation of the angles of visible limbs
    end_noise : radians, the same of an occluded limb at the ends of its gap
    repetition_spread : radians, standard deviation between repetitions of one motion by one person
    repetition_memory : seconds, correlation time of these deviations
    unknown_spread : radians, standard deviation of an angle without a motion prior
    unknown_memory : seconds, correlation time of these deviations
    prior_weight : m^2 per rad^2 and variance, weight of the angle prior while tracking again; a tenth of the weight
        of the depth samples on a visible arm
    prior_spread : radians, added to the standard deviation of a prior
    contact_columns : shortest run of template columns in which a foot is at rest
    contact_weight : weight of a floor residual relative to one correspondence
    contact_scale : metres, scale of its Geman-McClure weight
    contact_cost : metres added to the distance of a pose from its frame for each fully violated floor residual
    smoothness_cost : m / rad^2, cost of a squared step of one angle between frames
    prior_cost : metres for one squared standard deviation of one angle
    track_advantage : metres by which another trajectory must be closer to the depth than the track
    """

    hidden_confidence: float = 0.76
    end_confidence: float = 0.78
    smoothing_frames: int = 5
    joined_frames: int = 3
    shortest_gap: int = 4
    widened_frames: int = 20
    end_share: float = 0.2
    observed_noise: float = 0.12
    end_noise: float = 0.1
    repetition_spread: float = 0.15
    repetition_memory: float = 0.5
    unknown_spread: float = 0.7
    unknown_memory: float = 4.0
    prior_weight: float = 0.003
    prior_spread: float = 0.15
    contact_columns: int = 5
    contact_weight: float = 1.0
    contact_scale: float = 0.1
    contact_cost: float = 0.001
    smoothness_cost: float = 0.02
    prior_cost: float = 0.00015
    track_advantage: float = 0.0007


DEFAULT = GapSettings()
"""Settings of `depthmocap stabilise`."""
