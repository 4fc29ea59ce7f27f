"""What needs no Blender: python3 -m unittest discover -s integrations/blender/tests -p test_plain.py"""
import os
import stat
import sys
import tempfile
import textwrap
import time
import types
import unittest

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), ".."))
from quell_denoise import binary, denoise, frames, prepare
from quell_denoise.errors import Problem
from quell_denoise.job import Job
from quell_denoise.progress import Progress

# Writes each input's name to the output folder, one in 50 ms, with the lines of the real program.
FAKE = """\
    #!/usr/bin/env python3
    import os, signal, sys, time
    if "--version" in sys.argv:
        print("quell 0.1.0")
        sys.exit(0)
    signal.signal(signal.SIGINT, lambda *_: sys.exit(130))
    inputs = sys.argv[sys.argv.index("--") + 1:]
    folder = sys.argv[sys.argv.index("-o") + 1]
    print("warning: planted", file=sys.stderr, flush=True)
    for i, name in enumerate(inputs, 1):
        time.sleep(0.05)
        if os.path.getsize(name) == 0:
            print(f"error: {name}: empty", file=sys.stderr, flush=True)
            sys.exit(3)
        open(os.path.join(folder, name), "w").write(name)
        print(f"[{100 * i // len(inputs):3}%] frame {i} of {len(inputs)} ({i}), 20.00 frames a second, 3 s left",
              file=sys.stderr, flush=True)
    print(f"{len(inputs)} of {len(inputs)} frames are written to {folder}")
"""


def program(folder, name="quell"):
    os.makedirs(folder, exist_ok=True)
    path = os.path.join(folder, name)
    with open(path, "w") as file:
        file.write(textwrap.dedent(FAKE))
    os.chmod(path, 0o755)
    return path


def blender_path(template):
    """As Blender makes paths: the last run of `#` is the frame number, `####` is added where there is none."""
    folder, name = os.path.split(template)
    stem, extension = os.path.splitext(name)
    if "#" not in stem:
        stem += "####"
    end = stem.rindex("#") + 1
    begin = end - 1
    while begin and stem[begin - 1] == "#":
        begin -= 1
    return lambda n: os.path.join(folder, f"{stem[:begin]}{n:0{end - begin + (n < 0)}d}{stem[end:]}{extension}")


class Folder(unittest.TestCase):
    def setUp(self):
        self.temporary = tempfile.TemporaryDirectory()
        self.folder = self.temporary.name
        self.bin = os.path.join(self.folder, "bin")

    def tearDown(self):
        self.temporary.cleanup()

    def frames(self, first, last, text="light"):
        path = blender_path(os.path.join(self.folder, "shot_####.exr"))
        for n in range(first, last + 1):
            with open(path(n), "w") as file:
                file.write(text)
        return frames.sequence(path, first, last)


class Binary(Folder):
    def find(self, **given):
        return binary.find(**{"search_path": os.path.join(self.folder, "nowhere"), "home": self.folder, **given})

    def test_order(self):
        places = ("a", "b", "c", ".cargo/bin", ".local/bin")
        named, on_path, beside, cargo, pip = (os.path.join(self.folder, n) for n in places)
        for folder in (named, on_path, beside, cargo, pip):
            os.makedirs(folder)
            program(folder)
        path = os.path.join
        everywhere = {"search_path": on_path, "blend_folder": beside}
        self.assertEqual(self.find(preference=path(named, "quell"), **everywhere), path(named, "quell"))
        self.assertEqual(self.find(preference=named, **everywhere), path(named, "quell"))
        self.assertEqual(self.find(**everywhere), path(on_path, "quell"))
        self.assertEqual(self.find(blend_folder=beside), path(beside, "quell"))
        self.assertEqual(self.find(), path(cargo, "quell"))
        os.remove(path(cargo, "quell"))
        self.assertEqual(self.find(), path(pip, "quell"))

    def test_nowhere(self):
        with self.assertRaisesRegex(Problem, "https://github.com/quell-denoise/quell"):
            self.find(blend_folder=self.folder)

    def test_what_the_preferences_name_is_never_passed_over(self):
        with self.assertRaisesRegex(Problem, "no program there"):
            self.find(preference=os.path.join(self.folder, "gone"), search_path=os.path.dirname(program(self.folder)))

    def test_not_executable(self):
        path = program(self.folder)
        os.chmod(path, stat.S_IRUSR)
        with self.assertRaises(Problem):
            self.find(blend_folder=self.folder)

    def test_version(self):
        self.assertEqual(binary.version(program(self.folder)), "quell 0.1.0")
        with self.assertRaisesRegex(Problem, "is not the program quell"):
            binary.version(sys.executable)
        with self.assertRaisesRegex(Problem, "does not run"):
            binary.version(self.folder)


class Frames(Folder):
    def test_pattern(self):
        for template, pattern in (
            ("shot_####.exr", "shot_####.exr"),
            ("shot01##.exr", "shot01##.exr"),
            ("8_#_v8.exr", "8_#_v8.exr"),
            ("a##b###.exr", "a##b###.exr"),
            ("shot.exr", "shot####.exr"),
        ):
            found = frames.sequence(blender_path(os.path.join(self.folder, template)), 1, 3)
            self.assertEqual(found.pattern, pattern)

    def test_folders_and_steps(self):
        found = frames.sequence(blender_path("/r/shot.exr"), -1, 3, 2)
        self.assertEqual(found.numbers, (-1, 1, 3))
        self.assertEqual(found.names, ("shot-0001.exr", "shot0001.exr", "shot0003.exr"))
        self.assertEqual(found.result, os.path.join("/r", "quell"))

    def test_refused(self):
        for template, first, saved, words in (
            ("shot.exr", 1, False, "Save the .blend file"),
            ("shot.exr", 1, True, "not absolute"),
            ("/r/shot.png", 1, True, "press Prepare"),
            ("/r/shot.exr", 9, True, "is empty"),
        ):
            with self.assertRaisesRegex(Problem, words):
                frames.sequence(blender_path(template), first, 3, saved=saved)
        with self.assertRaisesRegex(Problem, "in one folder"):
            frames.sequence(lambda n: "/r/same.exr", 1, 3)

    def test_existing(self):
        self.frames(2, 3)
        found = frames.sequence(blender_path(os.path.join(self.folder, "shot_####.exr")), 1, 4)
        self.assertEqual(found.existing(), (2, 3))
        self.assertEqual(found.results(), ())

    def test_inputs(self):
        path = blender_path("/r/shot_####.exr")
        self.assertEqual(frames.inputs(frames.sequence(path, 1, 2), (2,)), ["--", "shot_0002.exr"])
        # Too long for a command line: a pattern, and which frames of it.
        many = frames.sequence(path, 1, 5000)
        wanted = [n for n in many.numbers if n != 4000]
        self.assertEqual(frames.inputs(many, wanted), ["--frames=1-3999,4001-5000", "--", "shot_####.exr"])

    def test_not_writable(self):
        path = os.path.join(self.folder, "file")
        open(path, "w").close()
        with self.assertRaisesRegex(Problem, "is a file"):
            frames.check_writable(path)
        with self.assertRaisesRegex(Problem, "Cannot write to"):
            frames.check_writable(os.path.join(path, "quell"))
        frames.check_writable(os.path.join(self.folder, "a", "quell"))
        self.assertEqual(os.listdir(os.path.join(self.folder, "a", "quell")), [])


class Lines(unittest.TestCase):
    def test_read(self):
        progress = Progress()
        self.assertEqual(progress.text(), "starting")
        for line in (
            "warning: frame 2 has the same noise as the one before\n",
            "[ 25%] frame 1 of 4 (1001), 6.41 frames a second, 3 s left\n",
            "[ 50%] frame 2 of 4 (-7), 6.41 frames a second, 1 s left\n",
            "\n",
            "error: shot.exr: cut off\n",
        ):
            progress.read(line)
        self.assertEqual((progress.done, progress.total, progress.fraction, progress.seconds_left), (2, 4, 0.5, 1))
        self.assertEqual(progress.text(), "frame 2 of 4, 1 s left")
        self.assertEqual(progress.warnings, ["frame 2 has the same noise as the one before"])
        self.assertEqual(progress.errors, ["shot.exr: cut off"])


class Jobs(Folder):
    def job(self, found, **given):
        job = Job(found, program(self.bin), **given)
        job.start()
        return job

    def test_to_the_end(self):
        found = self.frames(1, 3)
        job = self.job(found)
        job.finish(0.01)
        self.assertEqual((job.outcome, job.message), ("DONE", f"3 of 3 frames are written to {found.result}"))
        self.assertEqual(job.notes, ["quell: planted"])
        self.assertEqual(found.results(), (1, 2, 3))

    def test_cancelled_half_way(self):
        found = self.frames(1, 40)
        job = self.job(found)
        while job.step() and job.fraction == 0:
            time.sleep(0.01)
        job.cancel()
        self.assertTrue(job.cancelling)
        job.finish(0.01)
        self.assertEqual(job.outcome, "CANCELLED")
        self.assertIn("clean frames are written, and whole", job.message)
        self.assertTrue(0 < len(found.results()) < 40)
        self.assertEqual(len(found.existing()), 40)

    def test_some_frames_fail(self):
        found = self.frames(1, 3)
        open(os.path.join(self.folder, found.names[2]), "w").close()
        job = self.job(found)
        job.finish(0.01)
        self.assertEqual(job.outcome, "PARTIAL")
        self.assertIn("shot_0003.exr: empty", job.message)
        self.assertEqual(found.results(), (1, 2))

    def test_nothing_rendered(self):
        found = frames.sequence(blender_path(os.path.join(self.folder, "shot.exr")), 1, 3)
        with self.assertRaisesRegex(Problem, "render first"):
            self.job(found)

    def test_the_program_in_the_way_of_the_folder(self):
        found = self.frames(1, 3)
        with self.assertRaisesRegex(Problem, "is a file"):
            Job(found, program(self.folder)).start()

    def test_the_program_is_tried_before_anything_is_rendered(self):
        class Render:
            def start(self):
                raise AssertionError("rendered")

        with self.assertRaisesRegex(Problem, "is not the program"):
            Job(self.frames(1, 2), sys.executable, Render()).start()

    def test_render_first(self):
        class Render:
            cancelled, steps = False, 3

            def start(self):
                pass

            def step(render):
                render.steps -= 1
                if not render.steps:
                    self.frames(1, 2)
                return render.steps > 0

            def cancel(render):
                render.cancelled, render.steps = True, 1

        found = frames.sequence(blender_path(os.path.join(self.folder, "shot_####.exr")), 1, 3)
        job = self.job(found, render=Render())
        self.assertTrue(job.rendering)
        job.finish(0.01)
        self.assertEqual(job.outcome, "DONE")
        self.assertEqual(job.notes[0], "Not rendered, so left out: frames 3")
        again = Job(found, program(self.bin), Render())
        again.start()
        again.cancel()
        again.finish(0.01)
        self.assertEqual(again.outcome, "CANCELLED")
        self.assertIn("Denoise Existing", again.message)

    def test_command(self):
        found = self.frames(1, 2)
        self.assertEqual(
            denoise.command("quell", found, (1, 2), resume=True),
            ["quell", "denoise", "-o", "quell", "--resume", "--", "shot_0001.exr", "shot_0002.exr"],
        )


class Prepare(unittest.TestCase):
    def scene(self, codec="DWAA"):
        new = types.SimpleNamespace
        layer = new(name="ViewLayer", use=True, cycles=new(use_pass_volume_direct=False, use_pass_volume_indirect=False))
        layer.cycles.denoising_store_passes = False
        for name, *_ in prepare._LAYER_PASSES:
            setattr(layer, f"use_pass_{name}", name == "combined")
        image = new(file_format="PNG", color_depth="8", exr_codec=codec)
        render = new(use_motion_blur=True, motion_blur_shutter=0.5, use_file_extension=True, image_settings=image)
        cycles = new(use_denoising=True, use_animated_seed=False, scrambling_distance=1.0)
        return new(render=render, cycles=cycles, view_layers=[layer, new(use=False)], frame_step=1)

    def test_once_and_for_all(self):
        scene = self.scene()
        found, hints = prepare.changes(scene)
        lines = prepare.apply(found)
        self.assertIn("Output > Codec: DWAA → ZIP (DWAA damages depth, normals and vectors)", lines)
        self.assertIn("Motion Blur: off (with it on Cycles writes motion vectors of zero)", lines)
        self.assertTrue(any("Vector Blur" in hint for hint in hints))
        self.assertEqual(prepare.changes(scene), ([], []))

    def test_lossless_codecs_stay(self):
        scene = self.scene("PIZ")
        prepare.apply(prepare.changes(scene)[0])
        self.assertEqual(scene.render.image_settings.exr_codec, "PIZ")

    def test_a_setting_that_is_gone_is_told(self):
        scene = self.scene()
        del scene.view_layers[0].use_pass_vector
        self.assertTrue(any("use_pass_vector" in hint for hint in prepare.changes(scene)[1]))


if __name__ == "__main__":
    unittest.main()
