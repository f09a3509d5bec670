"""The toy fleet is a module of its own, for the workflow's jobs import it, too."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
