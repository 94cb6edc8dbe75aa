"""Compares generated OBJ models with what trimesh and assimp read, and with the generator."""

import logging
import random
from collections import Counter

import assimp_py
import numpy as np
import trimesh

import obj_files

logging.getLogger("trimesh").setLevel(logging.CRITICAL)
# Features that a reader lacks, with the section that has them ("Object Files" and "Material Files" of
# Alias); of files with one of them it reads the plain form.
TRIMESH_LACKS = {
    "comment behind": "Object Files, comments: they may be anywhere",
    "leading space": "Object Files excludes no white space between and around words",
    "tabs": "the same",
    "negative indices": "Object Files, relative references: -1 is the last vertex before the statement, not of the file",
    "partial attributes": "Object Files, f: only the corners of one face have the same references",
    "uneven faces": "Object Files, f: a face has any number of corners, whatever others of its material have",
}
ASSIMP_LACKS = {
    "comment behind": "Object Files, comments: they may be anywhere",
    "leading space": "Object Files excludes no white space between and around words",
    "trailing space": "the same; assimp counts it as a number",
    "one texture coordinate": "Object Files, vt: v is optional, and 0 by default",
    "bare points": "Object Files excludes no form of a number, such as .5",
    "one number of a colour": "Material Files, Kd: g and b are r if they are left out",
    "Latin-1": "none: the module for Python takes UTF-8",
    "lines and points": "none: the module for Python takes triangles",
}

# The places of attributes among the numbers of a corner.
POSITION, TEXCOORD, NORMAL, COLOR = slice(0, 3), slice(3, 5), slice(5, 8), slice(8, 11)


def outline(polygons):
    """The directed sides of polygons of points, each less those that go the other way: those of the
    polygons that were cut, however that was done."""
    sides = Counter()
    for corners in polygons:
        for at, a in enumerate(corners):
            b = corners[(at + 1) % len(corners)]
            sides[a, b] += 1
            sides[b, a] -= 1
    return {side: count for side, count in sides.items() if count > 0}


def area(triangles):
    points = np.array(triangles, float).reshape(-1, 3, 3)
    return np.linalg.norm(np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0]), axis=1).sum() / 2


def exact(numbers):
    return tuple(float(number) for number in numbers)


def near(numbers):
    """A key for readers that round numbers on their own; those of a file have three digits or more."""
    return tuple(round(float(number) * 1024) for number in numbers)


def outlines(polygons_by_material, key, columns):
    return {
        name: found for name, polygons in polygons_by_material.items()
        if (found := outline([[key(corner[columns]) for corner in polygon] for polygon in polygons]))
    }


def read_with_trimesh(path):
    """The triangles of each material, by its name."""
    loaded = trimesh.load(path, process=False, maintain_order=True)
    found = {}
    for mesh in loaded.geometry.values() if hasattr(loaded, "geometry") else [loaded]:
        if isinstance(mesh, trimesh.Trimesh):
            name = getattr(getattr(mesh.visual, "material", None), "name", None)
            found.setdefault(name, []).extend(mesh.vertices[mesh.faces])
    return found


def read_with_assimp(path):
    """The triangles of each material, by its name, with all attributes of corners; the materials."""
    scene = assimp_py.import_file(str(path), assimp_py.Process_Triangulate)
    found = {}
    for mesh in scene.meshes:
        def attribute(numbers, given, used):
            if numbers is None:
                return np.full((mesh.num_vertices, used), obj_files.MISSING)
            return np.array(numbers).reshape(-1, given)[:, :used]

        texcoords = attribute(mesh.texcoords and mesh.texcoords[0], mesh.texcoords and mesh.num_uv_components[0], 2)
        corners = np.hstack([
            attribute(mesh.vertices, 3, 3), texcoords, attribute(mesh.normals, 3, 3),
            attribute(mesh.colors and mesh.colors[0], 4, 3)])
        name = scene.materials[mesh.material_index]["NAME"]
        found.setdefault(name, []).extend(corners[np.array(mesh.indices)].reshape(-1, 3, corners.shape[1]))
    return found, {material["NAME"]: material for material in scene.materials}


class Comparison:
    """A generated file, as the program reads it, beside the generator and the other readers."""

    def __init__(self, truth, model):
        self.truth, self.names = truth, [name for name, _ in truth.materials] + [None]
        self.model = model
        corners = np.hstack([model.position, model.texcoord, model.normal, model.color])[model.corners]
        self.found = {}
        for triangle, material in zip(corners.reshape(-1, 3, 11), model.material):
            self.found.setdefault(self.names[material], []).append(triangle)
        self.readers = Counter()

    def check(self):
        return self.generator() or self.materials() or self.trimesh() or self.assimp()

    def generator(self):
        self.readers["the generator"] += 1
        faces = {}
        for face in self.truth.faces:
            faces.setdefault(face.material, []).append(face)
        if set(faces) != set(self.found):
            return f"the materials {set(self.found)} and not {set(faces)}"
        for name, own in faces.items():
            polygons = {name: [face.corners for face in own]}
            triangles = sum(len(face.corners) - 2 for face in own)
            if len(self.found[name]) != triangles:
                return f"`{name}`: {len(self.found[name])} triangles and not {triangles}"
            every = slice(0, 11)
            if outlines({name: self.found[name]}, exact, every) != outlines(polygons, exact, every):
                return f"`{name}`: other corners than the generator's"
            if all(face.area is not None for face in own):
                wanted = sum(face.area for face in own)
                covered = area([triangle[:, POSITION] for triangle in self.found[name]])
                if abs(covered - wanted) > 1e-3 * wanted + 1e-3:
                    return f"`{name}`: the area {covered} and not {wanted}"
        return None

    def materials(self):
        textures = {}
        for at, (name, wanted) in enumerate(self.truth.materials):
            found = self.model.materials[at]
            for key, numbers in wanted.items():
                if key not in ("maps", "given", "is_defined") and not np.array_equal(np.float32(numbers), np.float32(found[key])):
                    return f"the material `{name}`: {key} {found[key]} and not {numbers}"
            for slot, number in zip(obj_files.SLOTS, found["textures"]):
                number_of = wanted["maps"].get(slot)
                expected = 0xFFFFFFFF if number_of is None else textures.setdefault(number_of, len(textures))
                if number != expected:
                    return f"the material `{name}`: the texture {number} of {slot} and not {expected}"
        return None

    def sides(self, who, found, columns, by_material):
        """Compares the sides of all polygons, or those of each defined material."""
        defined = {name for name, material in self.truth.materials if material["is_defined"] and by_material}

        def pooled(triangles):
            pools = {}
            for name, own in triangles.items():
                pools.setdefault(name if name in defined else None, []).extend(own)
            return outlines(pools, near, columns)

        if pooled(self.found) != pooled(found):
            return f"other sides of polygons than those of {who}"
        return None

    def area(self, who, found):
        ours = area([triangle[:, POSITION] for own in self.found.values() for triangle in own])
        theirs = area([triangle[:, POSITION] for own in found.values() for triangle in own])
        if abs(ours - theirs) > 1e-3 * theirs + 1e-3:
            return f"the area {ours}, of {who} {theirs}"
        return None

    def trimesh(self):
        self.readers["trimesh"] += 1
        path = self.truth.plain if self.truth.quirks & TRIMESH_LACKS.keys() else self.truth.path
        found = read_with_trimesh(path)
        # trimesh makes no material of those without a colour.
        wrong = self.sides("trimesh", found, POSITION, by_material=False)
        # trimesh cuts all polygons into fans.
        if not wrong and all(face.area is not None and not face.concave for face in self.truth.faces):
            wrong = self.area("trimesh", found)
        return wrong

    def assimp(self):
        self.readers["assimp"] += 1
        path = self.truth.plain if self.truth.quirks & ASSIMP_LACKS.keys() else self.truth.path
        found, materials = read_with_assimp(path)
        every = slice(0, 8 if "partly coloured" in self.truth.quirks else 11)
        partial = None in self.found or self.truth.quirks & {"partial attributes", "uneven faces"}
        # Faces before the first material are white ("Object Files", usemtl); assimp gives them the first
        # one, and attributes of zeros.
        wrong = self.sides("assimp", found, POSITION if partial else every, by_material=None not in self.found)
        if not wrong and all(face.area is not None for face in self.truth.faces):
            wrong = self.area("assimp", found)
        return wrong or self.materials_of_assimp(materials)

    def materials_of_assimp(self, theirs):
        keys = {
            "base_color": "COLOR_DIFFUSE", "ambient": "COLOR_AMBIENT", "specular": "COLOR_SPECULAR",
            "emissive": "COLOR_EMISSIVE", "shininess": "SHININESS", "ior": "REFRACTI",
        }
        for at, (name, wanted) in enumerate(self.truth.materials):
            if not wanted["is_defined"]:
                continue
            ours = self.model.materials[at]
            for key in wanted["given"] & set(keys):
                one = np.atleast_1d(ours[key])[:3]
                if not np.allclose(one, theirs[name][keys[key]], atol=1e-5):
                    return f"the material `{name}`: {key} {one}, of assimp {theirs[name][keys[key]]}"
            if not np.allclose(ours["base_color"][3], theirs[name]["OPACITY"], atol=1e-5):
                return f"the material `{name}`: opacity {ours['base_color'][3]}, of assimp {theirs[name]['OPACITY']}"
        return None


def judge(program, count, seed):
    """Compares so many models; returns how many differ."""
    failed, readers, quirks = 0, Counter(), Counter()
    for first in range(0, count, 25):
        seeds = [f"{seed} {first + at}" for at in range(min(25, count - first))]
        truths = [
            obj_files.generate(random.Random(own), program.folder / f"{at}.obj") for at, own in enumerate(seeds)]
        models, _ = program.models([truth.path.name for truth in truths])
        for own, truth, model in zip(seeds, truths, models):
            comparison = Comparison(truth, model)
            wrong = comparison.check()
            readers += comparison.readers
            quirks.update(truth.quirks)
            if wrong:
                failed += 1
                print(f"model {own}: {truth.what}: {wrong}")
    print(f"{count} OBJ models ({dict(quirks)}), {failed} differ from {dict(readers)}")
    return failed
