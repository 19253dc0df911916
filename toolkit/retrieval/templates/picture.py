"""Pictures of feature matrices and motion templates."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from toolkit.retrieval.features.relational import FEATURES
from toolkit.retrieval.templates.quantised import QuantisedTemplate
from toolkit.retrieval.templates.template import MotionTemplate

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def plot_template(
    template: MotionTemplate | QuantisedTemplate, axes: Axes, features: Sequence[int] | None = None
) -> None:
    """Draw a template as in the thesis's Fig. 2.6: black 0, white 1, colours what varies, grey wildcards.

    Parameters
    ----------
    template : fitted or quantised
    axes : matplotlib axes
    features : feature numbers (1 to 40) to show; all by default
    """
    if isinstance(template, QuantisedTemplate):
        plot_matrix(np.where(template.wildcards, np.nan, template.values), axes, features)
    else:
        plot_matrix(template.values_, axes, features)


def plot_matrix(values: np.ndarray, axes: Axes, features: Sequence[int] | None = None) -> None:
    """Draw feature values (40, T) in [0, 1] as in Fig. 2.5: black 0, white 1, NaN grey, 30 columns a second."""
    import matplotlib

    numbers = list(features) if features is not None else [feature.number for feature in FEATURES]
    colours = matplotlib.colormaps["hot"].with_extremes(bad="0.6")
    axes.imshow(
        np.asarray(values, dtype=float)[[n - 1 for n in numbers]], aspect="auto", interpolation="nearest",
        cmap=colours, vmin=0.0, vmax=1.0, extent=(0.5, values.shape[1] + 0.5, len(numbers) + 0.5, 0.5),
    )  # fmt: skip
    axes.set_yticks(range(1, len(numbers) + 1), [f"F{n}" for n in numbers], fontsize=6)
    axes.set_xlabel("frame (30 Hz)")
