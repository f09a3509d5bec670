"""Candidate effects of a turnout: where each is searched for, and which are tested in one scan."""
