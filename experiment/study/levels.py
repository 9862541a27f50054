"""The section [levels] of a study file: who chooses the level of a single stimulus, and when."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any, Final, Literal

from pydantic import Field

from experiment.study.base import Section

if TYPE_CHECKING:
    from collections.abc import Iterator

    from experiment.levels import Bayesian, Staircase
    from experiment.study.base import Rule
    from experiment.study.design import Design

_MIN_LEVELS: Final = 2
"""Of one level there is nothing to choose."""
_USED_BY: Final = {
    "down_after": ("staircase",),
    "down_steps": ("staircase",),
    "up_steps": ("staircase",),
    "start_vpp": ("staircase",),
    "pooled": ("staircase", "bayesian"),
}
"""Rules that use a key; with another rule it keeps its default."""

_Steps = Annotated[int, Field(ge=1, le=20)]


class LevelChoice(Section):
    """How the levels of trials with one finger are chosen, among those of the design."""

    rule: Literal["constant", "staircase", "bayesian"] = "constant"
    """constant: all levels are drawn before the session; else each after the last answer"""
    pooled: bool = False
    """true: one track for all sites of a condition, in place of one for each site"""
    down_after: _Steps = 1
    """staircase: detected trials in a row after which the level decreases"""
    down_steps: _Steps = 1
    """staircase: by how many levels it decreases"""
    up_steps: _Steps = 3
    """staircase: by how many levels it increases after a missed trial"""
    start_vpp: Annotated[float, Field(gt=0)] | None = None
    """staircase: the first level; by default the highest"""

    @property
    def is_adaptive(self) -> bool:
        """Whether levels are chosen during the session."""
        return self.rule != "constant"

    def design_rules(self, designs: dict[str, Design]) -> Iterator[Rule]:
        """Yield the rules between keys, and that the design of each condition leaves a choice."""
        for key, used_by in _USED_BY.items():
            is_changed = getattr(self, key) != type(self).model_fields[key].default
            names = " or ".join(f'"{name}"' for name in used_by)
            rule = f"must be omitted unless levels.rule = {names}"
            yield is_changed and self.rule not in used_by, f"levels.{key}", rule, getattr(self, key)
        if not self.is_adaptive:
            return
        for condition, design in designs.items():
            levels_vpp = design.levels_vpp
            where = f" in condition {condition}" if len(designs) > 1 else ""
            rule = f'must have at least two levels{where} with levels.rule = "{self.rule}"'
            yield len(levels_vpp) < _MIN_LEVELS, "design.levels_vpp", rule, levels_vpp
            is_other = self.start_vpp is not None and self.start_vpp not in levels_vpp
            yield (
                is_other,
                "levels.start_vpp",
                f"must be a level of the design{where}",
                self.start_vpp,
            )
        order = next(iter(designs.values())).order
        rule = f'must be "random" with levels.rule = "{self.rule}"'
        yield order != "random", "design.order", rule, order

    def rule_for(self, levels_vpp: tuple[float, ...], seed: int) -> Staircase | Bayesian:
        """Return the rule that is sealed in a plan.

        Parameters
        ----------
        levels_vpp : tuple of float
            Levels of a condition, among which it chooses.
        seed : int
            Seed of the plan, which decides between equal choices.

        Returns
        -------
        Staircase or Bayesian
        """
        from experiment.levels import Bayesian, Staircase

        shared: dict[str, Any] = {
            "candidates_vpp": levels_vpp,
            "seed": seed,
            "pooled": self.pooled,
        }
        if self.rule == "bayesian":
            return Bayesian(**shared)
        return Staircase(
            **shared,
            down_after=self.down_after,
            down_steps=self.down_steps,
            up_steps=self.up_steps,
            start_vpp=max(levels_vpp) if self.start_vpp is None else self.start_vpp,
        )
