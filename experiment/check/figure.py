"""The field of a study's actuators as a figure, PNG or SVG, with the same bytes on every run.

A field in time is an animation, GIF or MP4.
"""

from __future__ import annotations

import contextlib
import io
import math
import tempfile
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from experiment.check.field import FRAMES_PER_S, PlateMap, slowdown
from experiment.check.plate import draw_outlines, outline_keys
from experiment.check.report import CREATOR, burst_text, format_level

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.image import AxesImage
    from matplotlib.lines import Line2D

    from experiment.check.field import PlateBand, PlateMotion
    from experiment.check.plate import PlatePreview, Real


_MAP_WIDTH_IN: Final = 7.6
_MAP_HEIGHT_IN: Final = 3.2
_MIN_WIDTH_IN: Final = 4.8
"""The legend needs this width."""
_MOTION_IN: Final = (9.0, 4.4)
_MOTION_DPI: Final = 100
"""Videos want even numbers of pixels."""
_BAND_PANEL_IN: Final = (4.4, 3.8)
_MAX_COLUMNS: Final = 4
_MIN_DB: Final = -60.0
_MIN_BAND_DB: Final = -100.0
"""Smallest levels that a map and a band show."""
# Okabe & Ito's colours for all kinds of colour vision.
_DRIVEN_LINE: Any = {"color": "#0072B2", "lw": 1.6}
_UNDRIVEN_LINE: Any = {"color": "#D55E00", "lw": 1.6, "ls": (0, (5, 2))}
_MOVING_LINES: Final = {"driven finger": _DRIVEN_LINE, "undriven finger": _UNDRIVEN_LINE}
_LEVEL: Any = {"color": "black", "lw": 1.4}
_CONTOUR: Any = {"colors": "black", "linewidths": 1.4, "linestyles": "solid"}
_LIMIT: Any = {"color": "#666666", "lw": 0.9, "ls": "-."}
_CUTOFF: Any = {"color": "black", "lw": 0.9, "ls": (0, (1, 1.5)), "zorder": 1}
_WHILE_DRIVEN: Final = "#EEEEEE"

_TOLERATED: Final = (
    "constrained_layout not applied",
    "Glyph .* missing from font",
    "Matplotlib currently does not support .* natively",
)
"""Names too long for a panel, or in letters that the font lacks, are no reason to stop."""


def render(field: PlateMap | PlateBand, file_type: str) -> bytes:
    """Draw a field: a panel for each actuator, driven alone.

    A map shows the level of the displacement re its largest, with outlines of the patches and of
    the fingertips; a band shows the displacement at the undriven finger re the driven one.

    Parameters
    ----------
    field : PlateMap or PlateBand
        The field.
    file_type : str
        ``png`` or ``svg``.

    Returns
    -------
    bytes
        The contents of the file, the same on every run.
    """
    with _styled():
        figure = _map_figure(field) if isinstance(field, PlateMap) else _band_figure(field)
        file = io.BytesIO()
        dated = {"Creator": CREATOR, "Date": None}
        creator = dated if file_type == "svg" else {"Software": CREATOR}
        figure.savefig(file, format=file_type, metadata=creator)
    return file.getvalue()


@contextlib.contextmanager
def _styled() -> Iterator[None]:
    """Use this style, whatever the user's settings are."""
    from matplotlib import style

    with style.context(["default", "experiment.check.field"]), warnings.catch_warnings():
        for message in _TOLERATED:
            warnings.filterwarnings("ignore", message, UserWarning)
        yield


def _panel_title(plate: PlatePreview, driven: int) -> str:
    """Name the driven actuator, and the crosstalk of its burst where it is known."""
    title = f"{plate.names[driven]} actuator driven"
    for level_db, error_db in plate.burst_levels_db[driven : driven + 1]:
        if level_db is not None:
            level = format_level(level_db, error_db).replace("-", "−")
            title += f"; crosstalk of the burst {level}"
    return title


def _cutoff(plate: PlatePreview) -> str:
    return f"cut-off {plate.strip.cutoff_hz():.5g} Hz"


def _keys(styles: dict[str, Any]) -> list[Line2D]:
    from matplotlib.lines import Line2D

    return [Line2D([], [], label=label, **style) for label, style in styles.items()]


def _legend(figure: Figure, plate: PlatePreview, keys: Sequence[Artist]) -> None:
    """Explain the lines below the panels, and what the displacements are for."""
    figure.legend(
        handles=keys,
        loc="outside lower center",
        ncols=len(keys),
        frameon=False,
        title=f"each actuator driven alone, {plate.load}",
        title_fontsize=8,
    )


def _draw_image(
    axes: Axes, field: PlateMap | PlateMotion, values: Real, low: float, high: float, **style: Any
) -> AxesImage:
    """Draw values over the plate, shape (n_x, n_y), in millimetres."""
    x_mm, y_mm = field.x_m * 1e3, field.y_m * 1e3
    half_x, half_y = (x_mm[1] - x_mm[0]) / 2, (y_mm[1] - y_mm[0]) / 2
    image = axes.imshow(
        values.T,
        origin="lower",
        aspect="equal",
        vmin=low,
        vmax=high,
        extent=(x_mm[0] - half_x, x_mm[-1] + half_x, y_mm[0] - half_y, y_mm[-1] + half_y),
        **style,
    )
    axes.set(xlim=(x_mm[0], x_mm[-1]), ylim=(y_mm[0], y_mm[-1]), ylabel="y (mm)")
    return image


# --- the map --------------------------------------------------------------------------------------


def _map_figure(field: PlateMap) -> Figure:
    from matplotlib.figure import Figure

    plate, names, limit_db = field.plate, field.plate.names, field.plate.masking_threshold_db
    span_m, width_m = float(np.ptp(field.x_m)), float(np.ptp(field.y_m))
    panel_in = min(_MAP_WIDTH_IN * width_m / span_m, _MAP_HEIGHT_IN)
    across_in = max(panel_in * span_m / width_m, _MIN_WIDTH_IN)
    size_in = (across_in + 1.6, len(names) * (panel_in + 0.3) + 1.2)
    figure = Figure(figsize=size_in, layout="constrained")
    panels = figure.subplots(len(names), 1, squeeze=False, sharex=True).ravel()
    for driven, axes in enumerate(panels):
        size_m = np.abs(field.displacement_m[driven])
        floor = 10 ** ((_MIN_DB - 20) / 20)
        level_db = 20 * np.log10(np.maximum(size_m / (float(np.max(size_m)) or 1.0), floor))
        style = {"interpolation": "bilinear", "cmap": "viridis"}
        image = _draw_image(axes, field, level_db, _MIN_DB, 0.0, **style)
        axes.contour(field.x_m * 1e3, field.y_m * 1e3, level_db.T, [-limit_db], **_CONTOUR)
        draw_outlines(axes, plate)
        axes.set_title(_panel_title(plate, driven))
    panels[-1].set_xlabel("x (mm)")
    bar = figure.colorbar(image, ax=list(panels), extend="min", aspect=25, pad=0.02)
    bar.set_label("|u| (dB re its largest)")
    bar.ax.axhline(-limit_db, **_LEVEL)
    figure.suptitle(f"{field.frequency_hz:g} Hz; {_cutoff(plate)}")
    _legend(figure, plate, [*outline_keys(plate), *_keys({f"−{limit_db:g} dB": _LEVEL})])
    return figure


# --- the band -------------------------------------------------------------------------------------


def _band_figure(field: PlateBand) -> Figure:
    from matplotlib.figure import Figure

    plate, names, limit_db = field.plate, field.plate.names, field.plate.masking_threshold_db
    width_in, height_in = _BAND_PANEL_IN
    columns = min(len(names), _MAX_COLUMNS)
    rows = math.ceil(len(names) / columns)
    figure = Figure(figsize=(width_in * columns, height_in * rows), layout="constrained")
    panels = figure.subplots(rows, columns, squeeze=False, sharey=True).ravel()
    for axes in panels[len(names) :]:
        axes.set_axis_off()
    for driven, axes in enumerate(panels[: len(names)]):
        for other in plate.others_of(driven):
            axes.plot(field.frequencies_hz, field.level_db(driven, other), **_UNDRIVEN_LINE)
        axes.axhline(-limit_db, **_LIMIT)
        for cutoff_hz in field.cutoffs_hz:
            axes.axvline(cutoff_hz, **_CUTOFF)
        title = _panel_title(plate, driven)
        axes.set(title=title, xlabel="Frequency (Hz)", xlim=field.band_hz)
        axes.set_ylim(bottom=max(axes.get_ylim()[0], _MIN_BAND_DB))
        axes.grid(visible=True)
        axes.set_axisbelow(True)
    panels[0].set_ylabel("undriven finger (dB re driven finger)")
    figure.suptitle(f"crosstalk of tones; {_cutoff(plate)}")
    limit = f"limit −{limit_db:g} dB"
    styles = {"undriven finger": _UNDRIVEN_LINE, limit: _LIMIT, "cut-off": _CUTOFF}
    _legend(figure, plate, _keys(styles))
    return figure


# --- the motion -----------------------------------------------------------------------------------


def animate(motion: PlateMotion, file_type: str, shown: Callable[[int, int], object]) -> bytes:
    """Draw the plate in time, with one actuator driven after the other.

    `shown` is called with the number of frames that are drawn, and with that of all. An MP4 needs
    ffmpeg.
    """
    from matplotlib.animation import FFMpegWriter, FuncAnimation, PillowWriter

    writer = (PillowWriter if file_type == "gif" else FFMpegWriter)(fps=FRAMES_PER_S)
    n_driven, n_times = motion.displacement_m.shape[:2]
    with _styled(), tempfile.TemporaryDirectory() as folder:
        figure, draw = _moving_figure(motion)
        path = Path(folder) / f"motion.{file_type}"
        animation = FuncAnimation(figure, draw, frames=n_driven * n_times)
        animation.save(path, writer, dpi=_MOTION_DPI, progress_callback=shown)
        return path.read_bytes()


def _moving_figure(motion: PlateMotion) -> tuple[Figure, Callable[[int], Sequence[Artist]]]:
    """Return a figure, and what draws a frame into it: the times of one actuator, then another."""
    from matplotlib.figure import Figure

    plate = motion.plate
    figure = Figure(figsize=_MOTION_IN, dpi=_MOTION_DPI, layout="constrained")
    over, fingers = figure.subplots(2, 1, height_ratios=(1.0, 1.2))
    image = _draw_still(figure, over, fingers, motion)
    title = over.set_title(" ")
    draw_outlines(over, plate)
    styles = [_DRIVEN_LINE, *[_UNDRIVEN_LINE] * (len(plate.fingers) - 1)]
    lines = [fingers.plot([], [], **style)[0] for style in styles]

    def draw(frame: int) -> Sequence[Artist]:
        driven, time = divmod(frame, motion.times_s.size)
        now_s = motion.times_s[time]
        past = motion.finger_times_s <= now_s + motion.step_s / 1000
        image.set_data(motion.displacement_m[driven, time].T)
        for line, finger in zip(lines, (driven, *plate.others_of(driven)), strict=True):
            seen_m = motion.at_fingers_m[driven, finger, past]
            line.set_data(motion.finger_times_s[past] * 1e3, seen_m)
        title.set_text(f"{plate.names[driven]} actuator driven, t = {now_s * 1e3:.2f} ms")
        return image, title, *lines

    return figure, draw


def _draw_still(figure: Figure, over: Axes, fingers: Axes, motion: PlateMotion) -> AxesImage:
    """Draw what does not move, and return the image of the plate at rest."""
    from matplotlib.patches import Patch
    from matplotlib.ticker import EngFormatter

    plate, condition = motion.plate, motion.plate.study.conditions[0]
    largest_m = float(np.max(np.abs(motion.displacement_m)))
    style = {"interpolation": "bicubic", "cmap": "RdBu_r"}
    at_rest_m = 0.0 * motion.displacement_m[0, 0]
    image = _draw_image(over, motion, at_rest_m, -largest_m, largest_m, **style)
    over.set(xlabel="x (mm)", title=" ")
    figure.colorbar(image, ax=over, pad=0.02, format=EngFormatter("m")).set_label("u")
    end_ms = motion.finger_times_s[-1] * 1e3
    fingers.axvspan(0.0, min(condition.drive.duration_s * 1e3, end_ms), color=_WHILE_DRIVEN)
    fingers.set(xlim=(0.0, end_ms), ylim=(-1.1 * largest_m, 1.1 * largest_m))
    fingers.set(xlabel="time (ms)", ylabel="u")
    fingers.yaxis.set_major_formatter(EngFormatter("m"))
    figure.suptitle(f"{burst_text(condition)}; slowed {slowdown(motion):g} times; {_cutoff(plate)}")
    driven = Patch(color=_WHILE_DRIVEN, label="while driven")
    _legend(figure, plate, [*outline_keys(plate), *_keys(_MOVING_LINES), driven])
    figure.draw_without_rendering()
    figure.set_layout_engine("none")
    return image
