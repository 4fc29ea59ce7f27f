"""Arrays of every kind, and bad input of every kind: an exception with the argument's name, and the object stays usable."""

import os
import signal
import subprocess
import sys
import tempfile
import textwrap
import threading
import unittest
import warnings

import exr
import numpy as np
import quell
import scenes

SETTINGS = {"gather.frames": 2, "stabilise.frames": 1}


def frames(count=4):
    s = scenes.sequence(range(1, count + 1))
    return {name: s[name] for name in ("color", "albedo", "normal", "depth", "motion")}


class Kinds(unittest.TestCase):
    def setUp(self):
        self.given = frames()
        self.clean = quell.denoise(**self.given, settings=SETTINGS)

    def test_layouts_do_not_matter(self):
        def fortran(a):
            return np.asfortranarray(a)

        def big_endian(a):
            return a.astype(">f4")

        def read_only(a):
            a = a.copy()
            a.flags.writeable = False
            return a

        def strided(a):
            wide = np.zeros((*a.shape[:-1], 2 * a.shape[-1]), a.dtype)
            wide[..., ::2] = a
            return wide[..., ::2]

        def flipped(a):
            return a[:, ::-1].copy()[:, ::-1]

        def unaligned(a):
            data = np.empty(a.nbytes + 1, np.uint8)[1:].view(np.float32).reshape(a.shape)
            data[...] = a
            return data

        for layout in (fortran, big_endian, read_only, strided, flipped, unaligned):
            with self.subTest(layout=layout.__name__):
                clean = quell.denoise(**{n: layout(a) for n, a in self.given.items()}, settings=SETTINGS)
                np.testing.assert_array_equal(clean, self.clean)

    def test_overlapping_memory_and_float64(self):
        # A normal that is one pixel, repeated without memory of its own.
        one = np.array([0.0, 0.0, 1.0], np.float32)
        normal = np.lib.stride_tricks.as_strided(one, self.given["normal"].shape, (0, 0, 0, one.itemsize))
        clean = quell.denoise(**{**self.given, "normal": normal}, settings=SETTINGS)
        np.testing.assert_array_equal(clean, self.clean)
        wide = quell.denoise(**{n: a.astype(np.float64) for n, a in self.given.items()}, settings=SETTINGS)
        self.assertEqual(wide.dtype, np.float32)
        np.testing.assert_array_equal(wide, self.clean)
        # What was given is never written to.
        before = {name: array.copy() for name, array in self.given.items()}
        quell.denoise(**self.given, settings=SETTINGS)
        for name, array in before.items():
            np.testing.assert_array_equal(self.given[name], array)

    def test_buffers_come_back_as_buffers(self):
        given = {name: memoryview(array) for name, array in self.given.items()}
        clean = quell.denoise(**given, settings=SETTINGS)
        self.assertIsInstance(clean, memoryview)
        np.testing.assert_array_equal(np.asarray(clean), self.clean)

    def test_whatever_speaks_dlpack(self):
        class Mine:
            def __init__(self, array):
                self.array = array

            def __dlpack__(self, **words):
                return self.array.__dlpack__(**words)

            def __dlpack_device__(self):
                return self.array.__dlpack_device__()

        clean = quell.denoise(**{n: Mine(a) for n, a in self.given.items()}, settings=SETTINGS)
        np.testing.assert_array_equal(np.asarray(clean), self.clean)

    def test_torch(self):
        try:
            import torch
        except ImportError:
            self.skipTest("torch is not installed")
        given = {n: torch.from_numpy(a) for n, a in self.given.items()}
        clean = quell.denoise(**given, settings=SETTINGS)
        self.assertIsInstance(clean, torch.Tensor)
        np.testing.assert_array_equal(clean.numpy(), self.clean)
        half = quell.denoise(given["color"].half(), motion=given["motion"], depth=given["depth"], settings=SETTINGS)
        self.assertEqual(half.dtype, torch.float16)
        with self.assertRaisesRegex(quell.InputError, "color: .*bfloat16|color: torch"):
            quell.denoise(given["color"].bfloat16())

    def test_jax(self):
        try:
            import jax.numpy as jnp
        except ImportError:
            self.skipTest("jax is not installed")
        clean = quell.denoise(**{n: jnp.asarray(a) for n, a in self.given.items()}, settings=SETTINGS)
        self.assertIsInstance(clean, jnp.ndarray)
        np.testing.assert_array_equal(np.asarray(clean), self.clean)

    def test_drjit(self):
        try:
            from drjit.llvm import TensorXf

            given = {n: TensorXf(a) for n, a in self.given.items()}
        except Exception as error:  # noqa: BLE001 - Dr.Jit needs an LLVM, and says so in many ways
            self.skipTest(f"drjit is not there: {error}")
        clean = quell.denoise(**given, settings=SETTINGS)
        self.assertIsInstance(clean, TensorXf)
        np.testing.assert_array_equal(clean.numpy(), self.clean)

    def test_an_array_on_a_gpu_names_the_copy_to_make(self):
        class Cuda:
            def __dlpack__(self, **_):
                raise AssertionError("it is not asked for")

            def __dlpack_device__(self):
                return (2, 0)

        with self.assertRaisesRegex(quell.InputError, "color: this array lies on CUDA; .*copy"):
            quell.denoise(Cuda())
        Cuda.__module__ = "torch"
        with self.assertRaisesRegex(quell.InputError, r"color\.cpu\(\)"):
            quell.denoise(Cuda())


class Bad(unittest.TestCase):
    def refuses(self, message, kind=quell.InputError, **changes):
        given = {**frames(2), **changes}
        with self.assertRaisesRegex(kind, message):
            quell.denoise(**{n: v for n, v in given.items() if v is not None}, settings=SETTINGS)

    def test_shapes_and_types(self):
        g = frames(2)
        self.refuses(r"^normal: shape \(28, 40, 2\), expected \(height, width, 3\)", normal=g["normal"][..., :2])
        self.refuses(r"^depth: shape \(28, 39\), but the frame is 28 high and 40 wide", depth=g["depth"][..., 1:])
        self.refuses(r"^motion: shape .*1, 28, 40, 2\), but color has 2 frames", motion=g["motion"][:1])
        self.refuses(r"^color: shape \(2, 28, 40, 5\)|^color: .*expected", color=np.zeros((2, 28, 40, 5), np.float32))
        self.refuses(r"^color: numbers of type uint8; float16", color=g["color"].astype(np.uint8))
        self.refuses(r"^albedo: numbers of type complex64", albedo=g["albedo"].astype(np.complex64))
        self.refuses(r"^albedo: str.* is no array|^albedo: builtins.str is no array", TypeError, albedo="albedo.png")
        self.refuses(r"^color: a frame needs color", color=None, albedo=None, normal=None, depth=None, motion=None)
        self.refuses(r"no beauty and no light pass", color=None)
        for shape in ((0, 28, 40, 3), (2, 0, 40, 3), (2, 28, 0, 3)):
            self.refuses(r"^color: shape .* has no (frames|pixels)", color=np.zeros(shape, np.float32), albedo=None,
                         normal=None, depth=None, motion=None)  # fmt: skip

    def test_passes_and_words(self):
        g = frames(2)
        self.refuses(r"`bueaty`: no renderer calls a pass like this; .*matte_direct", passes={"bueaty": g["color"]})
        self.refuses(r"passes: list; a dict", TypeError, passes=[g["color"]])
        self.refuses(r"two passes of this name", passes={"color": g["color"]})
        self.refuses(r"there is no renderer `blunder`", renderer="blunder")
        self.refuses(r"`sideways` is no motion preset; there are auto, none, blender", motion_convention="sideways")
        self.refuses(r"^backend: `cuda`; there are cpu, gpu, auto, reference", backend="cuda")
        self.refuses(r"^device: it names a GPU", device="llvmpipe")
        self.refuses(r"^threads: 0", threads=0)
        self.refuses(r"^preset: `fast`; of sequences there are: sequence, sequence-short", preset="fast")
        self.refuses(r"^lookahead: -1", lookahead=-1)
        self.refuses(r"blend.strength`: `9", strength=9)
        self.refuses(r"^camera: shape \(3, 3\)", camera=np.eye(3))
        self.refuses(r"^camera: 3 cameras for 2 frames", camera=np.stack([np.eye(4)] * 3))
        self.refuses(r"^numbers: ", numbers=[2, 1])
        self.refuses(r"^progress: 5", TypeError, progress=5)
        for settings, message in (({"blend.strenth": 1}, "did you mean blend.strength"), ({"blend.strength": []}, "settings: ")):
            with self.assertRaisesRegex(quell.InputError, message):
                quell.Sequence(settings=settings)
        with self.assertRaisesRegex(quell.InputError, "^size: "):
            quell.Sequence((0, 4))

    def test_no_numbers_count_as_black_and_are_told(self):
        g = frames(3)
        g["color"][1, 3, 4] = np.nan
        g["color"][1, 5, 6, 0] = np.inf
        for name in ("albedo", "normal", "depth", "motion"):
            g[name][2, 7:9] = np.nan
        with self.assertWarnsRegex(quell.QuellWarning, "pixels held colours that are no numbers"):
            clean = quell.denoise(**g, settings=SETTINGS)
        self.assertTrue(np.isfinite(clean).all())

    def test_what_is_missing_is_said_at_the_callers_line(self):
        g = frames(3)
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            quell.denoise(g["color"], settings=SETTINGS)
        told = [w for w in caught if issubclass(w.category, quell.QuellWarning)]
        self.assertTrue(any("nothing tells what moves" in str(w.message) for w in told))
        self.assertTrue(any("no normal, depth or albedo" in str(w.message) for w in told))
        self.assertEqual({w.filename for w in told}, {__file__})

    def test_a_bad_frame_is_left_out_and_the_sequence_goes_on(self):
        g = frames(4)
        good = quell.denoise(**g, settings=SETTINGS)
        one = [{name: array[at] for name, array in g.items()} for at in range(4)]
        sequence = quell.Sequence(settings=SETTINGS)
        out = sequence.push(**one[0])
        bad = [
            {**one[1], "depth": one[1]["depth"][1:]},
            {name: array[:9] for name, array in one[1].items()},
            {name: array for name, array in one[1].items() if name != "albedo"},
            {**one[1], "color": None},
        ]
        for frame in bad:
            with self.assertRaises(quell.InputError):
                out += sequence.push(**frame)
        for frame in one[1:]:
            out += sequence.push(**frame)
        out += sequence.flush()
        self.assertEqual([clean.number for clean in out], [1, 2, 3, 4])
        np.testing.assert_array_equal(np.stack([clean.color for clean in out]), good)
        self.assertEqual(sequence.flush(), [])

    def test_frames_out_of_order(self):
        g = frames(4)
        good = quell.denoise(**g, settings=SETTINGS)
        one = [{name: array[at] for name, array in g.items()} for at in range(4)]
        sequence = quell.Sequence(settings=SETTINGS)
        out = sequence.push(**one[0], number=4) + sequence.push(**one[1], number=5)
        for number in (5, 4, -7):
            with self.assertRaisesRegex(quell.InputError, f"number {number} after 5; numbers rise"):
                sequence.push(**one[2], number=number)
        for number in (2.5, True, "6"):
            with self.assertRaisesRegex(quell.InputError, "^number: "):
                sequence.push(**one[2], number=number)
        out += sequence.push(**one[2]) + sequence.push(**one[3]) + sequence.flush()
        self.assertEqual([clean.number for clean in out], [4, 5, 6, 7])
        np.testing.assert_array_equal(np.stack([clean.color for clean in out]), good)
        # After a flush another sequence begins, with any number.
        self.assertEqual(sequence.push(**one[0], number=1), [])

    def test_a_callback_that_raises(self):
        def progress(done, of):
            raise LookupError(f"{done} of {of}")

        with self.assertRaisesRegex(LookupError, "1 of 4"):
            quell.denoise(**frames(4), settings=SETTINGS, progress=progress)
        # Between files, too; what is written is whole, and the job goes on from there.
        with tempfile.TemporaryDirectory() as folder:
            g, noisy = frames(4), os.path.join(folder, "noisy")
            os.mkdir(noisy)
            for at in range(4):
                exr.write(f"{noisy}/shot.{at + 1:04d}.exr", scenes.channels({name: array[at] for name, array in g.items()}))
            words = {"motion_convention": "pixels", "settings": SETTINGS}
            with self.assertRaisesRegex(LookupError, "1 of 4"):
                quell.denoise_files(noisy, f"{folder}/clean", progress=progress, **words)
            report = quell.denoise_files(noisy, f"{folder}/clean", existing="resume", **words)
            self.assertEqual(sorted(report.written + report.there_already), [1, 2, 3, 4])
            self.assertIn(1, report.there_already)
            with self.assertRaises(LookupError):
                quell.doctor(noisy, progress=progress)
            self.assertEqual(quell.doctor(noisy)["frames_found"], [1, 2, 3, 4])

    def test_files_that_are_not_there(self):
        with self.assertRaisesRegex(quell.InputError, "no file has this name"):
            quell.denoise_files("nowhere.####.exr", "out")
        with self.assertRaisesRegex(quell.InputError, "existing: `maybe`"):
            quell.denoise_files(".", "out", existing="maybe")
        with self.assertRaises(quell.InputError):
            quell.doctor("nowhere.####.exr")


class Threads(unittest.TestCase):
    def test_several_at_once_give_the_same_bits(self):
        given = frames(4)
        alone = quell.denoise(**given, settings=SETTINGS)
        results = [None] * 3

        def work(at):
            results[at] = quell.denoise(**given, settings=SETTINGS, threads=1)

        threads = [threading.Thread(target=work, args=(at,)) for at in range(3)]
        [t.start() for t in threads]
        [t.join() for t in threads]
        for result in results:
            np.testing.assert_array_equal(result, alone)

    def test_one_sequence_in_two_threads_is_refused(self):
        g = frames(4)
        sequence = quell.Sequence(settings=SETTINGS)
        inside, go_on, errors = threading.Event(), threading.Event(), []

        def hear(clean):
            inside.set()
            go_on.wait(30)

        sequence._hear = hear
        for at in range(3):
            sequence.push(**{name: array[at] for name, array in g.items()})
        thread = threading.Thread(target=sequence.flush)
        thread.start()
        self.assertTrue(inside.wait(30))
        try:
            sequence.push(**{name: array[3] for name, array in g.items()})
        except quell.Error as error:
            errors.append(str(error))
        go_on.set()
        thread.join()
        self.assertEqual(errors, ["this sequence is being used by another thread; each needs one of its own"])


def script(text):
    return subprocess.Popen(
        [sys.executable, "-c", textwrap.dedent(text)], cwd=os.path.dirname(__file__), text=True,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    )  # fmt: skip


class Ends(unittest.TestCase):
    @unittest.skipIf(os.name == "nt", "signals are sent otherwise on Windows")
    def test_ctrl_c(self):
        process = script(
            """
            import numpy as np, quell, scenes, signal
            # A job in the background of a script begins with it ignored.
            signal.signal(signal.SIGINT, signal.default_int_handler)
            s = scenes.sequence(range(1, 5))
            given = {name: s[name] for name in ("color", "normal", "depth", "motion")}
            long = {name: np.concatenate([array] * 400) for name, array in given.items()}
            def progress(done, of):
                if done == 1:
                    print("begun", flush=True)
            try:
                quell.denoise(**long, progress=progress)
            except KeyboardInterrupt:
                print("interrupted", quell.denoise(**given, settings={"gather.frames": 1}).shape)
            """
        )
        self.assertEqual(process.stdout.readline(), "begun\n")
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=60)
        self.assertEqual(out, "interrupted (4, 28, 40, 3)\n", err)

    def test_an_interpreter_that_ends_while_it_filters(self):
        process = script(
            """
            import threading, numpy as np, quell, scenes
            s = scenes.sequence(range(1, 5))
            long = {name: np.concatenate([s[name]] * 400) for name in ("color", "depth", "motion")}
            begun = threading.Event()
            work = lambda: quell.denoise(**long, progress=lambda done, of: begun.set())
            threading.Thread(target=work, daemon=True).start()
            begun.wait(60)
            """
        )
        out, err = process.communicate(timeout=60)
        self.assertEqual((process.returncode, out), (0, ""), err)
        self.assertNotIn("panic", err)


class Realtime(unittest.TestCase):
    def test_noise_falls_as_history_grows_and_a_cut_starts_afresh(self):
        height, width = 24, 32
        camera = quell.Camera.perspective((0, 0, 0), (0, 0, -1), vertical_fov=45, aspect=width / height)
        # `quality` smooths the first frame so far that little noise is left to fall.
        denoiser = quell.Denoiser((height, width), preset="paper")
        random = np.random.default_rng(5)
        flat = dict(
            depth=np.full((height, width), 3, np.float32),
            normal=np.tile(np.float32([0, 0, 1]), (height, width, 1)),
            motion=np.zeros((height, width, 2), np.float32),
        )
        spreads, histories = [], []
        for _ in range(6):
            matte = random.gamma(1.0, 1.0, (height, width, 3)).astype(np.float32)
            found = denoiser.denoise(camera, matte=matte, **flat)
            spreads.append(found.color.std())
            histories.append(found.had_history)
        self.assertEqual(histories, [False] + [True] * 5)
        self.assertLess(spreads[0], 0.7 * matte.std())
        self.assertEqual(spreads, sorted(spreads, reverse=True))
        self.assertLess(spreads[-1], 0.7 * spreads[0])
        smooth = quell.Denoiser((height, width)).denoise(camera, matte=matte, **flat)
        self.assertLess(smooth.color.std(), 0.1 * matte.std())
        self.assertLess(smooth.color.std(), 0.5 * spreads[0])
        np.testing.assert_array_equal(found.color, found.matte)
        self.assertIsNone(found.glossy)
        self.assertFalse(denoiser.denoise(camera, matte=matte, index=99, **flat).had_history)
        denoiser.reset()
        self.assertFalse(denoiser.denoise(camera, matte=matte, **flat).had_history)

    def test_what_cannot_be_used_is_named(self):
        camera = quell.Camera.perspective((0, 0, 0), (0, 0, -1), vertical_fov=45, aspect=1)
        denoiser = quell.Denoiser((8, 8))
        light = np.ones((8, 8, 3), np.float32)
        for message, words in (
            (r"^matte: shape \(7, 8, 3\), expected \(8, 8, 3\)", dict(matte=light[1:])),
            (r"^depth: shape \(8, 8, 3\), expected \(8, 8\)", dict(depth=light)),
            (r"^surface_id: numbers of type float32; whole numbers", dict(surface_id=light[..., 0])),
        ):
            with self.assertRaisesRegex(quell.InputError, message):
                denoiser.denoise(camera, **words)
        with self.assertRaisesRegex(TypeError, "camera: ndarray"):
            denoiser.denoise(np.eye(4), matte=light)
        with self.assertRaisesRegex(quell.InputError, "singular or not finite"):
            denoiser.denoise(quell.Camera(np.zeros((4, 4)), (0, 0, 0)), matte=light)
        with self.assertRaisesRegex(quell.InputError, "preset: unknown preset `sequence`|preset"):
            quell.Denoiser((8, 8), preset="x")
        ids = np.arange(64).reshape(8, 8) + 2**40
        self.assertEqual(denoiser.denoise(camera, matte=light, surface_id=ids).color.shape, (8, 8, 3))


class Tables(unittest.TestCase):
    def test_every_parameter_can_be_set_to_its_default(self):
        for preset, least in (("sequence", 60), ("sequence-short", 60), ("paper", 40)):
            table = quell.parameters(preset)
            self.assertGreater(len(table), least)
            settings = {p.name: p.default for p in table}
            quell.Denoiser((4, 4), settings=settings) if preset == "paper" else quell.Sequence(settings=settings)
            self.assertTrue(all(p.doc and p.range and p.source for p in table))
        with self.assertRaisesRegex(quell.InputError, "unknown preset `x`; there are: paper, quality, sequence, sequence-short"):
            quell.parameters("x")


if __name__ == "__main__":
    unittest.main()
