"""The Python API, a page for each name."""
