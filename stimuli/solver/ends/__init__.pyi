from .ends import ResonanceError, end_waves, faintness, with_ends

__all__ = ["ResonanceError", "end_waves", "faintness", "with_ends"]
