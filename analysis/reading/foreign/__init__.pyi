from .columns import FORCED, YES_NO, ColumnMap, load_column_map
from .conditions import has_one_place, pooled, refuse_blank_levels, refuse_lost_sides
from .counts import read_counted
from .draft import NOTE, map_draft
from .files import about, begun_anew, bids_tables, both_files, plain_tables
from .form import RowFilter, foreign_chunks
from .table import count_columns

__all__ = [
    "FORCED",
    "NOTE",
    "YES_NO",
    "ColumnMap",
    "RowFilter",
    "about",
    "begun_anew",
    "bids_tables",
    "both_files",
    "count_columns",
    "foreign_chunks",
    "has_one_place",
    "load_column_map",
    "map_draft",
    "plain_tables",
    "pooled",
    "read_counted",
    "refuse_blank_levels",
    "refuse_lost_sides",
]
