"""All tests: python -m tests, in app/python. The last line is `N passed, N failed`."""
import os
import sys
import unittest
from pathlib import Path

here = Path(__file__).resolve().parent
sys.path.insert(0, str(here.parent))
os.chdir(here.parent)
result = unittest.TextTestRunner(verbosity=1).run(unittest.defaultTestLoader.discover(
    "tests", top_level_dir="."))
failed = len(result.failures) + len(result.errors)
# What was left out has shown nothing
print(f"{result.testsRun - failed - len(result.skipped)} passed, {failed} failed", flush=True)
sys.exit(1 if failed else 0)
