"""Tesla-meters, described in TOML."""
