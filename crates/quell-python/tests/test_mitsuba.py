"""The example with Mitsuba 3, where that is installed: `pip install mitsuba`."""

import importlib.util
import json
import os
import pathlib
import subprocess
import sys
import tempfile
import unittest

FOLDER = pathlib.Path(__file__).resolve().parents[3] / "examples" / "python"


@unittest.skipUnless(importlib.util.find_spec("mitsuba"), "mitsuba is not installed")
class Mitsuba(unittest.TestCase):
    def test_the_script(self):
        with tempfile.TemporaryDirectory() as folder:
            words = ["--frames", "4", "--size", "64x36", "--reference", "32"]
            done = subprocess.run(
                [sys.executable, "-B", str(FOLDER / "mitsuba_animation.py"), folder, *words], capture_output=True, text=True
            )
            self.assertEqual(done.returncode, 0, done.stderr)
            line = next(line for line in done.stdout.splitlines() if line.startswith("quell: error"))
            self.assertLess(float(line.split()[2].rstrip(",")), 0.6, line)
            self.assertTrue(os.path.getsize(os.path.join(folder, "strip.png")) > 0)

    def test_the_notebook(self):
        cells = json.loads((FOLDER / "mitsuba_animation.ipynb").read_text(encoding="utf-8"))["cells"]
        code = "\n".join("".join(cell["source"]) for cell in cells if cell["cell_type"] == "code")
        code = "import sys; sys.dont_write_bytecode = True\n" + code
        done = subprocess.run([sys.executable, "-c", code], cwd=FOLDER, capture_output=True, text=True)
        self.assertEqual(done.returncode, 0, done.stderr)


if __name__ == "__main__":
    unittest.main()
