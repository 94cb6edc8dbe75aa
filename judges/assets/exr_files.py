"""Random OpenEXR files ("OpenEXR File Layout"): written without a library, or by OpenEXR where a
compression is more than deflate and runs."""

import struct
import zlib

import numpy as np

KINDS = {"uint": (0, "<u4"), "half": (1, "<f2"), "float": (2, "<f4")}
NONE, RLE, ZIPS, ZIP = range(4)
LINES = {NONE: 1, RLE: 1, ZIPS: 1, ZIP: 16}
# The channels of each picture, those that the picture shows first: red, green, blue and alpha, of
# which some have a default, or grey and alpha.
PICTURES = [
    ("rgb", ["R", "G", "B"]), ("rgba", ["R", "G", "B", "A"]), ("rgb", ["R", "G", "B"]), ("rgba", ["R", "G", "B", "A"]),
    ("grey", ["Y"]), ("grey alpha", ["Y", "A"]), ("grey", ["Z"]), ("grey", ["A"]), ("grey", ["depth"]),
    ("rgb", ["R"]), ("rgb", ["R", "G"]), ("rgb", ["X", "Y", "Z"]), ("rgb", ["U", "V"]), ("rgb", ["r", "g", "b"]),
    ("rgba", ["R", "G", "B", "A", "Z", "N.X"]), ("rgb", ["diffuse.R", "diffuse.G", "diffuse.B", "Z"]),
    ("rgb", ["R", "G", "B", "left.R", "left.G", "left.B"]), ("grey", ["a.b.Y", "c.Y", "Z"]),
]


def attribute(name, kind, value):
    return name + b"\0" + kind + b"\0" + struct.pack("<i", len(value)) + value


def run_lengths(data):
    result, at = bytearray(), 0
    while at < len(data):
        length = 1
        while at + length < len(data) and data[at + length] == data[at] and length < 128:
            length += 1
        if length > 2:
            result += bytes([length - 1, data[at]])
        else:
            length = min(7, len(data) - at)
            result += bytes([256 - length]) + data[at : at + length]
        at += length
    return bytes(result)


def compressed(data, compression):
    """Even bytes before odd ones, as differences; plain where that is not shorter."""
    if compression == NONE:
        return data
    numbers = np.frombuffer(data, np.uint8)
    numbers = np.concatenate([numbers[::2], numbers[1::2]]).astype(int)
    numbers[1:] = numbers[1:] - numbers[:-1] + 128
    changed = numbers.astype(np.uint8).tobytes()
    smaller = run_lengths(changed) if compression == RLE else zlib.compress(changed)
    return smaller if len(smaller) < len(data) else data


def block(planes, order, rows, columns):
    return b"".join(planes[name][y, columns].tobytes() for y in range(*rows.indices(10**9)) for name in order)


def levels(mode, up, width, height):
    """Number of a level along x and y, and its size."""
    def size(side, level):
        return max(1, (side + (1 << level) * up - up) >> level)

    def count(side):
        return ((side - 1).bit_length() if up else side.bit_length() - 1) + 1

    if mode == 0:
        return [(0, 0, width, height)]
    if mode == 1:
        return [(at, at, size(width, at), size(height, at)) for at in range(count(max(width, height)))]
    across, down = range(count(width)), range(count(height))
    return [(x, y, size(width, x), size(height, y)) for y in down for x in across]


class Part:
    """The header and the chunks of a part of a file."""

    def __init__(self, random, planes, data_window, display_window, compression, tiled):
        order = sorted(planes)
        listed = b"".join(
            name.encode() + b"\0" + struct.pack("<iB3xii", kind_of(planes[name]), 0, 1, 1) for name in order)
        line_order = random.choice([0, 0, 1])
        self.attributes = [
            attribute(b"channels", b"chlist", listed + b"\0"),
            attribute(b"compression", b"compression", bytes([compression])),
            attribute(b"dataWindow", b"box2i", struct.pack("<4i", *data_window)),
            attribute(b"displayWindow", b"box2i", struct.pack("<4i", *display_window)),
            attribute(b"lineOrder", b"lineOrder", bytes([line_order])),
            attribute(b"pixelAspectRatio", b"float", struct.pack("<f", 1)),
            attribute(b"screenWindowCenter", b"v2f", bytes(8)),
            attribute(b"screenWindowWidth", b"float", struct.pack("<f", 1)),
        ]
        self.chunks = []
        height, width = planes[order[0]].shape
        left, top = data_window[:2]
        if tiled:
            across, down = random.choice([4, 16, 64]), random.choice([4, 16, 64])
            mode, up = random.choice([0, 0, 1, 2]), random.randrange(2)
            self.attributes.append(
                attribute(b"tiles", b"tiledesc", struct.pack("<IIB", across, down, mode | up << 4)))
            for level_x, level_y, w, h in levels(mode, up, width, height):
                own = planes
                if level_x or level_y:
                    own = {name: np.zeros((h, w), planes[name].dtype) for name in order}
                rows = [(y, x) for y in range(-(-h // down)) for x in range(-(-w // across))]
                for y, x in rows:
                    part = block(own, order, slice(y * down, min(h, (y + 1) * down)),
                                 slice(x * across, min(w, (x + 1) * across)))
                    self.chunks.append((struct.pack("<4i", x, y, level_x, level_y), compressed(part, compression)))
        else:
            lines = LINES[compression]
            for y in range(0, height, lines):
                part = block(planes, order, slice(y, min(height, y + lines)), slice(0, width))
                self.chunks.append((struct.pack("<i", top + y), compressed(part, compression)))
        # Offsets are in the order of y; chunks are in the order of the file.
        self.backwards = line_order == 1 and not tiled


def kind_of(plane):
    return {np.dtype(dtype): number for number, dtype in KINDS.values()}[plane.dtype]


def file_of(parts, tiled):
    many = len(parts) > 1
    version = 2 | (0x200 if tiled and not many else 0) | (0x1000 if many else 0)
    head = struct.pack("<II", 20000630, version)
    for number, part in enumerate(parts):
        head += b"".join(part.attributes)
        if many:
            kind = b"tiledimage" if tiled else b"scanlineimage"
            head += attribute(b"name", b"string", b"part%d" % number) + attribute(b"type", b"string", kind)
            head += attribute(b"chunkCount", b"int", struct.pack("<i", len(part.chunks)))
        head += b"\0"
    if many:
        head += b"\0"
    at = len(head) + 8 * sum(len(part.chunks) for part in parts)
    offsets, body = b"", b""
    for number, part in enumerate(parts):
        own = [0] * len(part.chunks)
        order = range(len(own))
        for chunk in reversed(order) if part.backwards else order:
            place, data = part.chunks[chunk]
            own[chunk] = at + len(body)
            body += (struct.pack("<i", number) if many else b"") + place + struct.pack("<i", len(data)) + data
        offsets += struct.pack(f"<{len(own)}Q", *own)
    return head + offsets + body


def plane(random, kind, height, width, finite):
    count = height * width
    dtype = np.dtype(KINDS[kind][1])
    bits = np.array([random.getrandbits(8 * dtype.itemsize) for _ in range(count)], f"<u{dtype.itemsize}")
    if random.random() < 0.5:
        return (bits % 1000).reshape(height, width).astype(dtype)
    numbers = bits.view(dtype).reshape(height, width)
    if finite and kind != "uint":
        numbers = np.where(np.isfinite(numbers), numbers, dtype.type(1))
    return numbers.astype(dtype)


def shown(what, names, planes, data_window, display_window):
    """The texels of the display window as floats."""
    left, top, right, bottom = display_window
    own_left, own_top = data_window[:2]
    width, height = right - left + 1, bottom - top + 1
    count = {"grey": 1, "grey alpha": 2, "rgb": 3, "rgba": 4}[what]
    texels = np.zeros((height, width, 4), np.float32)
    grey = what.startswith("grey")
    if what in ("grey", "rgb"):
        texels[:, :, 3] = 1
    target = [[0, 1, 2], [3]] if grey else [[0], [1], [2], [3]]
    with np.errstate(invalid="ignore"):
        for name, channels in zip(names[:count], target):
            canvas = np.zeros((height, width), np.float32)
            own = planes[name].astype(np.float32)
            for y in range(height):
                for x in range(width):
                    row, column = y + top - own_top, x + left - own_left
                    if 0 <= row < own.shape[0] and 0 <= column < own.shape[1]:
                        canvas[y, x] = own[row, column]
            for channel in channels:
                texels[:, :, channel] = canvas
    return texels


def windows(random, width, height):
    left, top = random.choice([0, 0, 3, -5]), random.choice([0, 0, -2, 7])
    data = (left, top, left + width - 1, top + height - 1)
    if random.random() < 0.6:
        return data, data
    moved = [side + random.randrange(-3, 4) for side in data]
    return data, (moved[0], moved[1], max(moved[0], moved[2]), max(moved[1], moved[3]))


def generate(random):
    """A file, its texels, what its channels are, their names, both windows, and what it is."""
    what, names = random.choice(PICTURES)
    width, height = random.choice([1, 2, 5, 17, 40]), random.choice([1, 3, 16, 33])
    kind = random.choice(list(KINDS))
    kinds = {name: kind if random.random() < 0.8 else random.choice(list(KINDS)) for name in names}
    planes = {name: plane(random, kinds[name], height, width, False) for name in names}
    data_window, display_window = windows(random, width, height)
    compression, tiled = random.choice([NONE, RLE, ZIPS, ZIP]), random.random() < 0.3
    parts = [Part(random, planes, data_window, display_window, compression, tiled)]
    if random.random() < 0.15:
        other = {"Q": plane(random, "half", height, width, False)}
        parts.append(Part(random, other, data_window, display_window, compression, tiled))
    texels = shown(what, names, planes, data_window, display_window)
    label = f"EXR of {kinds}, compression {compression}, windows {data_window} {display_window}"
    label += f"{', tiled' * tiled}, {len(parts)} parts"
    return file_of(parts, tiled), texels, what, names, (data_window, display_window), label


def generate_with_library(random, path):
    """Writes a file whose compression changes numbers or is not described in the file layout; returns
    what its channels are, their names, its window, and what it is."""
    import OpenEXR

    what, names = random.choice([PICTURES[0], PICTURES[1], PICTURES[4]])
    width, height = random.choice([1, 4, 5, 33, 40]), random.choice([1, 3, 32, 40])
    compression = random.choice(["PIZ", "PXR24", "B44", "B44A", "DWAA", "DWAB"])
    kind = random.choice(list(KINDS))
    planes = {name: plane(random, kind, height, width, True) for name in names}
    header = {"compression": getattr(OpenEXR, f"{compression}_COMPRESSION"), "type": OpenEXR.scanlineimage}
    with OpenEXR.File(header, planes) as file:
        file.write(str(path))
    window = (0, 0, width - 1, height - 1)
    return what, names, window, f"EXR of {names}, {kind}, {compression}"
