"""Random Radiance HDR files ("Radiance File Formats", G. Ward)."""

import numpy as np

# Axis of the rows and of the texels of a row; the sign of X is that of left to right, and that of Y
# is of bottom to top.
ORIENTATIONS = ["-Y +X", "-Y -X", "+Y -X", "+Y +X", "+X -Y", "-X -Y", "-X +Y", "+X +Y"]


def runs(random, row):
    """A row in the newer encoding: each component in runs."""
    result = bytearray([2, 2, len(row) >> 8, len(row) & 255])
    for component in row.T:
        at = 0
        while at < len(component):
            length = 1
            while at + length < len(component) and component[at + length] == component[at] and length < 127:
                length += 1
            if length > 1 and random.random() < 0.9:
                result += bytes([128 + length, component[at]])
            else:
                length = min(random.randint(1, 128), len(component) - at)
                result += bytes([length]) + component[at : at + length].tobytes()
            at += length
    return bytes(result)


def repeated(row):
    """A row in the older encoding: a texel of mantissas 1 repeats the one before it."""
    result = bytearray()
    at = 0
    while at < len(row):
        length = 1
        while at + length < len(row) and (row[at + length] == row[at]).all():
            length += 1
        result += row[at].tobytes()
        count = length - 1
        while count:
            result += bytes([1, 1, 1, count & 255])
            count >>= 8
        at += length
    return bytes(result)


def generate(random):
    """A file, its texels as floats, and what it is."""
    length, rows = random.choice([1, 3, 7, 8, 9, 40, 300]), random.choice([1, 2, 5, 9])
    stored = np.array([random.randrange(256) for _ in range(rows * length * 4)]).reshape(rows, length, 4)
    stored = stored.astype(np.uint8)
    # Exponents around 1, the ends of the range, and black; mantissas as a writer normalizes them.
    exponents = random.choice([[0], [1], [255], [0, 1, 20, 120, 128, 140, 255]])
    stored[:, :, 3] = np.array(exponents)[stored[:, :, 3] % len(exponents)]
    stored[:, :, 0] |= 128
    if random.random() < 0.5:
        wide = random.choice([2, 4, 128])
        stored = np.repeat(stored[:, ::wide], wide, axis=1)[:, :length]
    encodings = ["flat", "older"] + ["newer"] * (8 <= length < 32768)
    used = random.choice(encodings)
    encode = {"flat": lambda row: row.tobytes(), "older": repeated, "newer": lambda row: runs(random, row)}[used]
    orientation = random.choice(ORIENTATIONS[:1] * 8 + ORIENTATIONS)
    ends = random.choice(["\n", "\n", "\r\n"])
    lines = [random.choice(["#?RADIANCE", "#?RGBE"]), "# generated"]
    given = ["FORMAT=32-bit_rle_rgbe", "EXPOSURE=1.0", "SOFTWARE=a b", "PRIMARIES=.64 .33 .3 .6 .15 .06 .3127 .329"]
    lines += given[:1] + random.sample(given[1:], random.randrange(3))
    (rows_axis, texels_axis) = orientation.split()
    lines += ["", f"{rows_axis} {rows} {texels_axis} {length}", ""]
    file = ends.join(lines).encode() + b"".join(encode(row) for row in stored)
    numbers = stored[:, :, :3].astype(np.float64)
    exponents = stored[:, :, 3:].astype(np.int64)
    numbers = np.where(exponents == 0, 0.0, np.ldexp(numbers, exponents - 136)).astype("<f4")
    if "X" in rows_axis:
        numbers = numbers.transpose(1, 0, 2)
    if "-X" in orientation:
        numbers = numbers[:, ::-1]
    if "+Y" in orientation:
        numbers = numbers[::-1]
    texels = np.dstack([numbers, np.ones(numbers.shape[:2], "<f4")])
    kind = f"HDR {orientation}, {used}, lines end with {ends!r}"
    return file, texels, kind
