"""Every block of Python in docs/python.md and in README.md runs, in the order of the page."""

import contextlib
import doctest
import io
import os
import pathlib
import re
import shutil
import tempfile
import unittest
import warnings

import exr
import quell
import quell._sequence
import quell._settings
import scenes

ROOT = pathlib.Path(__file__).resolve().parents[3]


class Docs(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.mkdtemp()
        self.addCleanup(shutil.rmtree, self.folder)
        self.addCleanup(os.chdir, os.getcwd())
        os.chdir(self.folder)
        for number in range(1, 4):
            passes = scenes.frame(number)
            kept = {name: passes[name] for name in ("color", "albedo", "normal", "depth", "motion")}
            exr.write(f"shot.{number:04d}.exr", scenes.channels(kept))

    def run_page(self, page, namespace):
        text = (ROOT / page).read_text(encoding="utf-8")
        blocks = re.findall(r"^```python\n(.*?)^```", text, re.M | re.S)
        out = io.StringIO()
        with warnings.catch_warnings(), contextlib.redirect_stdout(out):
            warnings.simplefilter("ignore", quell.QuellWarning)
            for number, block in enumerate(blocks, 1):
                exec(compile(block, f"{page}, block {number}", "exec"), namespace)
        return len(blocks), out.getvalue()

    def test_docs_python_md(self):
        count, out = self.run_page("docs/python.md", {})
        self.assertGreaterEqual(count, 8)
        for line in ("nothing tells what moves", "['DiffDir', 'GlossInd']", "frame 1001", "3 of 3", "[1, 2, 3] {}",
                     "motion: shape (47, 64, 2), but the frame is 48 high and 64 wide"):  # fmt: skip
            self.assertIn(line, out)
        self.assertTrue(pathlib.Path("clean", "shot.0002.exr").is_file())

    def test_readme_md(self):
        s = scenes.sequence(range(1, 4))
        namespace = {name: s[name] for name in ("color", "albedo", "normal", "depth", "motion")}
        count, _ = self.run_page("README.md", namespace)
        self.assertEqual(count, 1)
        self.assertEqual(namespace["clean"].shape, s["color"].shape)

    def test_docstrings(self):
        for module in (quell._sequence, quell._settings):
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", quell.QuellWarning)
                self.assertEqual(doctest.testmod(module).failed, 0)

    def test_every_public_name_has_a_docstring(self):
        for name in quell.__all__:
            self.assertTrue(getattr(quell, name).__doc__, name)


if __name__ == "__main__":
    unittest.main()
