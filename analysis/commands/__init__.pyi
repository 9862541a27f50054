from .analyze import write_analysis

__all__ = ["write_analysis"]
