# SPDX-License-Identifier: GPL-3.0-or-later
"""Files of the render, folder of the result, frame numbers. Paths are made by Blender itself and only looked at here."""
import os
import tempfile
from dataclasses import dataclass

from .errors import Problem

RESULT_FOLDER = "quell"
# Windows refuses command lines of 32767 characters.
COMMAND_LINE_LIMIT = 30000


@dataclass(frozen=True)
class Sequence:
    """The files of a render: `names[i]` in `folder` is frame `numbers[i]`."""

    folder: str
    numbers: tuple
    names: tuple
    pattern: str

    @property
    def result(self):
        """Where clean frames go: beside the render, same names."""
        return os.path.join(self.folder, RESULT_FOLDER)

    def existing(self):
        """Frame numbers whose file is there."""
        return tuple(n for n, name in zip(self.numbers, self.names) if os.path.isfile(os.path.join(self.folder, name)))

    def results(self):
        """Frame numbers whose clean file is there."""
        return tuple(n for n, name in zip(self.numbers, self.names) if os.path.isfile(os.path.join(self.result, name)))

    def name(self, number):
        return self.names[self.numbers.index(number)]


def sequence(frame_path, first, last, step=1, saved=True):
    """The sequence of a scene.

    `frame_path(frame)` is Blender's own `render.frame_path`: it knows `#`, templates, extensions. `saved` is false while the
    .blend file has no name, so that relative paths mean nothing.
    """
    numbers = tuple(range(first, last + 1, max(step, 1)))
    if not numbers:
        raise Problem(f"The frame range {first} to {last} is empty")
    paths = [frame_path(n) for n in numbers]
    if not os.path.isabs(paths[0]):
        raise Problem(
            "Save the .blend file first: the output path is relative to it"
            if not saved
            else f"The output path {paths[0]} is not absolute: choose a folder in Output properties"
        )
    folder = os.path.dirname(paths[0])
    names = tuple(os.path.basename(path) for path in paths)
    if any(os.path.dirname(path) != folder for path in paths) or len(set(names)) != len(names):
        raise Problem(f"The frames do not lie in one folder under names of their own: {paths[0]}, {paths[-1]}")
    if not names[0].lower().endswith(".exr"):
        raise Problem(f"The frames are no OpenEXR files ({names[0]}): press Prepare, or choose OpenEXR MultiLayer in Output")
    return Sequence(folder, numbers, names, _pattern(frame_path))


def _pattern(frame_path):
    """The file name with `#` for the digits of the frame number, found by asking for frames of more and more eights."""
    short = os.path.basename(frame_path(1))
    width, name = 0, ""
    for digits in range(1, 20):
        eights = os.path.basename(frame_path(int("8" * digits)))
        if len(eights) != len(short):
            break
        width, name = digits, eights
    at = next((i for i, (a, b) in enumerate(zip(name, short)) if a != b), None)
    if not width or at is None:
        return ""
    # Padded, frame 1 is 0001: it differs from 8888 in every digit of the number.
    return name[:at] + "#" * width + name[at + width :]


def inputs(found, numbers):
    """Arguments of `quell denoise`, run in the render's folder: which frames to read and to write.

    Only the scene's own range is read, so that old frames beside it never leak into its ends; a sequence too long for a
    command line is given as a pattern.
    """
    names = [found.name(n) for n in numbers]
    if sum(len(name) + 3 for name in names) < COMMAND_LINE_LIMIT or not found.pattern:
        return ["--", *names]
    return [f"--frames={ranges(numbers)}", "--", found.pattern]


def ranges(numbers):
    """`1-4,7`"""
    parts = []
    for n in numbers:
        if parts and parts[-1][1] + 1 == n:
            parts[-1][1] = n
        else:
            parts.append([n, n])
    return ",".join(str(a) if a == b else f"{a}-{b}" for a, b in parts)


def check_writable(folder):
    """Makes the folder and tries a file in it: better known before a night of rendering than after it."""
    if os.path.isfile(folder):
        # The program beside the .blend file, and the render there too.
        raise Problem(f"{folder} is a file, and the folder for clean frames cannot be made: render into a folder of its own")
    try:
        os.makedirs(folder, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        reason = error.strerror or error
        raise Problem(f"Cannot write to {folder}: {reason}. Choose another folder in Output properties") from error
