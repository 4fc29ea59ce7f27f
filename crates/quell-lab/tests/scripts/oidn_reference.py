"""Open Image Denoise by its own tool, for tests/main/oidn.rs.

usage: oidn_reference.py FOLDER QUALITY

Reads color.pfm, albedo.pfm and normal.pfm in FOLDER, writes output.pfm there with the program `oidnDenoise` of the PyPI
wheel `pyoidn`, and prints the folder of the wheel's library. Exits with 77 where the wheel is not installed.
"""

import importlib.util
import pathlib
import subprocess
import sys

folder, quality = pathlib.Path(sys.argv[1]), sys.argv[2]
wheel = importlib.util.find_spec("pyoidn")
root = pathlib.Path(wheel.origin).parent / "oidn" if wheel else None
if root is None or not (root / "bin" / "oidnDenoise").is_file():
    print("the PyPI package `pyoidn` with the program oidnDenoise is not installed", file=sys.stderr)
    sys.exit(77)
images = ["--hdr", folder / "color.pfm", "--alb", folder / "albedo.pfm", "--nrm", folder / "normal.pfm"]
command = [root / "bin" / "oidnDenoise", "-d", "cpu", "--clean_aux", "-q", quality, *images]
done = subprocess.run([*command, "-o", folder / "output.pfm"], capture_output=True, text=True)
if done.returncode != 0:
    sys.exit(done.stdout + done.stderr)
print(root / "lib")
