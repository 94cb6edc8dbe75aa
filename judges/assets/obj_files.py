"""Random Wavefront OBJ files with material libraries ("Object Files" and "Material Files", Alias),
written as programs write them."""

import math
from dataclasses import dataclass, field

import numpy as np

MISSING = -9.0
NAMES = ["red", "Blue", "two words", "Material.001", "a-b_c", "für"]
# Features beyond a plain file, each in some of the files.
FEATURES = [
    "Latin-1", "mark", "leading space", "trailing space", "tabs", "wide spaces", "exponents", "bare points",
    "continuation", "comment behind", "weight", "repeated corners", "one texture coordinate", "faces first",
    "one number of a colour", "small letters", "two libraries", "libraries in one line", "an undefined material",
    "usemtl without a name", "lines and points",
]
SLOTS = ["map_Kd", "map_Bump", "map_Ks", "map_d", "map_Ke"]


def f32(text):
    return np.float32(float(text))


@dataclass
class Face:
    """A polygon as a reader sees it: values of each corner, and the material's name or none."""

    material: str | None
    corners: list
    # The area, where that is known: of flat polygons that do not cross themselves.
    area: float | None
    concave: bool


@dataclass
class Truth:
    path: object
    faces: list = field(default_factory=list)
    # The materials in the order of their first use.
    materials: list = field(default_factory=list)
    # Features of the file that not every reader has.
    quirks: set = field(default_factory=set)
    # A file that means the same without these features, and without lines and points.
    plain: object = None

    @property
    def what(self):
        return f"OBJ of {len(self.faces)} faces, {sorted(self.quirks)}"


class Writer:
    def __init__(self, random, path):
        self.random = random
        self.truth = Truth(path)
        self.lines, self.plain = [], []
        self.positions, self.texcoords, self.normals, self.colors = [], [], [], []
        self.stretch = []
        # Statements of vertices that are written behind the faces.
        self.later, self.plain_later = [], []
        # The material, and the faces of each for the plain file.
        self.material, self.plain_faces = None, {}
        self.forward = False

    def chance(self, part):
        return self.random.random() < part

    def number(self, low=-4.0, high=4.0):
        value = self.random.uniform(low, high)
        digits = self.random.choice([0, 1, 3, 6])
        text = f"{value:.{digits}f}"
        form = self.random.randrange(8)
        exponents = "exponents" in self.truth.quirks
        if form == 0 and exponents:
            text = f"{value:.5e}"
        elif form == 1 and text.startswith("0.") and "bare points" in self.truth.quirks:
            text = text[1:]
        elif form == 2 and digits == 0:
            text += "."
        elif form == 3 and not text.startswith("-"):
            text = "+" + text
        elif form == 4 and exponents:
            text = f"{value:.3E}"
        return text

    def space(self):
        wide, tabs = ("wide spaces" in self.truth.quirks), ("tabs" in self.truth.quirks)
        return self.random.choice([" "] * 3 + ["  "] * wide + ["\t"] * tabs)

    def write(self, *words, plain=None):
        """Writes a statement, and what it means in the plain file."""
        line = words[0]
        for word in words[1:]:
            line += self.space() + str(word)
        if "leading space" in self.truth.quirks and self.chance(0.2):
            line = " " + line
        if "trailing space" in self.truth.quirks and self.chance(0.2):
            line += " "
        if words[0] in ("v", "f", "vn") and self.chance(0.1):
            if "continuation" in self.truth.quirks:
                at = line.index(str(words[2]), line.index(str(words[1])) + len(words[1]))
                line = line[:at] + "\\\n" + line[at:]
            elif "comment behind" in self.truth.quirks:
                line += " # comment 1 2 3"
        later = self.forward and words[0] == "v"
        (self.later if later else self.lines).append(line)
        if plain != ():
            line = " ".join(str(word) for word in plain or words)
            (self.plain_later if later else self.plain).append(line)

    def add_position(self, point):
        """Writes a position near a point, with three digits; returns its number."""
        texts = [f"{x:.3f}" for x in point]
        color, extra = None, []
        if self.colored and self.chance(self.colored):
            extra = [f"{self.random.random():.3f}" for _ in range(3)]
            color = [f32(text) for text in extra]
        plain = ("v", *texts, *extra)
        if "weight" in self.truth.quirks and not self.colored:
            extra = ["1.0"]
        self.write("v", *texts, *extra, plain=plain)
        self.positions.append([f32(text) for text in texts])
        self.colors.append(color)
        return len(self.positions) - 1

    def polygon(self):
        """The positions of a polygon, its area where that is known, and whether it is concave."""
        random = self.random
        corners = random.choice([3, 3, 3, 4, 4, 5, 6, 9])
        if len(self.positions) > 8 and corners < 5 and self.chance(0.6 if corners == 3 else 0.1):
            pick = random.choices if "repeated corners" in self.truth.quirks else random.sample
            found = pick(range(len(self.positions)), k=corners)
            return found, self.area(found) if corners == 3 else None, False
        u, v = np.linalg.qr(np.array([[random.gauss(0, 1) for _ in range(3)] for _ in range(3)]))[0][:2]
        center = np.array([random.uniform(-3, 3) for _ in range(3)])
        angles = [(at + 0.8 * random.random()) / corners * math.tau for at in range(corners)]
        concave = corners > 3 and self.chance(0.4)
        radii = [random.uniform(0.4, 2) if concave else 1.5 for _ in angles]
        flat = [(r * math.cos(a), r * math.sin(a)) for r, a in zip(radii, angles)]
        found = [self.add_position(center + x * u + y * v) for x, y in flat]
        crossed = flat + flat[:2]
        turns = [(b[0] - a[0]) * (c[1] - b[1]) - (b[1] - a[1]) * (c[0] - b[0])
                 for a, b, c in zip(crossed, crossed[1:], crossed[2:])]
        # Corners are in turn around the center; gaps above half a turn put the center outside.
        gaps = [(b - a) % math.tau for a, b in zip(angles, angles[1:] + angles[:1])]
        simple = max(gaps) < math.pi and min(abs(turn) for turn in turns) > 0.02
        return found, self.area(found) if simple else None, min(turns) < 0.02

    def area(self, corners):
        """The area of a flat polygon that does not cross itself."""
        points = np.array([self.positions[at] for at in corners], float)
        turned = np.roll(points, -1, 0)
        return np.linalg.norm(np.cross(points - points[0], turned - points[0]).sum(0)) / 2

    def index(self, at, count):
        if at < count and "negative indices" in self.truth.quirks and self.chance(0.5):
            return str(at - count)
        return str(at + 1)

    def face(self, form):
        random = self.random
        positions, area, concave = self.polygon()
        corners, words = [], []
        later = len(self.later)
        for at in positions:
            known = len(self.positions) - later
            word = self.index(at, known) if not self.forward else str(at + 1)
            texcoord = normal = None
            own = form if form != "mixed" else random.choice(["", "t", "n", "tn"])
            if "t" in own:
                if not self.texcoords or self.chance(0.5):
                    self.add_texcoord()
                texcoord = random.randrange(len(self.texcoords))
                word += "/" + self.index(texcoord, len(self.texcoords))
            if "n" in own:
                if not self.normals or self.chance(0.5):
                    self.add_normal()
                normal = random.randrange(len(self.normals))
                word += ("/" if "t" in own else "//") + self.index(normal, len(self.normals))
            corners.append((at, texcoord, normal))
            words.append(word)
        # Values that the corners added changed what negative numbers mean.
        words = self.again(corners, words)
        kept = 1 if form == "mixed" else 3
        plain = ["/".join("" if at is None else str(at + 1) for at in corner[:kept]).rstrip("/") for corner in corners]
        self.write("f", *words, plain=())
        self.plain_faces.setdefault(self.material, []).append(plain)
        self.stretch.append((corners, area, concave))

    def again(self, corners, words):
        result = []
        for (position, texcoord, normal), word in zip(corners, words):
            parts = word.split("/")
            lists = [self.positions, self.texcoords, self.normals]
            for at, place in enumerate([position, texcoord, normal]):
                if at < len(parts) and parts[at].startswith("-"):
                    parts[at] = str(place - len(lists[at]))
            result.append("/".join(parts))
        return result

    def add_texcoord(self):
        texts = [self.number() for _ in range(2)]
        if "one texture coordinate" in self.truth.quirks and self.chance(0.3):
            texts[1] = "0"
            self.write("vt", texts[0], plain=("vt", *map(float, texts)))
        else:
            self.write("vt", *texts, *["0.0"] * self.chance(0.1), plain=("vt", *map(float, texts)))
        self.texcoords.append([f32(text) for text in texts])

    def add_normal(self):
        texts = [self.number(-1, 1) for _ in range(3)]
        self.write("vn", *texts, plain=("vn", *map(float, texts)))
        self.normals.append([f32(text) for text in texts])

    def finish_stretch(self):
        """Ends the faces of one object and material: a group, whose vertices have the same attributes."""
        corners = [corner for face, _, _ in self.stretch for corner in face]
        has_texcoords = all(texcoord is not None for _, texcoord, _ in corners)
        has_normals = all(normal is not None for _, _, normal in corners)
        colored = any(self.colors[position] for position, _, _ in corners)

        def values(position, texcoord, normal):
            color = (self.colors[position] or [1.0] * 3) if colored else [MISSING] * 3
            return np.array(
                self.positions[position]
                + (self.texcoords[texcoord] if has_texcoords else [MISSING] * 2)
                + (self.normals[normal] if has_normals else [MISSING] * 3) + color, np.float32)

        for face, area, concave in self.stretch:
            self.truth.faces.append(Face(self.material, [values(*corner) for corner in face], area, concave))
        self.stretch = []

    def finish_plain(self):
        """Writes the faces of each material into the plain file, the smallest one first, as trimesh
        takes all of a material to have as many numbers as the first one, if the sum allows that."""
        # Faces without a material come before those with one.
        for material, faces in sorted(self.plain_faces.items(), key=lambda item: item[0] is not None):
            forms = {(word.count("/"), "//" in word) for face in faces for word in face}
            if len(forms) > 1:
                self.truth.quirks.add("uneven faces")
                faces = [[word.split("/")[0] for word in face] for face in faces]
            counts = [len(face) for face in faces]
            if len(set(counts)) > 1 and counts[0] * len(counts) == sum(counts):
                self.truth.quirks.add("uneven faces")
            self.plain += [f"usemtl {material}"] * (material is not None)
            self.plain += [" ".join(["f", *face]) for face in sorted(faces, key=len)]

    def library(self, path, names):
        """Writes a material library; returns what a reader sees of each material."""
        random, found = self.random, {}
        kept = self.lines, self.plain
        self.lines, self.plain = [], []
        for name in names:
            self.write("newmtl", name)
            material = dict(
                base_color=[1.0] * 4, ambient=[0.0] * 3, specular=[0.0] * 3, emissive=[0.0] * 3, shininess=0.0,
                ior=1.5, metallic=0.0, roughness=1.0, normal_scale=1.0, transform=[1, 0, 0, 0, 1, 0],
                illumination=0, maps={}, is_defined=True, given=set())
            statements = []
            for key, keyword in [("base_color", "Kd"), ("ambient", "Ka"), ("specular", "Ks"), ("emissive", "Ke")]:
                if self.chance(0.6):
                    texts = [f"{random.random():.4f}" for _ in range(3)]
                    if "one number of a colour" in self.truth.quirks and self.chance(0.5):
                        texts = texts[:1]
                    three = (texts * 3)[:3]
                    material["given"].add(key)
                    material[key][:3] = [f32(text) for text in three]
                    statements.append(((self.cased(keyword), *texts), (keyword, *three)))
            for key, keyword, low, high in [
                    ("shininess", "Ns", 0, 1000), ("ior", "Ni", 1, 2), ("metallic", "Pm", 0, 1), ("roughness", "Pr", 0, 1)]:
                if self.chance(0.4):
                    text = f"{random.uniform(low, high):.3f}"
                    material["given"].add(key)
                    material[key] = f32(text)
                    statements.append(((self.cased(keyword), text), (keyword, text)))
            if self.chance(0.4):
                text = f"{random.random():.3f}"
                transparent = self.chance(0.3)
                material["base_color"][3] = np.float32(1) - f32(text) if transparent else f32(text)
                statements.append((("Tr" if transparent else "d", text), ("d", material["base_color"][3])))
            if self.chance(0.5):
                material["illumination"] = random.randrange(11)
                statements.append((("illum", material["illumination"]), None))
            for keyword in SLOTS:
                if self.chance(0.2):
                    statements.append((self.map(keyword, material), None))
            for extra in [("Tf", 1, 1, 1), ("# remark",), ("sharpness", 60), ("",)]:
                if self.chance(0.1):
                    statements.append((extra, ()))
            random.shuffle(statements)
            for words, plain in statements:
                self.write(*words, plain=plain)
            found[name] = material
        path.write_bytes(self.text(self.lines))
        path.with_stem(path.stem + "-plain").write_text("\n".join(self.plain + [""]))
        self.lines, self.plain = kept
        return found

    def cased(self, keyword):
        return keyword.lower() if "small letters" in self.truth.quirks else keyword

    def map(self, keyword, material):
        random = self.random
        file = random.choice(["a.png", "b.jpg", "sub/c.png", "my d.png"])
        words = []
        clamped = self.chance(0.2)
        if clamped:
            words += ["-clamp", "on"]
        if keyword == "map_Bump" and self.chance(0.5):
            text = f"{random.uniform(0, 2):.2f}"
            material["normal_scale"] = f32(text)
            words += ["-bm", text]
        if keyword == "map_Kd" and self.chance(0.5):
            scale = [f"{random.uniform(0.5, 4):.2f}" for _ in range(2)]
            offset = [f"{random.uniform(0, 1):.2f}" for _ in range(2)]
            depth = ["1"] if self.chance(0.5) else []
            pairs = [["-s", *scale, *depth], ["-o", *offset, *(["0"] if depth else [])]]
            random.shuffle(pairs)
            words += [word for pair in pairs for word in pair]
            material["transform"] = [f32(scale[0]), 0, f32(offset[0]), 0, f32(scale[1]), f32(offset[1])]
        material["maps"][keyword] = (file, clamped)
        return (keyword, *words, file)

    def text(self, lines):
        end = self.random.choice(["\n", "\n", "\r\n"])
        encoding = "latin-1" if "Latin-1" in self.truth.quirks else "utf-8"
        text = end.join(lines + [""]).replace("\\\n", "\\" + end).encode(encoding)
        return b"\xef\xbb\xbf" * ("mark" in self.truth.quirks) + text

    def generate(self):
        random, path = self.random, self.truth.path
        self.truth.quirks |= {feature for feature in FEATURES if self.chance(0.05)}
        if self.chance(0.3):
            self.truth.quirks.add("negative indices")
        self.colored = random.choice([0, 0, 0, 1, 1, 0.7])
        if self.colored == 0.7:
            self.truth.quirks.add("partly coloured")
        self.forward = "faces first" in self.truth.quirks
        names = random.sample(NAMES, random.randint(1, 4))
        split = random.randint(0, len(names)) if "two libraries" in self.truth.quirks else len(names)
        libraries, defined = [], {}
        for number, own in enumerate([names[:split], names[split:]]):
            if own:
                library = path.with_name(f"{path.stem}-{number}.mtl")
                defined |= self.library(library, own)
                libraries.append(library.name)
        self.write("# generated")
        plain = [library.replace(".mtl", "-plain.mtl") for library in libraries]
        if "libraries in one line" in self.truth.quirks:
            self.write("mtllib", *libraries, plain=())
            self.plain += [f"mtllib {library}" for library in plain]
        else:
            for library, other in zip(libraries, plain):
                self.write("mtllib", library, plain=("mtllib", other))
        used = []
        for _ in range(random.randint(1, 5)):
            if self.chance(0.6):
                self.finish_stretch()
                keyword = random.choice("og")
                self.write(keyword, random.choice(["body", "two words", "a_b", "für"]), plain=())
            if self.chance(0.8):
                material = random.choice(names)
                if "an undefined material" in self.truth.quirks and self.chance(0.3):
                    material = "nowhere"
                elif "usemtl without a name" in self.truth.quirks and self.chance(0.3):
                    material = None
                if material != self.material:
                    self.finish_stretch()
                self.write("usemtl", *([material] if material else []), plain=())
                self.material = material
                if material and material not in used:
                    used.append(material)
            if self.chance(0.3):
                self.write("s", random.choice(["off", "1", "0"]))
            form = random.choice(["", "t", "n", "tn", "t", "n", "tn", "mixed"])
            if form == "mixed":
                self.truth.quirks.add("partial attributes")
            for _ in range(random.randint(1, 6)):
                self.face(form)
                if self.chance(0.1):
                    self.write("# between")
                if self.chance(0.05):
                    self.lines.append("")
                if "lines and points" in self.truth.quirks and self.chance(0.3):
                    corners = random.sample(range(1, len(self.positions) + 1), 3)
                    self.write(*random.choice([("l", *corners), ("l", *corners[:2]), ("p", corners[0])]), plain=())
        self.lines += self.later
        self.plain += self.plain_later
        self.finish_plain()
        self.finish_stretch()
        default = dict(
            base_color=[1.0] * 4, ambient=[0.0] * 3, specular=[0.0] * 3, emissive=[0.0] * 3, shininess=0.0, ior=1.5,
            metallic=0.0, roughness=1.0, normal_scale=1.0, transform=[1, 0, 0, 0, 1, 0], illumination=0, maps={},
            is_defined=False, given=set())
        self.truth.materials = [(name, defined.get(name, default)) for name in used]
        path.write_bytes(self.text(self.lines))
        self.truth.plain = path.with_stem(path.stem + "-plain")
        self.truth.plain.write_text("\n".join(self.plain + [""]))
        return self.truth


def generate(random, path):
    """Writes a file and its libraries; returns what a reader sees."""
    return Writer(random, path).generate()
