"""The folder of the tests is on the path, as jobs of the workflow import the toy fleet, too."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
