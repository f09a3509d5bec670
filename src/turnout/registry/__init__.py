"""The model registry: sorted Parquet files, one list of those that count, and SQL views over them."""
