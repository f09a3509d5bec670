"""The folder of the tests is on the path, so that they can import the module ``small_turnout``."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
