# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the program `quell` is."""
import os
import shutil
import subprocess
import sys
import sysconfig

from .errors import Problem

WHERE_TO_GET_IT = "https://github.com/quell-denoise/quell (README, I render animations)"

# A console window would flash up on Windows.
NO_WINDOW = getattr(subprocess, "CREATE_NO_WINDOW", 0)


def _file_name():
    return "quell.exe" if sys.platform == "win32" else "quell"


def _runs(path):
    return os.path.isfile(path) and os.access(path, os.X_OK)


def find(preference="", blend_folder="", search_path=None, home=None):
    """The program's path: from the preferences, else PATH, else the .blend file's folder, else where cargo and pip install.

    `preference` may name the program or its folder; what is named there and missing is an error, never passed over.
    """
    name = _file_name()
    if preference:
        for path in (preference, os.path.join(preference, name)):
            if _runs(path):
                return os.path.abspath(path)
        raise Problem(
            f"The preferences of quell Denoise name {preference}, but there is no program there. "
            "Correct it, or empty the field to search PATH"
        )
    found = shutil.which("quell", path=search_path)
    if found:
        return os.path.abspath(found)
    # Blender does not see the PATH of a terminal when it is started from a desktop.
    own = home or os.path.expanduser("~")
    folders = [blend_folder, os.path.join(own, ".cargo", "bin"), os.path.join(own, ".local", "bin")]
    if home is None:
        # `pip install quell-denoise`: for this user, or into Blender's own Python.
        folders += [sysconfig.get_path("scripts", f"{os.name}_user"), sysconfig.get_path("scripts")]
    for folder in folders:
        if folder and _runs(os.path.join(folder, name)):
            return os.path.abspath(os.path.join(folder, name))
    raise Problem(
        "The program quell was not found: the preferences name none, and it is neither on PATH nor beside the .blend file. "
        f"Get it from {WHERE_TO_GET_IT}"
    )


def version(path):
    """What the program says of its version, such as `quell 0.1.0`; a Problem where it does not run."""
    try:
        done = subprocess.run(
            [path, "--version"], capture_output=True, timeout=20, stdin=subprocess.DEVNULL, creationflags=NO_WINDOW
        )
    except (OSError, subprocess.SubprocessError) as error:
        raise Problem(f"{path} does not run: {error}") from error
    text = done.stdout.decode("utf-8", "replace").strip()
    if done.returncode != 0 or not text.startswith("quell"):
        raise Problem(f"{path} is not the program quell: asked for its version, it said {text[:60]!r}")
    return text.splitlines()[0]
