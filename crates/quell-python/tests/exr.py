"""EXR files as tests need them: one part, scan lines, uncompressed. Channels are arrays (height, width), float16 or float32."""

import struct

import numpy as np

_TYPES = {1: np.float16, 2: np.float32, 0: np.uint32}


def _attribute(name, kind, data):
    return name.encode() + b"\0" + kind.encode() + b"\0" + struct.pack("<i", len(data)) + data


def write(path, channels, texts=None):
    names = sorted(channels)
    height, width = channels[names[0]].shape
    arrays = [np.ascontiguousarray(channels[name]) for name in names]
    listed = b"".join(
        name.encode() + b"\0" + struct.pack("<iB3xii", 1 if array.dtype == np.float16 else 2, 0, 1, 1)
        for name, array in zip(names, arrays)
    )
    box = struct.pack("<4i", 0, 0, width - 1, height - 1)
    header = struct.pack("<ii", 20000630, 2)
    header += _attribute("channels", "chlist", listed + b"\0")
    header += _attribute("compression", "compression", b"\0")
    header += _attribute("dataWindow", "box2i", box) + _attribute("displayWindow", "box2i", box)
    header += _attribute("lineOrder", "lineOrder", b"\0")
    header += _attribute("pixelAspectRatio", "float", struct.pack("<f", 1.0))
    header += _attribute("screenWindowCenter", "v2f", struct.pack("<2f", 0.0, 0.0))
    header += _attribute("screenWindowWidth", "float", struct.pack("<f", 1.0))
    for name, text in (texts or {}).items():
        header += _attribute(name, "string", text.encode())
    header += b"\0"
    row = sum(array.itemsize for array in arrays) * width
    first = len(header) + 8 * height
    with open(path, "wb") as file:
        file.write(header)
        file.write(b"".join(struct.pack("<Q", first + y * (8 + row)) for y in range(height)))
        for y in range(height):
            file.write(struct.pack("<ii", y, row))
            file.write(b"".join(array[y].tobytes() for array in arrays))


def read(path):
    """The channels of such a file."""
    with open(path, "rb") as file:
        data = file.read()
    at = 8

    def word():
        nonlocal at
        end = data.index(b"\0", at)
        text, at = data[at:end].decode(), end + 1
        return text

    found = {}
    while name := word():
        kind = word()
        (length,) = struct.unpack_from("<i", data, at)
        found[name] = (kind, data[at + 4 : at + 4 + length])
        at += 4 + length
    assert found["compression"][1] == b"\0", "compressed"
    x0, y0, x1, y1 = struct.unpack("<4i", found["dataWindow"][1])
    width, height = x1 - x0 + 1, y1 - y0 + 1
    listed, channels = found["channels"][1], []
    place = 0
    while listed[place]:
        end = listed.index(b"\0", place)
        kind = struct.unpack_from("<i", listed, end + 1)[0]
        channels.append((listed[place:end].decode(), np.dtype(_TYPES[kind])))
        place = end + 17
    made = {name: np.empty((height, width), dtype) for name, dtype in channels}
    offsets = struct.unpack_from(f"<{height}Q", data, at)
    for offset in offsets:
        (y,) = struct.unpack_from("<i", data, offset)
        place = offset + 8
        for name, dtype in channels:
            made[name][y - y0] = np.frombuffer(data, dtype, width, place)
            place += width * dtype.itemsize
    return made
