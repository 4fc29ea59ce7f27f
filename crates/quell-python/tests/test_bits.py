"""What arrays become is, bit for bit, what the command makes of files with the same channels."""

import os
import shutil
import subprocess
import sys
import tempfile
import unittest
import warnings

import exr
import numpy as np
import quell
import scenes

NUMBERS = list(range(1, 7))
#: A short reach keeps the tests short.
SETTINGS = {"gather.frames": 2, "stabilise.frames": 1}


def command(*arguments):
    beside = os.path.join(os.path.dirname(sys.executable), "quell")
    words = [shutil.which("quell", path=os.path.dirname(beside)) or beside, *map(str, arguments)]
    return subprocess.run(words, capture_output=True, text=True)


class Bits(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.mkdtemp()
        self.addCleanup(shutil.rmtree, self.folder)
        warnings.simplefilter("error", quell.QuellWarning)
        self.addCleanup(warnings.resetwarnings)

    def path(self, *names):
        return os.path.join(self.folder, *names)

    def by_command(self, passes_of, numbers, *arguments):
        """Writes frames, filters them with the command, and returns what it wrote."""
        os.makedirs(self.path("in"), exist_ok=True)
        for at, number in enumerate(numbers):
            exr.write(self.path("in", f"shot.{number:04d}.exr"), scenes.channels(passes_of(at)))
        sets = [word for name, value in SETTINGS.items() for word in ("--set", f"{name}={value}")]
        done = command("denoise", self.path("in"), "-o", self.path("out"), *sets, *arguments)
        self.assertEqual(done.returncode, 0, done.stderr)
        return [exr.read(self.path("out", f"shot.{number:04d}.exr")) for number in numbers]

    def test_a_sequence_with_motion_in_float32_and_float16(self):
        for dtype in (np.float32, np.float16):
            with self.subTest(dtype=dtype):
                all_passes = scenes.sequence(NUMBERS, dtype)
                given = {name: all_passes[name] for name in ("color", "albedo", "normal", "depth", "motion")}
                clean = quell.denoise(**given, settings=SETTINGS)
                self.assertEqual((clean.shape, clean.dtype), (given["color"].shape, dtype))
                files = self.by_command(
                    lambda at: {name: array[at] for name, array in given.items()}, NUMBERS, "--motion", "pixels"
                )
                for at in range(len(NUMBERS)):
                    np.testing.assert_array_equal(clean[at], scenes.pick(files[at], "color", 3))
                truth = 0.3 + np.linspace(0.5, 1.5, scenes.HEIGHT)[:, None, None] * all_passes["albedo"].astype(float)
                error = [np.mean((picture - truth) ** 2) for picture in (given["color"].astype(float), clean.astype(float))]
                self.assertLess(error[1], 0.1 * error[0], "and it is filtered")

    def test_passes_add_up_before_and_after(self):
        s = scenes.sequence(NUMBERS)
        passes = {
            "DiffDir": s["matte"], "DiffCol": s["albedo"], "GlossInd": s["glossy"], "GlossCol": s["white"], "Normal": s["normal"],
        }  # fmt: skip
        vector = np.concatenate([s["motion"], np.zeros_like(s["motion"])], axis=-1)
        # Blender's convention: (x + X, y - Y) in the frame before, (x - Z, y + W) in the next.
        vector[..., 2] = 2.0
        passes["Vector"] = vector
        clean, filtered = quell.denoise(s["color"], depth=s["depth"], passes=passes, settings=SETTINGS)
        self.assertEqual(sorted(filtered), ["DiffDir", "GlossInd"])
        total = filtered["DiffDir"] * s["albedo"] + filtered["GlossInd"]
        np.testing.assert_allclose(total, clean, rtol=2e-6, atol=1e-6)

        given = {"color": s["color"], "depth": s["depth"]} | passes
        files = self.by_command(lambda at: {name: array[at] for name, array in given.items()}, NUMBERS)
        for at in range(len(NUMBERS)):
            np.testing.assert_array_equal(clean[at], scenes.pick(files[at], "color", 3))
            for name in filtered:
                np.testing.assert_array_equal(filtered[name][at], scenes.pick(files[at], name, 3))

    def test_frames_pushed_one_by_one_are_the_same(self):
        s = scenes.sequence(NUMBERS)
        given = {name: s[name] for name in ("color", "albedo", "normal", "depth", "motion")}
        whole = quell.denoise(**given, settings=SETTINGS)
        sequence = quell.Sequence((scenes.HEIGHT, scenes.WIDTH), lookahead=3, settings=SETTINGS)
        self.assertEqual(sequence.lookahead, 3)
        out, when = [], []
        for at, number in enumerate(NUMBERS):
            came = sequence.push(**{name: array[at] for name, array in given.items()}, number=number)
            out += came
            when.append(len(came))
        self.assertEqual(when, [0, 0, 0, 1, 1, 1], "as soon as their window is full")
        out += sequence.flush()
        self.assertEqual([clean.number for clean in out], NUMBERS)
        for at, clean in enumerate(out):
            np.testing.assert_array_equal(clean.color, whole[at])
            self.assertEqual((clean.noise.shape, bool(np.isfinite(clean.noise).all())), ((scenes.HEIGHT, scenes.WIDTH), True))
        # Threads change nothing.
        again = quell.denoise(**given, settings=SETTINGS, threads=1)
        np.testing.assert_array_equal(again, whole)
        # It is ready for the next shot, which without a size of its own may have another.
        free = quell.Sequence(lookahead=0, settings=SETTINGS)
        self.assertEqual(free.lookahead, 0)
        for width in (scenes.WIDTH, 24):
            self.assertEqual(free.push(given["color"][0][:, :width], motion=given["motion"][0][:, :width],
                                       depth=given["depth"][0][:, :width]), [])  # fmt: skip
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", quell.QuellWarning)
                self.assertEqual(free.flush()[0].color.shape, (scenes.HEIGHT, width, 3))

    def test_one_frame_and_alpha(self):
        one = scenes.frame(1)
        alpha = np.linspace(0.0, 1.0, scenes.WIDTH, dtype=np.float32)[None, :, None].repeat(scenes.HEIGHT, 0)
        color = np.concatenate([one["color"], alpha], axis=-1)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", quell.QuellWarning)
            clean = quell.denoise(color, albedo=one["albedo"], normal=one["normal"], settings=SETTINGS)
        files = self.by_command(lambda _: {"color": color, "albedo": one["albedo"], "normal": one["normal"]}, [1])
        np.testing.assert_array_equal(clean, scenes.pick(files[0], "color", 4))

    def test_a_gap_in_the_numbers_is_a_cut(self):
        numbers = [1, 2, 3, 7, 8, 9]
        s = scenes.sequence(numbers)
        given = {name: s[name] for name in ("color", "albedo", "normal", "depth", "motion")}
        clean = quell.denoise(**given, numbers=numbers, settings=SETTINGS)
        files = self.by_command(
            lambda at: {name: array[at] for name, array in given.items()}, numbers, "--motion", "pixels", "-q"
        )
        for at in range(len(numbers)):
            np.testing.assert_array_equal(clean[at], scenes.pick(files[at], "color", 3))

    def test_files_by_a_call_and_by_the_command(self):
        s = scenes.sequence(NUMBERS)
        given = {name: s[name] for name in ("color", "albedo", "normal", "depth", "motion")}
        files = self.by_command(lambda at: {n: a[at] for n, a in given.items()}, NUMBERS, "--motion", "pixels")
        told = []
        report = quell.denoise_files(
            self.path("in", "shot.####.exr"), self.path("again"), motion_convention="pixels", settings=SETTINGS,
            progress=lambda done, of: told.append((done, of)),
        )  # fmt: skip
        self.assertEqual((report.written, report.failed), (NUMBERS, {}))
        self.assertEqual(told, [(n, 6) for n in NUMBERS])
        self.assertIn("motion = motion", report.mapping)
        found, left = report.noise[3]
        # What the net of `blend` expects on a picture of 28x40 pixels; it changes a little with every training.
        self.assertLess(left, 0.6 * found)
        for at, number in enumerate(NUMBERS):
            again = exr.read(self.path("again", f"shot.{number:04d}.exr"))
            for name in files[at]:
                np.testing.assert_array_equal(again[name], files[at][name])
        resumed = quell.denoise_files(
            self.path("in"), self.path("again"), motion_convention="pixels", settings=SETTINGS, existing="resume"
        )
        self.assertEqual((resumed.written, resumed.there_already), ([], NUMBERS))

    def test_what_doctor_says(self):
        s = scenes.sequence(NUMBERS[:3])
        # One seed for all frames.
        s["color"][1:] = s["color"][0]
        given = {name: s[name] for name in ("color", "albedo", "normal", "depth")}
        self.by_command(lambda at: {n: a[at] for n, a in given.items()}, NUMBERS[:3], "-q")
        found = quell.doctor(self.path("in"))
        checks = {finding["check"] for finding in found["findings"]}
        self.assertIn("motion.missing", checks)
        self.assertEqual(found["frames_found"], NUMBERS[:3])
        self.assertIn(found["worst"], ("fault", "warning"))


class Command(unittest.TestCase):
    def test_the_package_carries_it(self):
        done = command("--version")
        self.assertEqual((done.returncode, done.stdout.strip()), (0, f"quell {quell.__version__}"))
        module = subprocess.run([sys.executable, "-m", "quell", "scenes"], capture_output=True, text=True)
        self.assertIn("glossy-room", module.stdout)
        wrong = command("denoise")
        self.assertEqual(wrong.returncode, 2)
        self.assertIn("--help", wrong.stderr)
        self.assertEqual(command("denoise", "nowhere.exr", "-o", "x").returncode, 1)


if __name__ == "__main__":
    unittest.main()
