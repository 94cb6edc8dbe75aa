"""Random PNG files (Portable Network Graphics, third edition), written without a library for pictures."""

import struct
import zlib

import numpy as np

CHANNELS = {0: 1, 2: 3, 3: 1, 4: 2, 6: 4}
DEPTHS = {0: [1, 2, 4, 8, 16], 2: [8, 16], 3: [1, 2, 4, 8], 4: [8, 16], 6: [8, 16]}
# First column and row, and their steps, of the passes of Adam7 (8.1).
ADAM7 = [(0, 0, 8, 8), (4, 0, 8, 8), (0, 4, 4, 8), (2, 0, 4, 4), (0, 2, 2, 4), (1, 0, 2, 2), (0, 1, 1, 2)]


def chunk(name, data):
    return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))


def packed(samples, depth):
    """The bytes of one row of samples (7.2)."""
    if depth == 16:
        return samples.astype(">u2").tobytes()
    if depth == 8:
        return samples.astype(np.uint8).tobytes()
    bits = (samples[:, None] >> np.arange(depth - 1, -1, -1)) & 1
    return np.packbits(bits.astype(np.uint8).reshape(-1)).tobytes()


def paeth(left, above, corner):
    estimate = left + above - corner
    to_left, to_above, to_corner = abs(estimate - left), abs(estimate - above), abs(estimate - corner)
    if to_left <= to_above and to_left <= to_corner:
        return left
    return above if to_above <= to_corner else corner


def filtered(random, rows, step):
    """Rows, each with a random filter (9.2); `step` is the number of bytes of a whole texel."""
    result = bytearray()
    before = bytes(len(rows[0]))
    for row in rows:
        kind = random.randrange(5)
        result.append(kind)
        for at, byte in enumerate(row):
            left = row[at - step] if at >= step else 0
            corner = before[at - step] if at >= step else 0
            above = before[at]
            guess = [0, left, above, (left + above) // 2, paeth(left, above, corner)][kind]
            result.append((byte - guess) & 0xFF)
        before = row
    return bytes(result)


def metadata(random):
    """Chunks that do not change the numbers of texels."""
    profile = b"profile\0\0" + zlib.compress(bytes(128))
    all_chunks = [
        chunk(b"gAMA", struct.pack(">I", random.choice([45455, 100000, 55555]))),
        chunk(b"cHRM", struct.pack(">8I", 31270, 32900, 64000, 33000, 30000, 60000, 15000, 6000)),
        chunk(b"sRGB", bytes([random.randrange(4)])),
        chunk(b"iCCP", profile),
        chunk(b"pHYs", struct.pack(">2IB", 2835, 5670, 1)),
        chunk(b"tEXt", b"Comment\0text"),
        chunk(b"zTXt", b"Comment\0\0" + zlib.compress(b"text" * 40)),
        chunk(b"iTXt", b"Comment\0\0\0en\0\0" + "für".encode()),
        chunk(b"tIME", struct.pack(">H5B", 2020, 2, 29, 23, 59, 60)),
    ]
    return random.sample(all_chunks, random.choice([0, 0, 1, 2, 4]))


def generate(random):
    """A file, its texels as red, green, blue and alpha of 8 or 16 bits, and what it is."""
    color = random.choice(list(CHANNELS))
    depth = random.choice(DEPTHS[color])
    width, height = random.choice([1, 2, 3, 5, 8, 17, 33]), random.choice([1, 2, 3, 5, 8, 17, 33])
    shape = (height, width, CHANNELS[color])
    most = (1 << depth) - 1
    palette, transparency = b"", b""
    if color == 3:
        colors = np.array([[random.randrange(256) for _ in range(3)] for _ in range(random.randint(1, most + 1))])
        palette = chunk(b"PLTE", colors.astype(np.uint8).tobytes())
        most = len(colors) - 1
    samples = np.array([random.randint(0, most) for _ in range(np.prod(shape))]).reshape(shape)
    if random.random() < 0.3:
        # Runs, which compress differently from noise.
        samples[:] = np.repeat(samples[:, :1], width, axis=1)
    deep = depth == 16
    opaque = 65535 if deep else 255
    if color == 3:
        alphas = np.full(len(colors), 255)
        if random.random() < 0.5:
            given = [random.randrange(256) for _ in range(random.randint(1, len(colors)))]
            alphas[: len(given)] = given
            transparency = chunk(b"tRNS", bytes(given))
        index = samples[:, :, 0]
        texels = np.dstack([colors[index], alphas[index]])
    else:
        scaled = samples * (opaque // ((1 << depth) - 1))
        if CHANNELS[color] in (1, 2):
            texels = np.dstack([scaled[:, :, :1]] * 3)
        else:
            texels = scaled[:, :, :3]
        if color in (4, 6):
            alpha = scaled[:, :, -1]
        else:
            alpha = np.full((height, width), opaque)
            if random.random() < 0.5:
                clear = samples[random.randrange(height), random.randrange(width)]
                transparency = chunk(b"tRNS", clear.astype(">u2").tobytes())
                alpha[(samples == clear).all(axis=2)] = 0
        texels = np.dstack([texels, alpha])
    interlaced = random.random() < 0.4
    step = max(1, CHANNELS[color] * depth // 8)
    data = b""
    for left, top, right, down in ADAM7 if interlaced else [(0, 0, 1, 1)]:
        part = samples[top::down, left::right]
        if part.size:
            data += filtered(random, [packed(row.reshape(-1), depth) for row in part], step)
    compressed = zlib.compress(data, random.randrange(10))
    pieces = random.choice([1, 1, 3])
    size = -(-len(compressed) // pieces)
    header = struct.pack(">2I5B", width, height, depth, color, 0, 0, interlaced)
    file = b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + b"".join(metadata(random)) + palette + transparency
    file += b"".join(chunk(b"IDAT", compressed[at : at + size]) for at in range(0, len(compressed), size))
    file += chunk(b"IEND", b"")
    kind = f"PNG of colour type {color}, {depth} bits{', interlaced' * interlaced}{', tRNS' * bool(transparency)}"
    return file, texels.astype("<u2" if deep else np.uint8), kind
