"""Runs `anyhit` on scenes of generated files, as a user does."""

import struct
import subprocess
from pathlib import Path

import numpy as np


def nothing():
    """A compute shader that does nothing, in SPIR-V."""
    def op(code, *words):
        return [len(words) + 1 << 16 | code, *words]

    main = struct.unpack("<2I", b"main\0\0\0\0")
    words = [0x07230203, 0x00010000, 0, 5, 0]
    words += op(17, 1) + op(14, 0, 1) + op(15, 5, 3, *main) + op(16, 3, 17, 1, 1, 1)
    words += op(19, 1) + op(33, 2, 1) + op(54, 1, 3, 0, 2) + op(248, 4) + op(253) + op(56)
    return struct.pack(f"<{len(words)}I", *words)


HEAD = 'version = 1\n[shaders]\nc = "nothing.spv"\n[[dispatch]]\nshader = "c"\ngroups = 1\n'


class Program:
    def __init__(self, path, folder):
        self.path, self.folder = path, Path(folder)
        (self.folder / "nothing.spv").write_bytes(nothing())

    def run(self, scene, outputs, more=()):
        """Runs a scene with more options; returns the notes, and the bytes of each output, an option
        and a name."""
        (self.folder / "scene.toml").write_text(HEAD + scene)
        command = [self.path, "run", "scene.toml"]
        for option, name in outputs:
            command += [option, f"{name}={name}.raw"]
        command += more
        done = subprocess.run(command, cwd=self.folder, capture_output=True, text=True)
        if done.returncode:
            raise RuntimeError(done.stderr)
        return done.stderr, {name: (self.folder / f"{name}.raw").read_bytes() for _, name in outputs}

    def pictures(self, files, kinds):
        """The texels of picture files of the folder, as the program holds them; it also saves each as a
        file of a kind."""
        scene = "".join(
            f'[resources.p{at}]\ntype = "sampled_image"\nbinding = {at}\nfile = "{file}"\n'
            for at, file in enumerate(files))
        names = [f"p{at}" for at in range(len(files))]
        saved = [f"{name}={name}.{kind}" for name, kind in zip(names, kinds)]
        more = ["--alpha"] + [word for one in saved for word in ("--save", one)]
        _, outputs = self.run(scene, [("--save", name) for name in names], more)
        return [(outputs[name], self.folder / f"{name}.{kind}") for name, kind in zip(names, kinds)]

    def models(self, files):
        """The corners of all triangles of each model: arrays of the attributes, and materials."""
        scene, outputs = "", []
        for at, file in enumerate(files):
            scene += f'[[model]]\nfile = "{file}"\nname = "m{at}"\n'
            for name, data in self.buffers(f"m{at}").items():
                scene += f'[resources.{name}]\ntype = "buffer"\ndata = {{ {data} }}\n'
                outputs.append(("--dump", name))
        notes, found = self.run(scene, outputs)
        return [Model(f"m{at}", found) for at in range(len(files))], notes

    @staticmethod
    def buffers(model):
        def attribute(name, form, missing):
            return f'mesh = "{model}", attribute = "{name}", format = "{form}", missing = {missing}'

        return {
            f"{model}-pos": f'mesh = "{model}", attribute = "position", format = "f32x3"',
            f"{model}-idx": f'mesh = "{model}", attribute = "index", format = "u32"',
            f"{model}-tex": attribute("texcoord_0", "f32x2", "[-9, -9]"),
            f"{model}-nor": attribute("normal", "f32x3", "[-9, -9, -9]"),
            f"{model}-col": attribute("color_0", "f32x3", "[-9, -9, -9]"),
            f"{model}-geo": f'table = "geometries", mesh = "{model}", columns = ["first_vertex", '
                            '"first_index", "index_count", "material"]',
            f"{model}-mat": f'table = "materials", mesh = "{model}", columns = [{", ".join(COLUMNS)}]',
        }


COLUMNS = [f'"{name}"' for name in [
    "base_color", "ambient", "specular", "emissive", "shininess", "ior", "metallic", "roughness",
    "normal_scale", "base_color_transform", "illumination", "base_color_texture", "normal_texture",
    "specular_texture", "alpha_texture", "emissive_texture"]]


class Model:
    """The attributes of the corners of all triangles of a model, and its materials."""

    def __init__(self, name, found):
        def numbers(kind, columns, dtype="<f4"):
            return np.frombuffer(found[f"{name}-{kind}"], dtype).reshape(-1, columns)

        parts = numbers("geo", 4, "<u4")
        indices = numbers("idx", 1, "<u4")[:, 0]
        corners, materials = [], []
        for first_vertex, first_index, count, material in parts:
            corners.append(indices[first_index : first_index + count] + first_vertex)
            materials.append(np.full(count // 3, material))
        self.corners = np.concatenate(corners).astype(int)
        self.material = np.concatenate(materials).astype(int)
        self.position, self.texcoord = numbers("pos", 3), numbers("tex", 2)
        self.normal, self.color = numbers("nor", 3), numbers("col", 3)
        rows = np.frombuffer(found[f"{name}-mat"], "<u4").reshape(-1, 30)
        floats = rows.view("<f4")
        self.materials = [
            {
                "base_color": row[0:4], "ambient": row[4:7], "specular": row[7:10], "emissive": row[10:13],
                "shininess": row[13], "ior": row[14], "metallic": row[15], "roughness": row[16],
                "normal_scale": row[17], "transform": row[18:24], "illumination": words[24],
                "textures": words[25:30],
            }
            for row, words in zip(floats, rows)
        ]
