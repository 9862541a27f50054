from .batch import InputFile
from .load import LoadedTrials, read_inputs, read_trials
from .plans import contacts, read_plan
from .sources import InputTable, read_regular, unreadable
from .text import ResultFileError, TextFormat, named, one_line, shown, text_chunks

__all__ = [
    "InputFile",
    "InputTable",
    "LoadedTrials",
    "ResultFileError",
    "TextFormat",
    "contacts",
    "named",
    "one_line",
    "read_inputs",
    "read_plan",
    "read_regular",
    "read_trials",
    "shown",
    "text_chunks",
    "unreadable",
]
