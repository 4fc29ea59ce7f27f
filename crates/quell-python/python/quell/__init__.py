"""Removes the noise from path-traced animations.

`denoise` takes arrays, one frame or a sequence; `Sequence` takes frames one by one; `denoise_files` EXR files; `Denoiser` is
the real-time filter. `doctor` says what is wrong with files, `parameters` what can be set. The command `quell` comes with the
package. docs/python.md has worked examples.
"""

import atexit as _atexit

from . import _quell
from ._errors import Error, FileError, InputError, QuellWarning
from ._files import Report, denoise_files, doctor
from ._quell import version as _version
from ._realtime import Camera, Denoised, Denoiser
from ._sequence import Clean, Sequence, denoise
from ._settings import Parameter, parameters

__version__ = _version()

# Daemon threads that filter end after the frame in hand; killed in the middle they would take the process with them.
_atexit.register(_quell.finish)

__all__ = [
    "Camera",
    "Clean",
    "Denoised",
    "Denoiser",
    "Error",
    "FileError",
    "InputError",
    "Parameter",
    "QuellWarning",
    "Report",
    "Sequence",
    "denoise",
    "denoise_files",
    "doctor",
    "parameters",
]
