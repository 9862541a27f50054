from .batch import InputFile
from .counts import Counts, counts_of, without_device
from .load import LoadedTrials, no_search_for_circles, read_inputs, read_trials
from .plans import contacts, read_plan
from .reasons import NEVER_ANSWERED
from .sources import TABLE, InputTable, find_sources, read_regular, unreadable
from .text import ResultFileError, TextFormat, named, one_line, shown, text_chunks

__all__ = [
    "NEVER_ANSWERED",
    "TABLE",
    "Counts",
    "InputFile",
    "InputTable",
    "LoadedTrials",
    "ResultFileError",
    "TextFormat",
    "contacts",
    "counts_of",
    "find_sources",
    "named",
    "no_search_for_circles",
    "one_line",
    "read_inputs",
    "read_plan",
    "read_regular",
    "read_trials",
    "shown",
    "text_chunks",
    "unreadable",
    "without_device",
]
