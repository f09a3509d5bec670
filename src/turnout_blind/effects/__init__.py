"""Effects that can be concealed, one per file; each defines ``EFFECT``."""
