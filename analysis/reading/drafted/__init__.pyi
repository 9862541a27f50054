from .conditions import has_one_place, pooled, refuse_blank_levels, refuse_lost_sides
from .draft import NOTE, map_draft

__all__ = [
    "NOTE",
    "has_one_place",
    "map_draft",
    "pooled",
    "refuse_blank_levels",
    "refuse_lost_sides",
]
