"""The settings files that people start from."""

from __future__ import annotations

from toolkit.config import load_settings
from toolkit.tracking.settings import HybridSettings


def test_the_hybrid_file_shows_the_defaults() -> None:
    assert load_settings(HybridSettings, "hybrid") == HybridSettings()


def test_the_papers_variant_has_its_two_hypotheses_and_nothing_learnt() -> None:
    settings = load_settings(HybridSettings, "baak2013")
    assert settings.hypotheses == ("local", "extrema")
    assert settings.shape.frames == 0 and settings.fitting.prior_weight == 0.0 and settings.fitting.cloud_samples == 0
