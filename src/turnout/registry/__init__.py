"""The model registry: sorted Parquet files, a list of the live ones, and SQL views over them."""
