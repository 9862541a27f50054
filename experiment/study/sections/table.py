"""What every table of study.toml is: strict, and honest about which keys came later."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar

from pydantic import BaseModel, ConfigDict, Field, SerializerFunctionWrapHandler, model_serializer

Above0 = Annotated[float, Field(gt=0)]
"""A number above 0."""


class Table(BaseModel):
    """A table that refuses unknown keys, numbers as text, and values that are not finite.

    Its `later` keys came after the first version. They are left out of a study's canonical text
    where they have their defaults, so that an older file keeps its checksum.
    """

    model_config = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False)
    later: ClassVar[tuple[str, ...]] = ()

    @model_serializer(mode="wrap")
    def _as_before(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        values: dict[str, Any] = handler(self)
        fields = type(self).model_fields
        for key in self.later:
            if getattr(self, key) == fields[key].get_default(call_default_factory=True):
                values.pop(key, None)
        return values

    def _refuse_incomplete(self, *groups: tuple[str, ...]) -> str | None:
        """Return the one group whose keys are given, if any; refuse a part of one, or two."""
        given = [[key for key in keys if getattr(self, key) is not None] for keys in groups]
        for keys, found in zip(groups, given, strict=True):
            if found and len(found) < len(keys):
                missing = next(key for key in keys if key not in found)
                raise ValueError(f"{missing} is missing; {found[0]} needs it")
        chosen = [found[0] for found in given if found]
        if len(chosen) > 1:
            raise ValueError(f"{chosen[0]} and {chosen[1]} exclude each other; got both")
        return chosen[0] if chosen else None
