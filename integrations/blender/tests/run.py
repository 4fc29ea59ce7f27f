"""Builds the extension with Blender's own packager and tests it in each Blender given.

    python3 integrations/blender/tests/run.py QUELL PYTHON [PYTHON ...]

QUELL is the built program; each PYTHON has a wheel of bpy (`pip install bpy==4.5.15`, `bpy==5.0.1`; Python 3.11), or is a Blender
(`blender`, 4.2 or later). Preferences and extensions of this user are not touched. The plain tests run first.
"""
import os
import subprocess
import sys
import tempfile

HERE = os.path.dirname(os.path.abspath(__file__))
SOURCE = os.path.join(HERE, "..", "quell_denoise")
# Without a window Blender packs as `blender --command extension build`; a wheel has no such command line, but the same script.
PACKAGER = """
import os, runpy, sys
import bpy, addon_utils
[path] = [p for p in addon_utils.paths() if os.path.isfile(os.path.join(p, "bl_pkg", "cli", "blender_ext.py"))]
sys.argv = ["blender_ext", "build", "--source-dir", SOURCE, "--output-filepath", ZIP]
runpy.run_path(os.path.join(path, "bl_pkg", "cli", "blender_ext.py"), run_name="__main__")
"""


def run(blender, script, arguments, user):
    environment = {**os.environ, "BLENDER_USER_RESOURCES": user, "PYTHONDONTWRITEBYTECODE": "1"}
    if "python" in os.path.basename(blender):
        line = [blender, script, *arguments]
    else:
        line = [blender, "--background", "--python-exit-code", "1", "--python", script, "--", *arguments]
    return subprocess.run(line, env=environment).returncode


def main():
    if len(sys.argv) < 3:
        raise SystemExit(__doc__)
    quell, blenders = os.path.abspath(sys.argv[1]), sys.argv[2:]
    plain = [sys.executable, "-m", "unittest", "discover", "-s", HERE, "-p", "test_plain.py"]
    failed = ["test_plain.py"] if subprocess.run(plain).returncode else []
    for blender in blenders:
        with tempfile.TemporaryDirectory() as folder:
            user, work = os.path.join(folder, "user"), os.path.join(folder, "work")
            os.makedirs(user)
            os.makedirs(work)
            zipped, packager = os.path.join(folder, "quell_denoise.zip"), os.path.join(folder, "packager.py")
            with open(packager, "w") as file:
                file.write(f"SOURCE, ZIP = {SOURCE!r}, {zipped!r}\n{PACKAGER}")
            run(blender, packager, [], user)
            arguments = [zipped, quell, work]
            if not os.path.exists(zipped) or run(blender, os.path.join(HERE, "test_blender.py"), arguments, user):
                failed.append(blender)
    print(f"FAILED: {', '.join(failed)}" if failed else "all passed")
    raise SystemExit(bool(failed))


if __name__ == "__main__":
    main()
