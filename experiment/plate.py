"""The plate of a study as the physics sees it: its strip, loads and fingertips."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from stimuli import Fingertip, ForceRectangle, Load, MomentDisc, MomentRectangle, Strip

if TYPE_CHECKING:
    from experiment.actuator import Actuator
    from experiment.study_values import Study


def loads_of(study: Study) -> tuple[Load, ...]:
    """Return the load of each actuator of a study: a bonded patch of 1 N m per metre, or 1 N.

    Parameters
    ----------
    study : Study
        The study.

    Returns
    -------
    tuple of Load
        In the order of the study's actuators; a disc is a `MomentDisc`, a rectangle a
        `MomentRectangle`, a motor a `ForceRectangle` over its contact.

    Examples
    --------
    >>> from experiment.study import paper_study
    >>> left, right = loads_of(paper_study())
    >>> left.x_m == -right.x_m, left.radius_m
    (True, 0.0064)
    """
    return tuple(_load(actuator) for actuator in study.actuators)


def fingertips_of(study: Study) -> tuple[Fingertip, ...]:
    """Return the fingertip above the centre of each actuator: left, right, then the others.

    Parameters
    ----------
    study : Study
        The study.

    Examples
    --------
    >>> from experiment.study import paper_study
    >>> [(finger.x_m, finger.radius_m) for finger in fingertips_of(paper_study())]
    [(-0.035, 0.005), (0.035, 0.005)]
    """
    return tuple(
        Fingertip(x_m=one.x_m, y_m=one.y_m, radius_m=one.finger_diameter_m / 2)
        for one in study.actuators
    )


def field_strip(study: Study) -> Strip:
    """Return the strip whose field stands for a study: endless, its short ends are left out.

    Parameters
    ----------
    study : Study
        The study.

    Examples
    --------
    >>> from experiment.study import paper_study
    >>> print(field_strip(paper_study()).length_m)
    None
    """
    return replace(study.strip, length_m=None)


def _load(actuator: Actuator) -> Load:
    x_m, y_m = actuator.x_m, actuator.y_m
    if actuator.diameter_m is not None:
        return MomentDisc(x_m=x_m, y_m=y_m, radius_m=actuator.diameter_m / 2)
    shape = ForceRectangle if actuator.shape == "motor" else MomentRectangle
    return shape(
        x_m=x_m,
        y_m=y_m,
        length_x_m=actuator.length_x_m or 0.0,
        length_y_m=actuator.length_y_m or 0.0,
    )
