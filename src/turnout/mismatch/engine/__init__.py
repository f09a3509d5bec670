"""The diagnosis: cases, candidate effects, evidence and decisions. Nothing here knows of tracks."""
