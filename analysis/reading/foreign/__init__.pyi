from .columns import FORCED, YES_NO, ColumnMap, load_column_map
from .counts import read_counted
from .files import (
    FILE,
    STANDS_FOR,
    about,
    begun_anew,
    begun_anew_words,
    bids_tables,
    both_files,
    plain_tables,
    shorter_files,
)
from .form import RowFilter, foreign_chunks, guessed_encoding, text_format, toml_entry
from .table import count_columns

__all__ = [
    "FILE",
    "FORCED",
    "STANDS_FOR",
    "YES_NO",
    "ColumnMap",
    "RowFilter",
    "about",
    "begun_anew",
    "begun_anew_words",
    "bids_tables",
    "both_files",
    "count_columns",
    "foreign_chunks",
    "guessed_encoding",
    "load_column_map",
    "plain_tables",
    "read_counted",
    "shorter_files",
    "text_format",
    "toml_entry",
]
