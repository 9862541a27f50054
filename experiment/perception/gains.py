"""The gain matrix: how much of every actuator's vibration each finger gets.

It is computed once per study (`experiment.study.physics`), sealed into the plan, and only read
after that: by the simulated participant, by trials.csv, and by the check.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final, get_args

from pydantic import TypeAdapter

from experiment.tasks import SITES
from stimuli.checks import finite
from stimuli.fingers.actuator import Basis

SIGNIFICANT_DIGITS: Final = 4
"""Digits of a gain and of a displacement in trials.csv. What is computed is good to about 1 %; the
others keep equal steps of level equal, and the last bit of a machine shows in none of them."""

UNEQUAL_DB: Final = 1.0
"""From here on it is told that the same volts move one finger more; people differ by 1.5 dB and
more."""

DRIVEN_FINGERS: Final = SITES
"""The actuators under the two fingers: the first two of every matrix."""

BASES: Final = get_args(Basis)
"""Where a displacement comes from, the stronger basis first."""


def significant(value: float) -> float:
    """Round a number to `SIGNIFICANT_DIGITS`.

    Examples
    --------
    >>> significant(0.02715449), significant(0.0)
    (0.02715, 0.0)
    """
    return float(f"{value:.{SIGNIFICANT_DIGITS - 1}e}")


@dataclass(frozen=True, slots=True, kw_only=True)
class FingerGains:
    """What the two fingers get of the two actuators under them.

    Attributes
    ----------
    left, right : tuple of float
        Peak displacement at that finger per Vpp of the left and of the right actuator: in um where
        the basis is known, else relative to what an actuator does at its own finger.
    basis : str or None
        A word of `BASES`, the weaker one if they differ; none where no displacement is
        known.
    bases : tuple of str or None
        That of the left and of the right actuator, if they differ.

    Examples
    --------
    >>> gains = FingerGains(left=(0.02, 0.001), right=(0.001, 0.02), basis="measured")
    >>> gains.peaks_um((100.0, 0.0))
    (2.0, 0.1)
    >>> WITHOUT_CROSSTALK.amplitudes((100.0, 60.0)), WITHOUT_CROSSTALK.peaks_um((100.0, 60.0))
    ((100.0, 60.0), None)
    """

    left: tuple[float, float]
    right: tuple[float, float]
    basis: str | None
    bases: tuple[str, str] | None = None

    @property
    def right_re_left_db(self) -> float:
        """How much more the same volts move the right finger than the left, each by its own.

        >>> gains = FingerGains(left=(0.02, 0), right=(0, 0.03), basis="measured")
        >>> round(gains.right_re_left_db, 1)
        3.5
        """
        return 20 * math.log10(self.right[1] / self.left[0])

    def amplitudes(self, levels_vpp: tuple[float, float]) -> tuple[float, float]:
        """Return the greatest displacement at the left and at the right finger.

        What comes from the two actuators adds as if the peaks came at the same time: with both
        driven it is an upper bound.

        Parameters
        ----------
        levels_vpp : tuple of float
            Levels of the left and the right actuator; 0 for a silent one.
        """
        left_vpp, right_vpp = levels_vpp
        return (
            self.left[0] * left_vpp + self.left[1] * right_vpp,
            self.right[0] * left_vpp + self.right[1] * right_vpp,
        )

    def peaks_um(self, levels_vpp: tuple[float, float]) -> tuple[float, float] | None:
        """Return `amplitudes` in um to `SIGNIFICANT_DIGITS`; none without a basis."""
        if self.basis is None:
            return None
        left_um, right_um = self.amplitudes(levels_vpp)
        return significant(left_um), significant(right_um)

    def basis_of(self, levels_vpp: tuple[float, float]) -> str | None:
        """Return the basis of what the driven actuators do.

        Examples
        --------
        >>> gains = FingerGains(left=(0.02, 0.0), right=(0.0, 0.02), basis="predicted",
        ...                     bases=("measured", "predicted"))
        >>> gains.basis_of((100.0, 0.0)), gains.basis_of((100.0, 60.0))
        ('measured', 'predicted')
        """
        left_vpp, right_vpp = levels_vpp
        if self.bases is None or (left_vpp > 0) == (right_vpp > 0):
            return self.basis
        return self.bases[0 if left_vpp > 0 else 1]

    def with_crosstalk(self, crosstalk_db: float) -> FingerGains:
        """Return the same actuators on a plate of another cross-talk.

        Parameters
        ----------
        crosstalk_db : float
            Amplitude at the other finger, dB re the amplitude at the actuator's own.

        Examples
        --------
        >>> WITHOUT_CROSSTALK.with_crosstalk(-20.0).left
        (1.0, 0.1)
        """
        leak: float = 10.0 ** (crosstalk_db / 20)
        left, right = self.left[0], self.right[1]
        return replace(self, left=(left, leak * right), right=(leak * left, right))


WITHOUT_CROSSTALK: Final = FingerGains(left=(1.0, 0.0), right=(0.0, 1.0), basis=None)
"""What a plan tells that was sealed without a matrix."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ConditionGains:
    """The gain matrix of one condition's drive: every actuator at every finger.

    Attributes
    ----------
    condition : str
        The condition's name.
    actuators : tuple of str
        ``left``, ``right``, then the others by name.
    bases : tuple of (str or None)
        For each actuator a word of `BASES`; none where its displacement is not known.
    per_vpp : tuple of tuple of float
        A row for the place above each actuator, a column for each actuator: greatest displacement
        over the fingertip's contact area and over time, um per Vpp. The column of an actuator
        without basis is relative to its own place.

    Raises
    ------
    ValueError
        If the matrix is not square, or a number or word is out of its range.

    Examples
    --------
    >>> gains = ConditionGains(condition="main", actuators=DRIVEN_FINGERS,
    ...     bases=("measured", None), per_vpp=((0.02, 0.1), (0.001, 1.0)))
    >>> gains.fingers()
    FingerGains(left=(1.0, 0.1), right=(0.05, 1.0), basis=None, bases=None)
    """

    condition: str
    actuators: tuple[str, ...]
    bases: tuple[Basis | None, ...]
    per_vpp: tuple[tuple[float, ...], ...]

    def __post_init__(self) -> None:
        size = len(self.actuators)
        if self.actuators[:2] != DRIVEN_FINGERS:
            raise ValueError(
                f"actuators must begin with {', '.join(DRIVEN_FINGERS)}; got {self.actuators}"
            )
        if [len(self.bases), *map(len, (self.per_vpp, *self.per_vpp))] != [size] * (size + 2):
            raise ValueError(f"per_vpp must have a row and a column for each of {self.actuators}")
        for row, gains in enumerate(self.per_vpp):
            for column, gain in enumerate(gains):
                above = 0 if row == column else -math.inf
                finite(f"per_vpp[{row}][{column}]", gain, least=0, above=above)

    def level_db(self, finger: int, actuator: int) -> float:
        """Return the crosstalk from one actuator to the place above another.

        Parameters
        ----------
        finger, actuator : int
            Row and column of `per_vpp`, counted from 0.

        Returns
        -------
        float
            Level at `finger`, in dB re the place above the driven actuator.
        """
        from stimuli import level_db

        return level_db(self.per_vpp, own=actuator, other=finger)

    def fingers(self) -> FingerGains:
        """Return the gains of the left and the right actuator at the two fingers.

        Returns
        -------
        FingerGains
            Peak displacement, in um per Vpp, where the displacements of both actuators are known.
            Otherwise the gains are relative to the finger above the driven actuator, which has 1.
        """
        (ll, lr, *_), (rl, rr, *_) = self.per_vpp[:2]
        left, right = self.bases[:2]
        if left is not None and right is not None:
            basis = "predicted" if "predicted" in (left, right) else "measured"
            bases = None if left == right else (left, right)
            return FingerGains(left=(ll, lr), right=(rl, rr), basis=basis, bases=bases)
        lr, rl = significant(lr / rr), significant(rl / ll)
        return FingerGains(left=(1.0, lr), right=(rl, 1.0), basis=None)


GAINS: Final = TypeAdapter(ConditionGains)
"""Rebuilds a matrix from JSON.

>>> GAINS.validate_python({"condition": "main", "actuators": DRIVEN_FINGERS, "bases": [None, None],
...                        "per_vpp": [[1.0, 0.1], [0.1, 1.0]]}).level_db(1, 0)
-20.0
"""
