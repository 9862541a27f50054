"""Run time against error, and stability; ``python -m benchmarks [NAME ...]``."""
