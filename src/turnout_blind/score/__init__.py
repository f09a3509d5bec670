"""Score a set: from truths and finding rows to figures with intervals. Nothing else of the tool is read."""
