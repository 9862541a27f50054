"""The tables of study.toml: every key with its type, its default and what it means.

The defaults are the paper's protocol. Types, words and unknown keys are refused here; the ranges
belong to the values of `experiment.study_values`, but for lengths, which the file has in mm.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal, Self, get_args

from pydantic import BaseModel, ConfigDict, Field, model_validator

from experiment.actuator import Shape, Side
from experiment.design import Anticipated, ConditionOrder, Order
from experiment.study_values import DriverName, EdgeBasis, Noise
from stimuli.windows import Window

PAPER_CUTOFF_HZ = 2900.0
"""First cut-off measured on the paper's plate (figure 4)."""

_Above0 = Annotated[float, Field(gt=0)]


class Table(BaseModel):
    """A table that refuses unknown keys, numbers as text, and values that are not finite."""

    model_config = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False)


class StudyTable(Table):
    """What the study is called."""

    name: str = Field("paper", description="1 to 32 of A-Z a-z 0-9 _ -")


class StripTable(Table):
    """The plate, held along its two long edges."""

    width_mm: _Above0 = Field(25.0, description="between the held edges")
    length_mm: _Above0 | Literal["endless"] = Field(200.0, description='or "endless"')
    thickness_mm: _Above0 = Field(0.5)
    youngs_modulus_gpa: _Above0 = Field(67.0, description="aluminium")
    poisson_ratio: float = Field(0.346)
    density_kg_m3: _Above0 = Field(2700.0)
    edge: EdgeBasis = Field("measured-cutoff")
    measured_cutoff_hz: _Above0 | None = Field(
        None, description="first cut-off as measured; with edge = measured-cutoff"
    )
    edge_stiffness_n: _Above0 | None = Field(
        None, description="N m per rad per m of edge; with edge = elastic"
    )

    @model_validator(mode="after")
    def _edge_has_its_key(self) -> Self:
        """Ask for the one key of the edge; only the paper's plate has a known cut-off."""
        keys = {"measured-cutoff": "measured_cutoff_hz", "elastic": "edge_stiffness_n"}
        if self.edge == "measured-cutoff" and self.measured_cutoff_hz is None and self._is_paper():
            self.measured_cutoff_hz = PAPER_CUTOFF_HZ
        for edge, key in keys.items():
            given = getattr(self, key)
            if self.edge == edge and given is None:
                raise ValueError(f"{key} is missing; edge = {edge} needs it")
            if self.edge != edge and given is not None:
                raise ValueError(f"{key} is for edge = {edge} only; got edge = {self.edge}")
        return self

    def _is_paper(self) -> bool:
        """Tell whether what the cut-off depends on was left out or repeats the paper's value."""
        fields = type(self).model_fields
        given = self.model_fields_set - {"length_mm"}
        return all(getattr(self, key) == fields[key].default for key in given)


class ActuatorTable(Table):
    """A patch under the strip, and the finger above it; one left, one right."""

    side: Side = Field(description="as the participant sees it")
    shape: Shape = Field("disc")
    x_mm: float = Field(description="centre along the strip, from its middle, right positive")
    y_mm: float | None = Field(None, description="centre across, from one edge; default the middle")
    diameter_mm: _Above0 | None = Field(None, description="of a disc")
    length_x_mm: _Above0 | None = Field(None, description="of a rectangle, along the strip")
    length_y_mm: _Above0 | None = Field(None, description="of a rectangle, across the strip")

    @model_validator(mode="after")
    def _shape_has_its_sizes(self) -> Self:
        sizes = {"disc": ("diameter_mm",), "rectangle": ("length_x_mm", "length_y_mm")}
        for shape, keys in sizes.items():
            for key in keys:
                given = getattr(self, key) is not None
                if given != (shape == self.shape):
                    fault = f"is for shape = {shape} only" if given else "is missing"
                    raise ValueError(f"{key} {fault}; got shape = {self.shape}")
        return self


class BurstTable(Table):
    """What drives the actuators: a sine burst."""

    frequency_hz: float = Field(500.0)
    cycles: int = Field(1)
    window: Window = Field("none")
    max_energy_above_cutoff: float = Field(
        0.01, description="largest fraction of its energy above the strip's cut-off"
    )
    accept_unfit: str | None = Field(
        None, description="why an unfit burst is wanted all the same; recorded"
    )


class ConditionTable(Table):
    """A stimulus that runs the whole design; what it leaves out is taken from [burst]."""

    name: str = Field(description="1 to 32 of A-Z a-z 0-9 _ -")
    frequency_hz: float | None = None
    cycles: int | None = None
    window: Window | None = None
    accept_unfit: str | None = None

    def filled(self, burst: BurstTable) -> ConditionTable:
        """Return the condition with nothing left out.

        The reason for an unfit burst is taken over with the whole burst only: it is no reason for
        another one.
        """
        own = {
            key: value
            for key in ("frequency_hz", "cycles", "window", "accept_unfit")
            if (value := getattr(self, key)) is not None
        }
        reason = None if own else burst.accept_unfit
        inherited = burst.model_dump(exclude={"max_energy_above_cutoff", "accept_unfit"})
        return ConditionTable(**{"name": self.name, "accept_unfit": reason} | inherited | own)


class DesignTable(Table):
    """What is presented, how often, and what may be answered; for each condition."""

    levels_vpp: tuple[float, ...] = Field(
        (60.0, 95.0, 130.0, 165.0, 200.0), strict=False, description="increasing"
    )
    trials_per_side: int = Field(75, description="one finger at a time")
    both_trials: int = Field(5, description="both fingers at once")
    both_level: float | Literal["random"] = Field(
        "random", description="their level in Vpp; random: drawn from levels_vpp"
    )
    blank_trials: int = Field(0, description="no stimulus; needs the answer none")
    practice_trials: int = Field(0, description="with feedback, before the first block")
    order: Order = Field("random", description="balanced: each level equally often")
    condition_order: ConditionOrder = Field("random")
    responses: tuple[str, ...] = Field(
        ("left", "right", "both"), strict=False, description="of left, right, both, none"
    )
    foreperiod_s: tuple[float, float] = Field(
        (0.8, 2.0), strict=False, description="least and most wait before a stimulus"
    )
    response_window_s: float = Field(3.0, description="an answer is waited for so long")
    break_every: int = Field(31, description="trials; 0 for no break")
    minimum_break_s: float = Field(15.0, description="shortest break")
    anticipated: Anticipated = Field(
        "requeue", description="what becomes of a trial answered too early"
    )


class DeviceTable(Table):
    """What drives the actuators, and what it may do."""

    driver: DriverName = Field("mock")
    sample_rate_hz: float = Field(48_000.0, description="of its output")
    ceiling_vpp: float = Field(200.0, description="no level is ever above this")
    least_interval_s: float = Field(0.05, description="rest from a burst's end to the next onset")


class MaskingTable(Table):
    """The noise in the headphones that hides the sound of the actuators."""

    noise: Noise = Field("pink")
    max_level_dba: float = Field(75.0, description="at the ear; 80 at most")


class SimulationTable(Table):
    """The people that a dry run simulates."""

    threshold_vpp: float = Field(58.0, description="felt half of the time; median of the people")
    threshold_sd_db: float = Field(1.5, description="between people, of 20 log10(threshold)")
    sigma: float = Field(0.1, description="width of the psychometric function, log10 units")
    lapse_rate: float = Field(0.03, description="answers at random, whatever was felt")
    false_alarm_rate: float = Field(0.05, description="felt nothing, may say none, but guesses")
    side_bias: float = Field(0.5, description="left, in a guess between left and right")
    guess_both: float = Field(0.0, description="both, in a guess")
    crosstalk_db: float = Field(-30.0, description="amplitude at the other finger (paper, fig. 4)")
    reaction_time_s: float = Field(0.55, description="median, to a clear stimulus")
    reaction_time_spread: float = Field(0.3, description="standard deviation of its logarithm")


def _paper_actuators() -> tuple[ActuatorTable, ...]:
    return (
        ActuatorTable(side="left", x_mm=-35.0, diameter_mm=12.8),
        ActuatorTable(side="right", x_mm=35.0, diameter_mm=12.8),
    )


def _one_condition() -> tuple[ConditionTable, ...]:
    return (ConditionTable(name="main"),)


class StudyTables(Table):
    """A whole study.toml; after reading, nothing is left out."""

    study: StudyTable = Field(default_factory=StudyTable)
    strip: StripTable = Field(default_factory=StripTable)
    actuator: tuple[ActuatorTable, ...] = Field(default_factory=_paper_actuators, strict=False)
    burst: BurstTable = Field(default_factory=BurstTable)
    condition: tuple[ConditionTable, ...] = Field(default_factory=_one_condition, strict=False)
    design: DesignTable = Field(default_factory=DesignTable)
    device: DeviceTable = Field(default_factory=DeviceTable)
    masking: MaskingTable = Field(default_factory=MaskingTable)
    simulation: SimulationTable = Field(default_factory=SimulationTable)

    @model_validator(mode="after")
    def _fill(self) -> Self:
        """Put every actuator on the centre line that is nowhere else, and complete conditions."""
        for actuator in self.actuator:
            if actuator.y_mm is None:
                actuator.y_mm = self.strip.width_mm / 2
        self.actuator = tuple(sorted(self.actuator, key=lambda actuator: actuator.side))
        self.condition = tuple(condition.filled(self.burst) for condition in self.condition)
        return self


def section_table(section: str) -> type[Table]:
    """Return the table of a section: its keys, defaults and descriptions.

    Examples
    --------
    >>> section_table("actuator").__name__
    'ActuatorTable'
    """
    annotation: Any = StudyTables.model_fields[section].annotation
    table: type[Table] = next(iter(get_args(annotation)), annotation)
    return table
