"""Pictures of scans: a face before and after wear with its depth, the line of the wear coefficient."""

from typing import Any

import numpy as np

from tribodyn.geometry.height_map import centred, level
from tribodyn.geometry.worn_volume import WornFace
from tribodyn.workflows.pictures.figures import axes_of, length_unit
from tribodyn.workflows.pictures.matplotlib_names import Figure
from tribodyn.workflows.pictures.theme import BLUE, GREY, ORANGE, WEAR_MAP
from tribodyn.workflows.studies.scans.wear_coefficient import WearCoefficient


def worn_face(face: WornFace, title: str) -> Figure:
    """Both scans levelled, the depth with the border of what wore, and a profile through the deepest place."""
    x, y = (1e3 * values for values in face.pair.grid)
    depth = face.map
    unit, scale = length_unit(face.deepest)
    row = int(np.argmax(np.where(face.region, depth.z, -np.inf).max(axis=1)))
    scans = [centred(level(scan)) for scan in (face.pair.pristine, face.pair.worn)]
    low, high = 1e6 * np.nanpercentile(scans[1].z, (0.5, 99.5))
    with axes_of(9.2, 7.4, rows=2, columns=2, share=False) as (figure, axes):
        for pane, scan, name in zip(axes[0], scans, ("pristine", "worn, as scanned"), strict=True):
            _map(pane, 1e3 * scan.x, 1e3 * scan.y, 1e6 * scan.z, "height / µm", (low, high))
            pane.set_title(name)
        _map(axes[1, 0], x[:, 0], y[0], scale * depth.z, f"depth / {unit}", (0.0, scale * max(face.deepest, 1e-12)))
        if face.worn.any():
            axes[1, 0].contour(x, y, face.worn, [0.5], colors=ORANGE, linewidths=0.8)
        axes[1, 0].axvline(x[row, 0], color=GREY, lw=0.8, ls="--")
        axes[1, 0].set_title("depth, border of what wore")
        axes[1, 1].plot(y[row], -scale * face.depth[row], color=GREY, lw=0.6, label="points")
        axes[1, 1].plot(y[row], -scale * depth.z[row], color=BLUE, label="mean of neighbours")
        axes[1, 1].set(xlabel="y / mm", ylabel=f"- depth / {unit}", title=f"profile at x = {x[row, 0]:.3g} mm")
        axes[1, 1].legend()
        figure.suptitle(title, x=0.01, ha="left")
    return figure


def _map(axes: Any, x: np.ndarray, y: np.ndarray, values: np.ndarray, label: str, limits: tuple[float, float]) -> None:
    step = max(max(values.shape) // 300, 1)  # more points than the picture shows would only make it large
    x, y, values = x[::step], y[::step], values[::step, ::step].T
    shown = axes.pcolormesh(x, y, values, cmap=WEAR_MAP, vmin=limits[0], vmax=limits[1], rasterized=True)
    axes.set(aspect="equal", xlabel="x / mm", ylabel="y / mm")
    axes.grid(visible=False)
    axes.figure.colorbar(shown, ax=axes, label=label, shrink=0.85)


def coefficient_line(fit: WearCoefficient) -> Figure:
    """Worn volume of every test over its friction work, with the line through zero and its 95 % interval."""
    work = np.array([0.0, 1.05 * fit.work.max()])
    with axes_of() as (figure, axes):
        error = 1.96e9 * fit.deviation if fit.deviation.any() else None
        axes.errorbar(fit.work, 1e9 * fit.volume, error, fmt="o", color=ORANGE, capsize=3, label="tests, 95 %")
        axes.plot(work, 1e9 * fit.value * work, color=BLUE, label=f"{1e18 * fit.value:.4g} µm³/J")
        low, high = fit.interval
        label = "95 % of the slope" if len(fit.work) > 1 else "95 %, without the scatter between tests"
        axes.fill_between(work, 1e9 * low * work, 1e9 * high * work, color=BLUE, alpha=0.15, lw=0, label=label)
        axes.set(xlabel="friction work / J", ylabel="worn volume / mm³", xlim=(0, None), title="Wear coefficient")
        axes.legend()
    return figure
