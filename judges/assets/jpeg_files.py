"""Random JPEG files (ITU-T T.81, T.871, T.872), written without a library for pictures: sequential and
progressive, in any scans, with any sampling factors, restarts and code tables."""

import struct

import numpy as np

ZIGZAG = np.array(sorted(range(64), key=lambda at: (
    at // 8 + at % 8, at // 8 if (at // 8 + at % 8) % 2 else at % 8)))
AT = np.arange(8)
# The rows are the cosines of A.3.3.
COSINES = np.where(AT[:, None] == 0, 0.5**0.5, 1.0) / 2 * np.cos((2 * AT + 1) * AT[:, None] * np.pi / 16)

GRAY, YCBCR, RGB, CMYK, YCCK = "grey", "YCbCr", "RGB", "CMYK", "YCCK"


class Bits:
    """Entropy-coded data: symbols and bits, until the codes of the symbols are known."""

    def __init__(self):
        self.tokens = []

    def symbol(self, table, value):
        self.tokens.append((table, value))

    def bits(self, value, count):
        if count:
            self.tokens.append((None, (value, count)))

    def restart(self, number):
        self.tokens.append(("restart", number))

    def used(self):
        tables = {}
        for table, value in self.tokens:
            if table not in (None, "restart"):
                counts = tables.setdefault(table, {})
                counts[value] = counts.get(value, 0) + 1
        return tables

    def data(self, codes):
        result, buffer, filled = bytearray(), 0, 0

        def flush():
            nonlocal buffer, filled
            while filled >= 8:
                byte = (buffer >> (filled - 8)) & 0xFF
                result.append(byte)
                if byte == 0xFF:
                    result.append(0)
                filled -= 8
            buffer &= (1 << filled) - 1

        def pad():
            nonlocal buffer, filled
            if filled % 8:
                missing = 8 - filled % 8
                buffer, filled = (buffer << missing) | ((1 << missing) - 1), filled + missing
            flush()

        for table, value in self.tokens:
            if table == "restart":
                pad()
                result.extend([0xFF, 0xD0 + value % 8])
                continue
            code, count = value if table is None else codes[table][value]
            buffer, filled = (buffer << count) | code, filled + count
            flush()
        pad()
        return bytes(result)


def code_table(random, counts):
    """Numbers of codes of each length with their symbols, and the code of each symbol (annex C)."""
    symbols = sorted(counts, key=lambda symbol: (-counts[symbol], symbol))
    lengths = [0] * 17
    if random.random() < 0.5:
        # All codes have one length; that of ones alone is no code.
        lengths[max(1, len(symbols).bit_length())] = len(symbols)
    else:
        # A few short codes, and a block of long ones.
        short = min(random.randint(0, 6), len(symbols) - 1)
        for length in range(1, short + 1):
            lengths[length] = 1
        rest = len(symbols) - short
        lengths[short + max(1, rest.bit_length())] += rest
    codes, code, at = {}, 0, 0
    for length in range(1, 17):
        for _ in range(lengths[length]):
            codes[symbols[at]] = (code, length)
            code, at = code + 1, at + 1
        code <<= 1
    return bytes(lengths[1:]) + bytes(symbols), codes


def magnitude(value):
    """The size of a number, and its bits (F.1.2.1)."""
    size = abs(value).bit_length()
    return size, value if value >= 0 else value + (1 << size) - 1


class Scan:
    """Encodes blocks of a scan: all of their coefficients, or a part of a progression."""

    def __init__(self, band, high, low, progressive):
        (self.first, self.last), self.high, self.low = band, high, low
        self.progressive = progressive
        self.bits = Bits()
        self.reset()

    def reset(self):
        self.before = {}
        self.run, self.pending, self.table = 0, [], None

    def end_run(self):
        if self.run:
            size = self.run.bit_length() - 1
            self.bits.symbol(self.table, size << 4)
            self.bits.bits(self.run & ((1 << size) - 1), size)
            self.run = 0
        self.corrections(self.pending)
        self.pending = []

    def corrections(self, bits):
        for bit in bits:
            self.bits.bits(bit, 1)

    def block(self, component, block, tables):
        """A block in zigzag order."""
        dc, ac = ("dc", tables), ("ac", tables)
        if self.first == 0:
            value = int(block[0]) >> self.low
            if self.high:
                self.bits.bits(value & 1, 1)
            else:
                size, bits = magnitude(value - self.before.get(component, 0))
                self.before[component] = value
                self.bits.symbol(dc, size)
                self.bits.bits(bits, size)
        if self.last == 0:
            return
        self.table = ac
        numbers = [int(number) for number in block[max(self.first, 1) : self.last + 1]]
        numbers = [abs(number) >> self.low if number >= 0 else -(abs(number) >> self.low) for number in numbers]
        if self.high:
            self.refine(ac, numbers)
        else:
            self.coefficients(ac, numbers)

    def coefficients(self, table, numbers):
        zeros = 0
        for number in numbers:
            if number == 0:
                zeros += 1
                continue
            self.end_run()
            while zeros > 15:
                self.bits.symbol(table, 0xF0)
                zeros -= 16
            size, bits = magnitude(number)
            self.bits.symbol(table, zeros << 4 | size)
            self.bits.bits(bits, size)
            zeros = 0
        if zeros:
            self.run += 1
            if not self.progressive or self.run == 0x7FFF:
                self.end_run()

    def refine(self, table, numbers):
        """The next bit of numbers (G.1.2.3)."""
        news = [at for at, number in enumerate(numbers) if abs(number) == 1]
        last = news[-1] if news else -1
        zeros, own = 0, []
        for at, number in enumerate(numbers):
            if number == 0:
                zeros += 1
                continue
            while zeros > 15 and at <= last:
                self.end_run()
                self.bits.symbol(table, 0xF0)
                zeros -= 16
                self.corrections(own)
                own = []
            if abs(number) > 1:
                own.append(abs(number) & 1)
                continue
            self.end_run()
            self.bits.symbol(table, zeros << 4 | 1)
            self.bits.bits(number > 0, 1)
            self.corrections(own)
            zeros, own = 0, []
        if zeros or own:
            self.run += 1
            self.pending += own
            if self.run == 0x7FFF or len(self.pending) > 900:
                self.end_run()


def segment(marker, data):
    return struct.pack(">BBH", 0xFF, marker, len(data) + 2) + data


def exif(random, orientation):
    """Exif data with the orientation (Exif 3.0, 4.6)."""
    order = random.choice("<>")
    entries = [(0x0112, 3, 1, struct.pack(order + "HH", orientation, 0))]
    if random.random() < 0.5:
        entries.insert(0, (0x0100, 4, 1, struct.pack(order + "I", 7)))
    if random.random() < 0.5:
        entries.append((0x0128, 3, 1, struct.pack(order + "HH", 2, 0)))
    data = {"<": b"II*\0", ">": b"MM\0*"}[order] + struct.pack(order + "IH", 8, len(entries))
    for tag, kind, count, value in entries:
        data += struct.pack(order + "HHI", tag, kind, count) + value
    return b"Exif\0\0" + data + bytes(4)


def scans_of(random, count, progressive):
    """Components, band and bits of each scan."""
    everything = list(range(count))
    together = [everything] if random.random() < 0.5 else [[at] for at in everything]
    if count >= 3 and random.random() < 0.3:
        together = [everything[:1], everything[1:]]
    if not progressive:
        random.shuffle(together)
        return [(part, (0, 63), 0, 0) for part in together]
    low = random.randrange(3)
    scans = [(part, (0, 0), 0, low) for part in together]
    scans += [(part, (0, 0), bit + 1, bit) for bit in reversed(range(low)) for part in together]
    for component in everything:
        low, split = random.randrange(3), random.choice([63, 5, 20])
        bands = [(1, split)] + [(split + 1, 63)] * (split < 63)
        scans += [([component], band, 0, low) for band in bands]
        bands = [(1, 63)] if random.random() < 0.5 else bands
        scans += [([component], band, bit + 1, bit) for bit in reversed(range(low)) for band in bands]
    return scans


def smooth(random, height, width):
    """Numbers from 0 to 255: a gradient, squares, or noise."""
    y, x = np.mgrid[0:height, 0:width]
    kind = random.randrange(3)
    if kind == 0:
        a, b, c = random.uniform(-4, 4), random.uniform(-4, 4), random.uniform(60, 200)
        return np.clip(c + a * x + b * y, 0, 255)
    if kind == 1:
        size = random.choice([3, 8, 16])
        levels = np.array([random.randrange(256) for _ in range(64)])
        return levels[(x // size * 5 + y // size * 3) % 64].astype(float)
    return np.array([random.randrange(256) for _ in range(height * width)]).reshape(height, width).astype(float)


def generate(random):
    """A file and what it is. Its texels depend on how a decoder rounds, so that another one is asked."""
    width, height = (random.choice([1, 7, 8, 16, 17, 31, 40]) for _ in range(2))
    model = random.choice([GRAY, YCBCR, YCBCR, YCBCR, YCBCR, RGB, CMYK, YCCK])
    count = {GRAY: 1, YCBCR: 3, RGB: 3}.get(model, 4)
    progressive = random.random() < 0.4
    factors = [(1, 1)] * count
    if model in (YCBCR, YCCK):
        # The interpolation of chroma is open (T.81, A.1.1; T.871, 6). Decoders take the mean of neighbours
        # at 2 and the nearest at 4, but not all at 2 or 4 along both sides if one of them is a texel.
        both = [(2, 2), (2, 2), (4, 2), (2, 4)] * (min(width, height) > 1)
        luma = random.choice([(1, 1), (2, 1), (1, 2), (4, 1), (1, 4)] + both)
        chroma = [(1, 1), (1, 1)]
        if luma == (2, 2) and random.random() < 0.3:
            chroma = [random.choice([(2, 1), (1, 2), (1, 1), (2, 2)]) for _ in range(2)]
        factors = [luma] + chroma + ([luma] if model == YCCK else [])
    elif model == GRAY:
        factors = [random.choice([(1, 1), (1, 1), (2, 2), (1, 2)])]
    if sum(h * v for h, v in factors) > 10 and count > 1:
        # An MCU has ten blocks at most (B.2.3).
        factors = [(2, 1)] + [(1, 1)] * 2 + [(2, 1)] * (count - 3)
    most = [max(factor[axis] for factor in factors) for axis in range(2)]
    tables = [np.array([random.randint(1, random.choice([2, 12, 60])) for _ in range(64)]) for _ in range(2)]
    blocks, sizes = [], []
    for at, (h, v) in enumerate(factors):
        columns, rows = -(-width * h // most[0]), -(-height * v // most[1])
        across = -(-width // (8 * most[0])) * h
        down = -(-height // (8 * most[1])) * v
        plane = np.pad(smooth(random, rows, columns), ((0, 8 * down - rows), (0, 8 * across - columns)), "edge")
        squares = plane.reshape(down, 8, across, 8).transpose(0, 2, 1, 3) - 128
        transformed = (COSINES @ squares @ COSINES.T).reshape(down, across, 64)[:, :, ZIGZAG]
        numbers = np.rint(transformed / tables[at > 0]).astype(int)
        blocks.append(np.clip(numbers, -1023, 1023))
        sizes.append((-(-rows // 8), -(-columns // 8)))
    ids = [1, 2, 3, 4]
    file = b"\xff\xd8"
    if model in (GRAY, YCBCR) and random.random() < 0.7:
        file += segment(0xE0, b"JFIF\0\1\2\0\0\1\0\1\0\0")
    elif model == RGB:
        ids = [ord("R"), ord("G"), ord("B")]
    transform = {GRAY: 0, YCBCR: 1, RGB: 0, CMYK: 0, YCCK: 2}[model]
    if model in (RGB, YCCK) or (model == CMYK and random.random() < 0.5):
        file += segment(0xEE, b"Adobe" + struct.pack(">HHHB", 100, 0, 0, transform))
    orientation = random.choice([1] * 4 + list(range(1, 9)))
    if orientation > 1 or random.random() < 0.3:
        file += segment(0xE1, exif(random, orientation))
    if random.random() < 0.3:
        file += segment(0xFE, b"a comment \xff\xd9")
    wide = not progressive and random.random() < 0.2
    for at, table in enumerate(tables):
        file += segment(0xDB, bytes([at | wide << 4]) + table.astype(">u2" if wide else np.uint8).tobytes())
    frame = struct.pack(">BHHB", 8, height, width, count)
    for at, (h, v) in enumerate(factors):
        frame += bytes([ids[at], h << 4 | v, at > 0])
    marker = 0xC2 if progressive else 0xC1 if wide else random.choice([0xC0, 0xC1])
    file += segment(marker, frame)
    scans = scans_of(random, count, progressive)
    interval = random.choice([0, 0, 1, 3])
    if interval:
        file += segment(0xDD, struct.pack(">H", interval))
    for parts, band, high, low in scans:
        scan = Scan(band, high, low, progressive)
        units = []
        if len(parts) == 1:
            rows, columns = sizes[parts[0]]
            units = [[(parts[0], y, x)] for y in range(rows) for x in range(columns)]
        else:
            down, across = -(-height // (8 * most[1])), -(-width // (8 * most[0]))
            for y in range(down):
                for x in range(across):
                    units.append([
                        (at, y * factors[at][1] + v, x * factors[at][0] + h)
                        for at in parts for v in range(factors[at][1]) for h in range(factors[at][0])])
        for number, unit in enumerate(units):
            if interval and number and number % interval == 0:
                scan.end_run()
                scan.bits.restart(number // interval - 1)
                scan.reset()
            for at, y, x in unit:
                scan.block(at, blocks[at][y, x], int(at > 0))
        scan.end_run()
        codes = {}
        for (kind, number), counts in scan.bits.used().items():
            table, codes[kind, number] = code_table(random, counts)
            file += segment(0xC4, bytes([(kind == "ac") << 4 | number]) + table)
        selected = bytes([len(parts)]) + b"".join(bytes([ids[at], (at > 0) << 4 | (at > 0)]) for at in parts)
        file += segment(0xDA, selected + bytes([*band, high << 4 | low])) + scan.bits.data(codes)
    kind = f"{'progressive' if progressive else 'sequential'} JPEG, {model}, {factors}, {len(scans)} scans, orientation {orientation}"
    return file + b"\xff\xd9", kind
