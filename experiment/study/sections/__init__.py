"""The sections of study.toml."""
