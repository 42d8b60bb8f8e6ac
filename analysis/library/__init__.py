"""The prediction library: a design space solved into a Parquet data set."""
