"""Diagnosis engine: cases, candidate effects, evidence and decisions. It knows nothing of tracks."""
