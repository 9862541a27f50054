"""Where every number of a study is told to be from, in the check, its JSON and the report."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from experiment.preview.check import check_study
from experiment.preview.check_report import check_findings
from experiment.study.read import study_from_text

if TYPE_CHECKING:
    from experiment.preview.findings import Findings

DISCS = "".join(
    f'[[actuator]]\nside = "{side}"\nx_mm = {x_mm}\ndiameter_mm = 12\n'
    for side, x_mm in (("left", -35), ("right", 35))
)


def found(text: str) -> Findings:
    """Return what the check of a study tells."""
    return check_findings(check_study(study_from_text(text, "s.toml")), "s.toml")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("edge_loss", "told"), [("plate", "have the plate's loss"), ("none", "have no loss")]
)
def test_the_loss_of_springs_is_told_of_a_plate_without_ends(edge_loss: str, told: str) -> None:
    strip = 'length_mm = "endless"\nedge = "elastic"\nedge_stiffness_n = 200\nloss_factor = 0.02'
    text = f'[strip]\n{strip}\nedge_loss = "{edge_loss}"\n'
    assert f"the springs of the edges {told} (edge_loss = {edge_loss})" in found(text).text
