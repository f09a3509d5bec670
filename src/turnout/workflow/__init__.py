"""Plan, compute and judge a whole fleet: which units are new, their results in batches, what went wrong."""
