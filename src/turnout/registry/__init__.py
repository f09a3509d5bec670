"""The model registry: sorted Parquet files, a list of the live ones, and SQL views over them."""

import os

# Read when pyarrow is imported: its own allocator keeps some 15 MB of what a job has freed. A user's setting counts.
os.environ.setdefault("ARROW_DEFAULT_MEMORY_POOL", "system")
