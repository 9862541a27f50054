from .options import working

__all__ = ["working"]
