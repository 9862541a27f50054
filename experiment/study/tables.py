"""The tables of study.toml: every key with its type, its default and what it means.

The defaults are the paper's protocol. Types, words and unknown keys are refused here; the ranges
belong to the values of `experiment.study.study`, but for lengths, which the file has in mm.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any, ClassVar, Final, Literal, Self, TypeVar, get_args

from pydantic import Field, model_validator

from experiment.study.sections.design import Anticipated, ConditionOrder, Order
from experiment.study.sections.equipment import DriverName, Noise
from experiment.study.sections.plate import SIDES, ActuatorTable, StripTable, paper_actuators
from experiment.study.sections.presentation_tables import (
    DatasetTable,
    KeysTable,
    ParticipantsTable,
    ScreenTable,
    TextsTable,
)
from experiment.study.sections.stimulus import BurstTable, ConditionTable
from experiment.study.sections.table import Above0, Table

if TYPE_CHECKING:
    from collections.abc import Callable


PAPER_THRESHOLD_UM: Final = 1.57
"""What 58 Vpp do above the paper's disc: half of the simulated people feel it."""
THRESHOLD_VPP: Final = 58.0
"""The same for actuators whose displacement is not known."""


class StudyTable(Table):
    """What the study is called, and what its participants agree to."""

    later: ClassVar[tuple[str, ...]] = ("consent_version",)

    name: str = Field("paper", description="1 to 32 of A-Z a-z 0-9 _ -")
    consent_version: str | None = Field(None, description="of the form that participants sign")


class DesignTable(Table):
    """What is presented, how often, and what may be answered; for each condition.

    The trials with the fingers off the plate come once: as many of each side, at the highest level.
    """

    later: ClassVar[tuple[str, ...]] = ("audibility_trials", "control_trials")

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
    audibility_trials: int = Field(
        0, description="fingers off, at the beginning: is the plate heard? even"
    )
    control_trials: int = Field(0, description="fingers off, at the end: the task as before; even")
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

    later: ClassVar[tuple[str, ...]] = ("port", "amplifier_gain", "volts_full_scale")

    driver: DriverName = Field("mock")
    sample_rate_hz: float = Field(48_000.0, description="of its output")
    ceiling_vpp: float = Field(200.0, description="no level is ever above this")
    least_interval_s: float = Field(0.05, description="rest from a burst's end to the next onset")
    port: str | None = Field(None, description="where a device is: port, URL or sound card")
    amplifier_gain: float | None = Field(
        None, description="volts at the actuator per volt of a generator"
    )
    volts_full_scale: float | None = Field(
        None, description="at the actuator, to both sides, of a sound card"
    )


class MaskingTable(Table):
    """The noise in the headphones that hides the sound of the actuators.

    To play it to a person, `run` needs sounddevice: pip install "tactstrip[audio]".
    """

    later: ClassVar[tuple[str, ...]] = (
        "measured_level_dba",
        "level_dbfs",
        "sound_card",
        "loop_s",
        "sample_rate_hz",
    )

    noise: Noise = Field("pink")
    max_level_dba: float = Field(75.0, description="at the ear; 80 at most")
    measured_level_dba: float | None = Field(None, description="at the ear, with these settings")
    level_dbfs: float = Field(-30.0, description="effective value re a full-scale sine's peak")
    sound_card: str = Field("", description="empty: the system's default")
    loop_s: float = Field(30.0, description="it is repeated without a seam")
    sample_rate_hz: float = Field(48_000.0)


class SimulationTable(Table):
    """The people that a dry run simulates."""

    later: ClassVar[tuple[str, ...]] = ("threshold_um", "crosstalk_db")

    threshold_um: Above0 | None = Field(
        None, description="displacement felt half of the time; median of the people"
    )
    threshold_vpp: float | None = Field(
        None, description="or the level that is, where displacements are unknown"
    )
    threshold_sd_db: float = Field(1.5, description="between people, of 20 log10(threshold)")
    sigma: float = Field(0.1, description="width of the psychometric function, log10 units")
    lapse_rate: float = Field(0.03, description="answers at random, whatever was felt")
    false_alarm_rate: float = Field(0.05, description="felt nothing, may say none, but guesses")
    side_bias: float = Field(0.5, description="left, in a guess between left and right")
    guess_both: float = Field(0.0, description="both, in a guess")
    crosstalk_db: float | None = Field(
        None, description="another level at the other finger than the computed one"
    )
    reaction_time_s: float = Field(0.55, description="median, to a clear stimulus")
    reaction_time_spread: float = Field(0.3, description="standard deviation of its logarithm")

    def fill(self, *, displacements_known: bool) -> None:
        """Put in the threshold that was left out, in the unit that the actuators allow."""
        if self.threshold_um is None and self.threshold_vpp is None:
            if displacements_known:
                self.threshold_um = PAPER_THRESHOLD_UM
            else:
                self.threshold_vpp = THRESHOLD_VPP
        if self.threshold_um is not None and self.threshold_vpp is not None:
            raise ValueError("threshold_um and threshold_vpp exclude each other; got both")
        if self.threshold_um is not None and not displacements_known:
            raise ValueError(
                "threshold_um needs the displacement or the layers of the left and the right "
                "actuator; give threshold_vpp"
            )


def _one_condition() -> tuple[ConditionTable, ...]:
    return (ConditionTable(name="main"),)


class StudyTables(Table):
    """A whole study.toml; after reading, nothing is left out."""

    later: ClassVar[tuple[str, ...]] = ("screen", "keys", "texts", "participants", "dataset")

    study: StudyTable = Field(default_factory=StudyTable)
    strip: StripTable = Field(default_factory=StripTable)
    actuator: tuple[ActuatorTable, ...] = Field(default_factory=paper_actuators, strict=False)
    burst: BurstTable = Field(default_factory=BurstTable)
    condition: tuple[ConditionTable, ...] = Field(default_factory=_one_condition, strict=False)
    design: DesignTable = Field(default_factory=DesignTable)
    device: DeviceTable = Field(default_factory=DeviceTable)
    masking: MaskingTable = Field(default_factory=MaskingTable)
    screen: ScreenTable = Field(default_factory=ScreenTable)
    keys: KeysTable = Field(default_factory=KeysTable)
    texts: TextsTable = Field(default_factory=TextsTable)
    participants: ParticipantsTable = Field(default_factory=ParticipantsTable)
    dataset: DatasetTable = Field(default_factory=DatasetTable)
    simulation: SimulationTable = Field(default_factory=SimulationTable)

    @model_validator(mode="after")
    def _fill(self) -> Self:
        """Put every actuator on the centre line that is nowhere else, and complete the rest."""
        for actuator in self.actuator:
            if actuator.y_mm is None:
                actuator.y_mm = self.strip.width_mm / 2
        self.actuator = tuple(
            sorted(self.actuator, key=lambda one: (SIDES.index(one.side), one.x_mm, one.y_mm))
        )
        self.condition = tuple(
            _at(f"condition[{i}]", partial(condition.filled, self.burst))
            for i, condition in enumerate(self.condition)
        )
        known = all(one.has_basis for one in self.actuator if one.side != "other")
        _at("simulation", lambda: self.simulation.fill(displacements_known=known))
        return self


_Value = TypeVar("_Value")


def _at(path: str, fill: Callable[[], _Value]) -> _Value:
    """Fill a table; a refusal gets the path of the table before its first word, the key."""
    try:
        return fill()
    except ValueError as error:
        raise ValueError(f"{path}.{error}") from error


def section_table(*steps: str) -> type[Table]:
    """Return the table that keys lead to: its keys, defaults and descriptions.

    Examples
    --------
    >>> section_table("actuator").__name__, section_table("participants", "columns").__name__
    ('ActuatorTable', 'ColumnTable')
    """
    table: type[Table] = StudyTables
    for step in steps:
        annotation: Any = table.model_fields[step].annotation
        table = next(iter(get_args(annotation)), annotation)
    return table
