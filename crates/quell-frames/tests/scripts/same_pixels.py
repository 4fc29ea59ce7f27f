"""The reference library reads from files written by quell what it reads from their originals.

Needs PyPI `OpenEXR` and `numpy`. Run: python same_pixels.py FOLDER_OF_ORIGINALS WRITTEN...
The written files are called `copy-NAME` and `anew-NAME`, with `-` for the `/` of a folder.
"""

import os
import sys

import numpy as np
import OpenEXR

OURS = ("quell.",)
STORAGE = ("compression", "chunkCount")


def parts(path):
    with OpenEXR.File(path, separate_channels=True) as file:
        return [(dict(part.header), {n: c.pixels for n, c in part.channels.items()}) for part in file.parts]


def text(value):
    return repr([np.asarray(v).tolist() for v in value]) if isinstance(value, tuple) else repr(value)


def main(folder, written):
    originals = {}
    for root, _, names in os.walk(folder):
        for name in names:
            path = os.path.join(root, name)
            originals[os.path.relpath(path, folder).replace(os.sep, "-")] = path
    for path in written:
        before = parts(originals[os.path.basename(path)[5:]])
        after = parts(path)
        assert len(before) == len(after), path
        for (header_before, channels_before), (header, channels) in zip(before, after):
            for name, value in header_before.items():
                if name not in STORAGE and name != "channels":
                    assert text(header[name]) == text(value), (path, name, header[name], value)
            assert list(channels) == list(channels_before), path
            for name, pixels in channels_before.items():
                assert channels[name].dtype == pixels.dtype, (path, name)
                assert np.array_equal(channels[name], pixels, equal_nan=pixels.dtype.kind == "f"), (path, name)
    print(f"{len(written)} files hold what their originals hold")


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2:])
