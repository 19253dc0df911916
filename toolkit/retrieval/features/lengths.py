"""Body-relative units of length of the relational features (thesis 2.2)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from toolkit.retrieval.features.motion import NAMED_JOINTS, Motion


@dataclass(frozen=True)
class BodyLengths:
    """Body-relative units of length, in the unit of the motion's positions, measured in one frame."""

    humerus_right: float
    humerus_left: float
    shoulders: float
    hips: float
    chest_neck: float
    body: float

    @classmethod
    def of(cls, motion: Motion) -> BodyLengths:
        """Measure the first frame; the body length is right leg plus spine, without the drop from root to hips."""
        point = dict(zip(NAMED_JOINTS, motion.joints[0], strict=True))

        def length(*chain: str) -> float:
            steps = zip(chain[:-1], chain[1:], strict=True)
            return float(sum(np.linalg.norm(point[a] - point[b]) for a, b in steps))

        return cls(
            humerus_right=length("right_shoulder", "right_elbow"),
            humerus_left=length("left_shoulder", "left_elbow"),
            shoulders=length("left_shoulder", "right_shoulder"),
            hips=length("left_hip", "right_hip"),
            chest_neck=length("chest", "neck"),
            body=length("right_ankle", "right_knee", "right_hip")
            + length("root", "belly", "chest", "neck", "head", "headtop"),
        )

    def unit(self, name: str) -> float:
        """Return the length of HR, HL, SW, HW, CN or BL; 1 for degrees."""
        return {
            "HR": self.humerus_right, "HL": self.humerus_left, "SW": self.shoulders, "HW": self.hips,
            "CN": self.chest_neck, "BL": self.body, "deg": 1.0,
        }[name]  # fmt: skip
