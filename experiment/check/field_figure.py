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
from typing import TYPE_CHECKING, Any, Final, Literal

import numpy as np

from experiment.check.check_report import burst_words
from experiment.check.field import PlateMap
from experiment.check.field_report import (
    FRAMES_PER_S,
    hertz,
    in_lines,
    map_title,
    prefixed,
    slowed,
    strip_text,
)
from experiment.check.plate import draw_outlines, outline_keys

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.image import AxesImage
    from matplotlib.lines import Line2D

    from experiment.check.field import PlateBand, PlateMotion
    from experiment.check.plate import PlatePreview


_MAP_WIDTH_IN: Final = 7.6
_MAP_HEIGHT_IN: Final = 3.2
_LEAST_IN: Final = 4.8
"""The legend needs the least width."""

_SMALL_PER_IN: Final = 13.5
_PER_IN: Final = 14.0
_LARGE_PER_IN: Final = 11.0
"""Letters that have room in an inch of the legend, of a panel's title, and of the heading."""

_MOTION_IN: Final = (9.0, 4.4)
_MOTION_DPI: Final = 100
"""Videos want even numbers of pixels."""

_DRIVEN: Final = "#EEEEEE"
_BAND_PANEL_IN: Final = (4.4, 3.8)
_LEAST_DB: Final = -60.0

# Okabe & Ito's colours for all kinds of colour vision.
_OWN: Any = {"color": "#0072B2", "lw": 1.6}
_OTHERS: tuple[Any, ...] = (
    {"color": "#D55E00", "lw": 1.6, "ls": (0, (5, 2))},
    {"color": "#009E73", "lw": 1.6, "ls": (0, (2, 1.5))},
)
_LIMIT: Any = {"color": "#666666", "lw": 0.9, "ls": "-."}
_CUTOFF: Any = {"color": "black", "lw": 0.9, "ls": (0, (1, 1.5)), "zorder": 1}

_LEAST_PART: Final = 1e-7
"""Smallest displacement shown of a band, as a part of its largest."""

_FEW_DECADES: Final = 100.0
"""Axes that span less than this factor have ticks between the powers of ten."""

_LEAST_DECIMAL: Final = 1e-4
"""Axes that begin here or higher have decimal numbers."""

_LABELLED: Final = 0.04
"""Cut-offs nearer to each other than this part of the axis share the first one's label."""

_TOLERATED: Final = (
    "constrained_layout not applied",
    "Glyph .* missing from font",
    "Matplotlib currently does not support .* natively",
)
"""Names too long for a panel, or in letters that the font lacks, are no reason to stop."""
_STYLE: Any = {
    "font.size": 9.0,
    "axes.titlesize": 9.0,
    "figure.titlesize": 10.5,
    "svg.hashsalt": "tactstrip",
    "text.parse_math": False,
    "figure.dpi": 100.0,
    "savefig.dpi": 200.0,
}


def render(field: PlateMap | PlateBand, file_type: Literal["png", "svg"]) -> bytes:
    """Draw a field: a panel for each actuator, driven alone.

    A map shows the level of the displacement re its largest, with outlines of the patches and of
    the fingertips' contact; a band shows the displacement at both fingers.

    Parameters
    ----------
    field : PlateMap or PlateBand
        What to draw.
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
        metadata = {"Date": None} if file_type == "svg" else None
        figure.savefig(file, format=file_type, metadata=metadata)
    return file.getvalue()


@contextlib.contextmanager
def _styled() -> Iterator[None]:
    """Draw as nobody's settings but these have it."""
    import matplotlib as mpl

    with mpl.rc_context(), warnings.catch_warnings():
        for message in _TOLERATED:
            warnings.filterwarnings("ignore", message, UserWarning)
        mpl.rcdefaults()
        mpl.rcParams.update(_STYLE)
        yield


def _new_figure(size_in: tuple[float, float]) -> Figure:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=size_in, layout="constrained")
    FigureCanvasAgg(figure)
    return figure


# --- the map --------------------------------------------------------------------------------------


def _map_figure(field: PlateMap) -> Figure:
    plate = field.plate
    names = plate.drive.names
    span_m, width_m = float(np.ptp(field.x_m)), float(np.ptp(field.y_m))
    panel_in = min(_MAP_WIDTH_IN * width_m / span_m, _MAP_HEIGHT_IN)
    across_in = panel_in * span_m / width_m
    titles = [
        "\n".join(in_lines(one, max(across_in, _LEAST_IN), _PER_IN) for one in map_title(field, i))
        for i, _ in enumerate(names)
    ]
    title_in = 0.1 + 0.2 * max(1 + title.count("\n") for title in titles)
    figure = _new_figure(
        (max(across_in, _LEAST_IN) + 1.6, len(names) * (panel_in + title_in) + 1.5)
    )
    panels = figure.subplots(len(names), 1, squeeze=False, sharex=True).ravel()
    for driven, axes in enumerate(panels):
        image = _draw_level(axes, field, driven)
        draw_outlines(axes, plate)
        axes.set_title(titles[driven], loc="left")
        axes.set_ylabel("y (mm)")
    panels[-1].set_xlabel("x along the plate, from its middle (mm)")
    bar = figure.colorbar(image, ax=list(panels), extend="min", aspect=25, pad=0.02)
    bar.set_label("|u| (dB re the panel's largest)")
    bar.ax.axhline(-plate.masking_limit_db, color="black", lw=1.4)
    what = f"displacement at {hertz(field.frequency_hz)}"
    _head(figure, plate, what)
    _legend(figure, _map_keys(plate), plate.remark)
    return figure


def _draw_level(axes: Axes, field: PlateMap, driven: int) -> AxesImage:
    size_m = np.abs(field.displacement_m[driven])
    floor = 10 ** ((_LEAST_DB - 20) / 20)
    largest_m = float(np.max(size_m)) or 1.0
    level = 20 * np.log10(np.maximum(size_m / largest_m, floor))
    x_mm, y_mm = field.x_m * 1e3, field.y_m * 1e3
    half_x, half_y = (x_mm[1] - x_mm[0]) / 2, (y_mm[1] - y_mm[0]) / 2
    image = axes.imshow(
        level.T,
        origin="lower",
        aspect="equal",
        interpolation="bilinear",
        cmap="viridis",
        vmin=_LEAST_DB,
        vmax=0.0,
        extent=(x_mm[0] - half_x, x_mm[-1] + half_x, y_mm[0] - half_y, y_mm[-1] + half_y),
    )
    axes.contour(
        x_mm,
        y_mm,
        level.T,
        levels=[-field.plate.masking_limit_db],
        colors="black",
        linewidths=1.4,
        linestyles="solid",
    )
    axes.set_xlim(x_mm[0], x_mm[-1])
    axes.set_ylim(y_mm[0], y_mm[-1])
    return image


def _map_keys(plate: PlatePreview) -> list[Line2D]:
    from matplotlib.lines import Line2D

    limit = f"−{plate.masking_limit_db:g} dB, the masking limit, re the largest (tone)"
    return [*outline_keys(plate), Line2D([], [], color="black", lw=1.4, label=limit)]


def _head(figure: Figure, plate: PlatePreview, what: str) -> None:
    words = f"{plate.study.name}: {what}; {strip_text(plate)}"
    figure.suptitle(in_lines(words, figure.get_figwidth(), _LARGE_PER_IN))


def _legend(figure: Figure, keys: Sequence[Artist], remark: str) -> None:
    """Explain the lines below the panels, and say what the displacements rest on."""
    figure.legend(
        handles=keys,
        loc="outside lower center",
        ncols=len(keys),
        frameon=False,
        title=in_lines(remark, figure.get_figwidth(), _SMALL_PER_IN),
        title_fontsize=8,
    )


# --- the band -------------------------------------------------------------------------------------


def _band_figure(field: PlateBand) -> Figure:
    plate = field.plate
    names = plate.drive.names
    figure = _new_figure((_BAND_PANEL_IN[0] * len(names), _BAND_PANEL_IN[1]))
    panels = figure.subplots(1, len(names), squeeze=False, sharey=True).ravel()
    largest_m = float(np.max(np.abs(field.at_fingers_m)))
    unit, factor = prefixed(largest_m)
    for driven, axes in enumerate(panels):
        _draw_response(axes, field, driven, factor)
        _draw_cutoffs(axes, field)
        _dress(axes, field, largest_m / factor)
        axes.set_title(f"{names[driven]} actuator driven")
    panels[0].set_ylabel(f"|u| ({unit.replace('um', 'µm')}{plate.drive.per_any_load})")
    _head(figure, plate, "displacement at the fingers")
    _legend(figure, _band_keys(plate), plate.remark)
    return figure


def _draw_response(axes: Axes, field: PlateBand, driven: int, factor: float) -> None:
    size = np.abs(field.at_fingers_m[driven]) / factor
    limit = size[driven] * 10 ** (-field.plate.masking_limit_db / 20)
    axes.plot(field.frequencies_hz, size[driven], **_OWN)
    for other, style in zip(field.plate.others_of(driven), _OTHERS, strict=False):
        axes.plot(field.frequencies_hz, size[other], **style)
    axes.plot(field.frequencies_hz, limit, **_LIMIT)


def _draw_cutoffs(axes: Axes, field: PlateBand) -> None:
    """Draw the cut-offs, and write them at the panel's top, so far as there is room."""
    lower_hz, upper_hz = field.band_hz
    step_hz = _LABELLED * (upper_hz - lower_hz)
    labelled_hz: list[float] = []
    for cutoff_hz in field.cutoffs_hz:
        axes.axvline(cutoff_hz, **_CUTOFF)
        if not labelled_hz or cutoff_hz - labelled_hz[-1] >= step_hz:
            labelled_hz.append(cutoff_hz)
    top = axes.secondary_xaxis("top")
    labels = [f"{cutoff_hz:.0f} Hz" for cutoff_hz in labelled_hz]
    top.set_xticks(labelled_hz, labels, rotation=90 if len(labels) > 1 else 0, fontsize=8)


def _power(value: float) -> str:
    """Write a power of ten; formulas are off, as study names may have dollar signs."""
    return "10" + f"{math.log10(value):.0f}".translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))


def _dress(axes: Axes, field: PlateBand, largest: float) -> None:
    from matplotlib.ticker import LogLocator, NullFormatter

    axes.set_yscale("log")
    lowest = max(axes.get_ylim()[0], largest * _LEAST_PART)
    axes.set_ylim(bottom=lowest)
    few = largest / lowest < _FEW_DECADES
    axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if few else (1.0,)))
    in_powers = lowest < _LEAST_DECIMAL and not few
    axes.yaxis.set_major_formatter(lambda value, _: _power(value) if in_powers else f"{value:g}")
    axes.yaxis.set_minor_formatter(NullFormatter())
    axes.set_xlim(*field.band_hz)
    axes.set_xlabel("Frequency (Hz)")
    axes.grid(color="#E5E5E5", lw=0.6)
    axes.set_axisbelow(True)


def _band_keys(plate: PlatePreview) -> list[Line2D]:
    limit = f"−{plate.masking_limit_db:g} dB re above the actuator (masking limit)"
    styles = [(_OWN, "above the actuator"), (_OTHERS[0], "other finger")]
    if any(len(plate.others_of(driven)) > 1 for driven, _ in enumerate(plate.loads)):
        styles.append((_OTHERS[1], "other finger, the right of two"))
    styles += [(_LIMIT, limit), (_CUTOFF, "cut-off")]
    return [_key(label, style) for style, label in styles]


def _key(label: str, style: Any) -> Line2D:
    from matplotlib.lines import Line2D

    return Line2D([], [], label=label, **style)


# --- the motion -----------------------------------------------------------------------------------


def animate(
    motion: PlateMotion, file_type: Literal["gif", "mp4"], shown: Callable[[int, int], object]
) -> bytes:
    """Draw the plate in time: the left actuator driven, then the right one.

    `shown` is told of every frame how many there are now, and of how many. An MP4 needs ffmpeg.
    """
    from matplotlib.animation import FFMpegWriter, PillowWriter

    writer = (PillowWriter if file_type == "gif" else FFMpegWriter)(fps=FRAMES_PER_S)
    n_driven, n_times = motion.displacement_m.shape[:2]
    with _styled(), tempfile.TemporaryDirectory() as folder:
        figure, draw = _moving_figure(motion)
        path = Path(folder) / f"motion.{file_type}"
        with writer.saving(figure, path, dpi=_MOTION_DPI):
            for frame in range(n_driven * n_times):
                draw(*divmod(frame, n_times))
                writer.grab_frame()
                shown(frame + 1, n_driven * n_times)
        return path.read_bytes()


def _moving_figure(motion: PlateMotion) -> tuple[Figure, Callable[[int, int], None]]:
    """Return a figure, and what draws the frame of an actuator at a time into it.

    All that stands still is drawn once; what moves is drawn over its pixels, and they are what a
    writer gets when it saves the figure: matplotlib would draw everything anew, twice.
    """
    plate, name_of = motion.plate, motion.plate.drive.names
    size_m = float(np.max(np.abs(motion.displacement_m)))
    unit, factor = prefixed(size_m)
    figure, over, fingers = _still_figure(motion, unit.replace("um", "µm"), size_m / factor)
    image, title = over.images[0], over.set_title(" ", loc="left")
    draw_outlines(over, plate)
    lines = [fingers.plot([], [], **style)[0] for style in (_OWN, _OTHERS[0])]
    moving: list[Artist] = [image, *over.patches, title, *lines]
    for artist in moving:
        artist.set_animated(True)
    canvas: Any = figure.canvas
    canvas.draw()
    still = canvas.copy_from_bbox(figure.bbox)
    vars(figure)["savefig"] = lambda file, **_: file.write(canvas.buffer_rgba())

    def draw(driven: int, time: int) -> None:
        now_s = motion.times_s[time]
        past = motion.finger_times_s <= now_s + motion.step_s / 1000
        image.set_data(motion.displacement_m[driven, time].T / factor)
        for line, finger in zip(lines, (driven, *plate.others_of(driven)), strict=True):
            seen_m = motion.at_fingers_m[driven, finger, past]
            line.set_data(motion.finger_times_s[past] * 1e3, seen_m / factor)
        title.set_text(f"{name_of[driven]} actuator driven, t = {now_s * 1e3:.2f} ms")
        canvas.restore_region(still)
        for artist in moving:
            figure.draw_artist(artist)

    return figure, draw


def _still_figure(motion: PlateMotion, unit: str, largest: float) -> tuple[Figure, Axes, Axes]:
    """Lay out what stands still in all frames, with its two panels."""
    from matplotlib.patches import Patch

    plate, drive = motion.plate, motion.plate.study.conditions[0].drive
    label = f"u ({unit}{plate.drive.per_any_load})"
    figure = _new_figure(_MOTION_IN)
    figure.set_dpi(_MOTION_DPI)
    over, fingers = figure.subplots(2, 1, height_ratios=(1.0, 1.2))
    image = _moving_image(over, motion, largest)
    over.set(xlabel="x along the plate, from its middle (mm)", ylabel="y (mm)", title=" ")
    figure.colorbar(image, ax=over, pad=0.02).set_label(label)
    end_ms = motion.finger_times_s[-1] * 1e3
    fingers.axvspan(0.0, min(drive.duration_s * 1e3, end_ms), color=_DRIVEN)
    fingers.set(xlim=(0.0, end_ms), ylim=(-1.1 * largest, 1.1 * largest))
    fingers.set(xlabel="time (ms)", ylabel=label)
    words = f"{burst_words(plate.study.conditions[0])}; slowed {slowed(motion):g} times"
    _head(figure, plate, words)
    lines = [(_OWN, "above the actuator"), (_OTHERS[0], "other finger")]
    keys: list[Artist] = [*outline_keys(plate), *(_key(what, style) for style, what in lines)]
    keys.append(Patch(color=_DRIVEN, label="while driven"))
    _legend(figure, keys, f"{plate.basis}; each actuator driven alone")
    figure.draw_without_rendering()
    figure.set_layout_engine("none")
    return figure, over, fingers


def _moving_image(axes: Axes, motion: PlateMotion, largest: float) -> AxesImage:
    x_mm, y_mm = motion.x_m * 1e3, motion.y_m * 1e3
    half_x, half_y = (x_mm[1] - x_mm[0]) / 2, (y_mm[1] - y_mm[0]) / 2
    image = axes.imshow(
        np.zeros((y_mm.size, x_mm.size)),
        origin="lower",
        aspect="equal",
        interpolation="bicubic",
        cmap="RdBu_r",
        vmin=-largest,
        vmax=largest,
        extent=(x_mm[0] - half_x, x_mm[-1] + half_x, y_mm[0] - half_y, y_mm[-1] + half_y),
    )
    axes.set(xlim=(x_mm[0], x_mm[-1]), ylim=(y_mm[0], y_mm[-1]))
    return image
