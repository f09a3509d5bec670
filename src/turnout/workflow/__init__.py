"""Plan, compute and check a whole fleet: new units, their results in batches, quality gate."""
