#!/usr/bin/env python3
"""Writes the scenes of this project into scenes/: python3 tests/scenes/make_scenes.py

Only the standard library is used. Walls stand by exact matrices, so that neighbouring walls share their edges to the
last bit and no ray slips through a corner.
"""

import base64
import json
import math
import struct
import zlib
from pathlib import Path

SCENES = Path(__file__).resolve().parents[2] / "scenes"
ARRAY, ELEMENTS = 34962, 34963  # GL buffer targets
U8, U16, F32 = 5121, 5123, 5126  # GL component types


class Gltf:
    """A glTF document that grows; every add_* gives the index of what it added."""

    def __init__(self, name, purpose):
        self.name = name
        self.data = b""
        self.document = {
            "asset": {"version": "2.0", "generator": "tests/scenes/make_scenes.py", "extras": {"purpose": purpose}},
            "extensionsUsed": [],
            "scene": 0,
            "scenes": [{"name": name, "nodes": []}],
            "nodes": [], "cameras": [], "meshes": [], "materials": [],
            "textures": [], "samplers": [], "images": [],
            "skins": [], "animations": [],
            "accessors": [], "bufferViews": [], "buffers": [],
        }

    def add(self, kind, thing):
        self.document[kind].append(thing)
        for extension in thing.get("extensions", {}):
            self.use(extension)
        return len(self.document[kind]) - 1

    def use(self, extension):
        used = self.document["extensionsUsed"]
        if extension not in used:
            used.append(extension)

    def add_view(self, data, target=None):
        self.data += b"\0" * (-len(self.data) % 4)
        view = {"buffer": 0, "byteOffset": len(self.data), "byteLength": len(data)}
        if target:
            view["target"] = target
        self.data += data
        return self.add("bufferViews", view)

    def add_vectors(self, vectors):
        flat = [x for v in vectors for x in v]
        size = len(vectors[0])
        rounded = struct.unpack(f"<{len(flat)}f", struct.pack(f"<{len(flat)}f", *flat))
        columns = [rounded[i::size] for i in range(size)]
        return self.add("accessors", {
            "bufferView": self.add_view(struct.pack(f"<{len(flat)}f", *flat), ARRAY), "componentType": F32,
            "count": len(vectors), "type": f"VEC{size}",
            "min": [min(c) for c in columns], "max": [max(c) for c in columns],
        })

    def add_indices(self, indices):
        data = struct.pack(f"<{len(indices)}H", *indices)
        view = self.add_view(data, ELEMENTS)
        return self.add("accessors", {"bufferView": view, "componentType": U16, "count": len(indices), "type": "SCALAR"})

    def add_shape(self, positions, normals, triangles, texcoords=None):
        """Accessors of a shape, to be shared by meshes of several materials."""
        position = self.add_vectors(positions)
        attributes = {"POSITION": position, "NORMAL": position if normals is positions else self.add_vectors(normals)}
        if texcoords:
            attributes["TEXCOORD_0"] = self.add_vectors(texcoords)
        return {"attributes": attributes, "indices": self.add_indices([i for t in triangles for i in t])}

    def add_mesh(self, name, shape, material):
        return self.add("meshes", {"name": name, "primitives": [{**shape, "material": material}]})

    def add_node(self, name, **properties):
        self.document["scenes"][0]["nodes"].append(self.add("nodes", {"name": name, **properties}))

    def add_values(self, rows, kind, component=("f", F32), bounds=False):
        """An accessor of rows of numbers that is no plain vertex data."""
        code, component = component
        flat = [x for row in rows for x in row]
        accessor = {"bufferView": self.add_view(struct.pack(f"<{len(flat)}{code}", *flat)), "componentType": component,
                    "count": len(rows), "type": kind}
        if bounds:
            accessor["min"], accessor["max"] = ([f(column) for column in zip(*rows)] for f in (min, max))
        return self.add("accessors", accessor)

    def add_animation(self, name, times, channels):
        """Channels are (node, path, kind, values), linear between the times."""
        times = self.add_values([(t,) for t in times], "SCALAR", bounds=True)
        samplers = [{"input": times, "output": self.add_values(values, kind), "interpolation": "LINEAR"}
                    for _, _, kind, values in channels]
        targets = [{"sampler": i, "target": {"node": node, "path": path}}
                   for i, (node, path, _, _) in enumerate(channels)]
        return self.add("animations", {"name": name, "channels": targets, "samplers": samplers})

    def add_camera(self, yfov, position):
        camera = {"type": "perspective", "perspective": {"yfov": yfov, "aspectRatio": 1.0, "znear": 0.01, "zfar": 100.0}}
        self.add_node("camera", camera=self.add("cameras", {"name": "camera", **camera}), translation=position)

    def write(self, embed):
        document = {key: value for key, value in self.document.items() if value != []}
        buffer = {"byteLength": len(self.data)}
        if embed:
            buffer["uri"] = "data:application/octet-stream;base64," + base64.b64encode(self.data).decode()
        else:
            buffer["uri"] = f"{self.name}.bin"
            (SCENES / buffer["uri"]).write_bytes(self.data)
        document["buffers"] = [buffer]
        (SCENES / f"{self.name}.gltf").write_text(readable(document), encoding="utf-8")


def readable(document):
    """JSON with one object a line."""
    parts = []
    for key, value in document.items():
        if isinstance(value, list) and value and isinstance(value[0], dict):
            lines = ",\n".join("    " + json.dumps(item, ensure_ascii=False) for item in value)
            parts.append(f'  "{key}": [\n{lines}\n  ]')
        else:
            parts.append(f'  "{key}": {json.dumps(value, ensure_ascii=False)}')
    return "{\n" + ",\n".join(parts) + "\n}\n"


# Shapes.

def quad():
    """The unit square in x and y, seen from +z; v runs downwards, as pictures do."""
    corners = [(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)]
    return ([(x, y, 0.0) for x, y in corners], [(0.0, 0.0, 1.0)] * 4, [(0, 1, 2), (0, 2, 3)],
            [(x + 0.5, 0.5 - y) for x, y in corners])


def box(bottom):
    """The unit cube, y from 0 to 1. One that stands on a floor needs no bottom, which would lie in the floor's plane."""
    positions, normals, triangles = [], [], []
    for axis in range(3):
        for side in (-0.5, 0.5):
            if axis == 1 and side < 0 and not bottom:
                continue
            first = len(positions)
            for u, v in [(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)]:
                p = [0.0] * 3
                p[axis], p[(axis + 1) % 3], p[(axis + 2) % 3] = side, u if side > 0 else -u, v
                positions.append((p[0], p[1] + 0.5, p[2]))
                normals.append(tuple(math.copysign(1.0, side) if i == axis else 0.0 for i in range(3)))
            triangles += [(first, first + 1, first + 2), (first, first + 2, first + 3)]
    return positions, normals, triangles


def ball(subdivisions):
    """The unit sphere: an icosahedron, its triangles split in four `subdivisions` times. Normals are positions."""
    g = (1 + math.sqrt(5)) / 2
    points = [normalized(p) for p in
              [(-1, g, 0), (1, g, 0), (-1, -g, 0), (1, -g, 0), (0, -1, g), (0, 1, g),
               (0, -1, -g), (0, 1, -g), (g, 0, -1), (g, 0, 1), (-g, 0, -1), (-g, 0, 1)]]
    triangles = [(0, 11, 5), (0, 5, 1), (0, 1, 7), (0, 7, 10), (0, 10, 11), (1, 5, 9), (5, 11, 4), (11, 10, 2),
                 (10, 7, 6), (7, 1, 8), (3, 9, 4), (3, 4, 2), (3, 2, 6), (3, 6, 8), (3, 8, 9), (4, 9, 5),
                 (2, 4, 11), (6, 2, 10), (8, 6, 7), (9, 8, 1)]
    for _ in range(subdivisions):
        middles = {}

        def middle(a, b):
            key = (min(a, b), max(a, b))
            if key not in middles:
                points.append(normalized([p + q for p, q in zip(points[a], points[b])]))
                middles[key] = len(points) - 1
            return middles[key]

        finer = []
        for a, b, c in triangles:
            ab, bc, ca = middle(a, b), middle(b, c), middle(c, a)
            finer += [(a, ab, ca), (b, bc, ab), (c, ca, bc), (ab, bc, ca)]
        triangles = finer
    return points, points, triangles


def normalized(v):
    length = math.sqrt(sum(x * x for x in v))
    return tuple(x / length for x in v)


# Materials.

def matte(name, color, **more):
    """Lambertian: no specular part at all, so that the albedo is the base colour."""
    return {"name": name, "pbrMetallicRoughness": {"baseColorFactor": [*color, 1.0], "metallicFactor": 0.0,
            "roughnessFactor": 1.0, **more}, "extensions": {"KHR_materials_specular": {"specularFactor": 0.0}}}


def emitter(name, color, strength):
    material = matte(name, (0.0, 0.0, 0.0))
    material["emissiveFactor"] = list(color)
    material["extensions"]["KHR_materials_emissive_strength"] = {"emissiveStrength": strength}
    return material


def mirror(name, reflectance):
    return {"name": name, "pbrMetallicRoughness":
            {"baseColorFactor": [reflectance] * 3 + [1.0], "metallicFactor": 1.0, "roughnessFactor": 0.0}}


def glass(name, thickness):
    return {"name": name, "pbrMetallicRoughness": {"metallicFactor": 0.0, "roughnessFactor": 0.0},
            "extensions": {"KHR_materials_transmission": {"transmissionFactor": 1.0},
                           "KHR_materials_volume": {"thicknessFactor": thickness, "attenuationDistance": 0.3,
                                                    "attenuationColor": [0.8, 0.95, 0.85]},
                           "KHR_materials_ior": {"ior": 1.5}}}


# Placing.

def wall(right, up, centre):
    """Matrix that carries the unit square to edges `right` and `up` about `centre`; its front is right × up."""
    normal = normalized([right[1] * up[2] - right[2] * up[1], right[2] * up[0] - right[0] * up[2],
                         right[0] * up[1] - right[1] * up[0]])
    columns = [*right, 0.0, *up, 0.0, *normal, 0.0, *centre, 1.0]
    return [x + 0.0 for x in columns]  # turns -0.0 into 0.0


def turned(degrees):
    """Quaternion of a turn about +y."""
    half = math.radians(degrees) / 2
    return [0.0, math.sin(half), 0.0, math.cos(half)]


def room(size):
    """Walls of a cube of edge `size` on the floor, front at z = 0, each with its front inside."""
    s, h = size, size / 2
    return {
        "floor": wall((s, 0, 0), (0, 0, -s), (0, 0, -h)),
        "ceiling": wall((s, 0, 0), (0, 0, s), (0, s, -h)),
        "back wall": wall((s, 0, 0), (0, s, 0), (0, h, -s)),
        "left wall": wall((0, 0, -s), (0, s, 0), (-h, h, -h)),
        "right wall": wall((0, 0, s), (0, s, 0), (h, h, -h)),
        "front wall": wall((-s, 0, 0), (0, s, 0), (0, h, 0)),
    }


# Scenes.

def cornell():
    scene = Gltf("cornell", "Cornell-like room in metres after Fig. 3 of the seed paper: soft shadows, colour bleeding, a "
                 "matte block and a mirror block. Walls are one-sided, the front is open; 81 % of the picture is room.")
    square, cube = scene.add_shape(*quad()[:3]), scene.add_shape(*box(bottom=False))
    white = scene.add("materials", matte("white", (0.73, 0.72, 0.69)))
    red = scene.add("materials", matte("red", (0.62, 0.06, 0.05)))
    green = scene.add("materials", matte("green", (0.13, 0.46, 0.09)))
    light = scene.add("materials", emitter("light", (1.0, 0.9, 0.75), 18.0))
    shiny = scene.add("materials", mirror("mirror", 0.95))
    plain = {"white": white, "red": red, "green": green, "light": light}
    squares = {name: scene.add_mesh(f"{name} square", square, material) for name, material in plain.items()}
    walls = room(0.55)
    for name, color in [("floor", "white"), ("ceiling", "white"), ("back wall", "white"), ("left wall", "red"),
                        ("right wall", "green")]:
        scene.add_node(name, mesh=squares[color], matrix=walls[name])
    scene.add_node("light", mesh=squares["light"], matrix=wall((0.13, 0, 0), (0, 0, 0.105), (0, 0.549, -0.28)),
                   extras={"is for": "area light of 18 W/(m² sr), just below the ceiling"})
    scene.add_node("matte block", mesh=scene.add_mesh("white box", cube, white), translation=[0.1, 0.0, -0.19],
                   rotation=turned(-17), scale=[0.16, 0.16, 0.16], extras={"is for": "soft shadow and contact"})
    scene.add_node("mirror block", mesh=scene.add_mesh("mirror box", cube, shiny), translation=[-0.1, 0.0, -0.36],
                   rotation=turned(35), scale=[0.16, 0.33, 0.16],
                   extras={"is for": "mirror images of both coloured walls, at total path length"})
    # The front opening (half edge 0.275 m at 0.8 m) fills nine tenths of the picture's height and width. The camera
    # stands a little off the middle: from there the diagonals of the picture's pixels would run exactly along those of
    # the back wall, where a ray may slip between the wall's two triangles.
    scene.add_camera(2 * math.atan(0.275 / 0.8 / 0.9), [0.003, 0.278, 0.8])
    scene.write(embed=True)


def mirror_ball():
    scene = Gltf("mirror-ball", "Closed room with a chequered wall and floor, a mirror ball and a glass block: curved "
                 "mirror images and refraction, whose depth is where the eye focuses. The camera looks in through the "
                 "back of the one-sided front wall.")
    square, cube, sphere = scene.add_shape(*quad()), scene.add_shape(*box(bottom=True)), scene.add_shape(*ball(4))
    # 2 × 2 texels, the lower right one redder: orientation shows in every repetition.
    texels = [(235, 235, 235), (60, 70, 110), (60, 70, 110), (235, 150, 130)]
    image = scene.add("images", {"name": "chequers", "mimeType": "image/png",
                                 "bufferView": scene.add_view(png(2, 2, texels))})
    nearest, repeat = 9728, 10497
    sampler = scene.add("samplers", {"magFilter": nearest, "wrapS": repeat, "wrapT": repeat})
    texture = scene.add("textures", {"source": image, "sampler": sampler})
    scene.use("KHR_texture_transform")
    chequers = {"index": texture, "extensions": {"KHR_texture_transform": {"scale": [4.0, 4.0]}}}
    white = scene.add("materials", matte("white", (0.73, 0.72, 0.69)))
    chequered = scene.add("materials", matte("chequered", (0.9, 0.9, 0.9), baseColorTexture=chequers))
    orange = scene.add("materials", matte("orange", (0.75, 0.33, 0.07)))
    blue = scene.add("materials", matte("blue", (0.1, 0.2, 0.6)))
    light = scene.add("materials", emitter("light", (1.0, 0.95, 0.88), 14.0))
    plain = {"white": white, "chequered": chequered, "orange": orange, "blue": blue, "light": light}
    squares = {name: scene.add_mesh(f"{name} square", square, material) for name, material in plain.items()}
    for (name, matrix), color in zip(room(0.6).items(), ["chequered", "white", "chequered", "orange", "blue", "white"]):
        scene.add_node(name, mesh=squares[color], matrix=matrix)
    scene.add_node("light", mesh=squares["light"], matrix=wall((0.2, 0, 0), (0, 0, 0.2), (0, 0.599, -0.3)))
    ball_mesh = scene.add_mesh("mirror ball", sphere, scene.add("materials", mirror("mirror", 0.95)))
    scene.add_node("mirror ball", mesh=ball_mesh, translation=[-0.09, 0.13, -0.36], scale=[0.13, 0.13, 0.13],
                   extras={"is for": "convex mirror of radius 0.13 m; 5120 triangles with smooth normals"})
    block_mesh = scene.add_mesh("glass block", cube, scene.add("materials", glass("glass", 0.08)))
    scene.add_node("glass block", mesh=block_mesh, translation=[0.15, 0.001, -0.2], rotation=turned(-20),
                   scale=[0.1, 0.2, 0.08], extras={"is for": "refraction through parallel faces, index 1.5"})
    scene.add_camera(2 * math.atan(0.3 / 0.85 / 0.95), [0.003, 0.304, 0.85])
    scene.write(embed=False)


def png(width, height, texels):
    """An RGB PNG without filters."""
    rows = b"".join(b"\0" + bytes(c for t in texels[y * width:(y + 1) * width] for c in t) for y in range(height))

    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(rows, 9)) + chunk(b"IEND", b"")


# Strokes on a grid of 5 × 7 cells, y upwards, as counter-clockwise quadrilaterals that do not overlap.
def bar(x0, y0, x1, y1):
    return [(x0, y0), (x1, y0), (x1, y1), (x0, y1)]


LETTERS = {
    "F": [bar(0, 0, 1, 7), bar(1, 6, 5, 7), bar(1, 3, 4, 4)],
    "G": [bar(0, 0, 1, 7), bar(1, 6, 5, 7), bar(1, 0, 5, 1), bar(4, 1, 5, 4), bar(3, 3, 4, 4)],
    "J": [bar(2, 6, 5, 7), bar(3, 0, 4, 6), bar(0, 0, 3, 1), bar(0, 1, 1, 3)],
    "R": [bar(0, 0, 1, 7), bar(1, 6, 5, 7), bar(4, 4, 5, 6), bar(1, 3, 5, 4), [(3.6, 0), (5, 0), (3.2, 3), (1.8, 3)]],
}


def depth_chart():
    scene = Gltf("depth-chart", "Four glowing letters without any symmetry, of equal apparent size, in the four corners of "
                 "the view at four depths: a flip, a mirroring or a wrong focus shows at once.")
    glow = scene.add("materials", emitter("glow", (1.0, 1.0, 1.0), 1.0))
    for letter, depth, side, height in [("F", 1.0, -1, 1), ("G", 1.4, 1, 1), ("J", 1.8, -1, -1), ("R", 2.2, 1, -1)]:
        corners = [(x - 2.5, y - 3.5, 0.0) for stroke in LETTERS[letter] for x, y in stroke]
        triangles = [t for i in range(0, len(corners), 4) for t in ((i, i + 1, i + 2), (i, i + 2, i + 3))]
        shape = scene.add_shape(corners, [(0.0, 0.0, 1.0)] * len(corners), triangles)
        # At distance 1 the view is 1 m high: centres a quarter up, down and aside, letters 0.364 m high.
        cell = 0.052 * depth
        scene.add_node(f"letter {letter}", mesh=scene.add_mesh(f"letter {letter}", shape, glow),
                       translation=[side * 0.25 * depth, height * 0.25 * depth, -depth], scale=[cell] * 3,
                       extras={"letter": letter, "depth": depth})
    scene.add_camera(2 * math.atan(0.5), [0.0, 0.0, 0.0])
    scene.write(embed=True)


def glass_block():
    scene = Gltf("glass-block", "Small glowing letters close behind a thick block of glass: the eye focuses on them nearer "
                 "by t(1 - 1/n) than they are. The block does not absorb.")
    glow = scene.add("materials", emitter("glow", (1.0, 1.0, 1.0), 1.0))
    corners = []
    for row in range(4):
        for column in range(4):
            letter = LETTERS["FGJR"[(row + column) % 4]]
            corners += [((x - 2.5 + 7 * (column - 1.5)) * 0.018, (y - 3.5 + 9 * (1.5 - row)) * 0.018, 0.0)
                        for stroke in letter for x, y in stroke]
    triangles = [t for i in range(0, len(corners), 4) for t in ((i, i + 1, i + 2), (i, i + 2, i + 3))]
    letters = scene.add_shape(corners, [(0.0, 0.0, 1.0)] * len(corners), triangles)
    scene.add_node("letters", mesh=scene.add_mesh("letters", letters, glow), translation=[0.0, 0.0, -1.5],
                   extras={"depth": 1.5})
    clear = glass("glass", 0.8)
    del clear["extensions"]["KHR_materials_volume"]["attenuationDistance"]
    del clear["extensions"]["KHR_materials_volume"]["attenuationColor"]
    block = scene.add_mesh("glass block", scene.add_shape(*box(bottom=True)), scene.add("materials", clear))
    scene.add_node("glass block", mesh=block, translation=[0.0, -0.5, -1.0], scale=[1.0, 1.0, 0.8],
                   extras={"thickness": 0.8, "index": 1.5})
    scene.add_camera(2 * math.atan(0.5), [0.003, 0.004, 0.0])
    scene.write(embed=True)


def motion():
    scene = Gltf("motion", "Two seconds of all that moves in glTF, glowing: the letter F slides to the right and back "
                 "(node), a mast below it on the left sways (skin), a plate on the right grows wide and narrow (morph). "
                 "They stand 2.0, 2.4 and 2.8 m before a camera that stands still. The clip `still` moves nothing.")
    glow = [scene.add("materials", {**emitter(name, colour, 1.0), "doubleSided": True})
            for name, colour in (("white", (1.0, 1.0, 1.0)), ("yellow", (1.0, 0.8, 0.3)), ("blue", (0.4, 0.7, 1.0)))]

    def bars(rectangles):
        corners = [(x, y, 0.0) for l, b, r, t in rectangles for x, y in ((l, b), (r, b), (r, t), (l, t))]
        triangles = [t for i in range(0, len(corners), 4) for t in ((i, i + 1, i + 2), (i, i + 2, i + 3))]
        return corners, [(0.0, 0.0, 1.0)] * len(corners), triangles

    letter = scene.add_shape(*bars([(-0.5, -0.7, -0.2, 0.7), (-0.2, 0.42, 0.5, 0.7), (-0.2, -0.08, 0.3, 0.18)]))
    scene.add_node("letter", mesh=scene.add_mesh("letter", letter, glow[0]), translation=[-0.55, 0.5, -2.0],
                   scale=[0.5] * 3)
    # The mast: four segments on two joints, each vertex's weight passing from the lower to the upper one.
    corners = [(x, 0.3 * k, 0.0) for k in range(5) for x in (-0.09, 0.09)]
    triangles = [t for k in range(4) for a in [2 * k] for t in ((a, a + 1, a + 3), (a, a + 3, a + 2))]
    shape = scene.add_shape(corners, [(0.0, 0.0, 1.0)] * len(corners), triangles)
    shape["attributes"]["JOINTS_0"] = scene.add_values([(0, 1, 0, 0)] * len(corners), "VEC4", ("B", U8))
    weights = [(1 - k / 4, k / 4, 0.0, 0.0) for k in range(5) for _ in range(2)]
    shape["attributes"]["WEIGHTS_0"] = scene.add_values(weights, "VEC4")
    upper = scene.add("nodes", {"name": "upper joint", "translation": [0.0, 0.6, 0.0]})
    lower = scene.add("nodes", {"name": "lower joint", "translation": [-0.6, -1.05, -2.4], "children": [upper]})
    scene.document["scenes"][0]["nodes"].append(lower)
    unbind = [(1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, -y, 0, 1) for y in (0.0, 0.6)]
    skin = scene.add("skins", {"joints": [lower, upper], "inverseBindMatrices": scene.add_values(unbind, "MAT4")})
    scene.add_node("mast", mesh=scene.add_mesh("mast", shape, glow[1]), skin=skin)
    corners, normals, triangles = bars([(-0.3, -0.3, 0.3, 0.3)])
    plate = scene.add_mesh("plate", scene.add_shape(corners, normals, triangles), glow[2])
    wide = scene.add_vectors([(math.copysign(0.35, x), 0.0, 0.0) for x, _, _ in corners])
    scene.document["meshes"][plate]["primitives"][0]["targets"] = [{"POSITION": wide}]
    scene.add_node("plate", mesh=plate, translation=[0.62, -0.65, -2.8])
    turned = [(0.0, 0.0, math.sin(a / 2), math.cos(a / 2)) for a in map(math.radians, (50, -50, 50))]
    scene.add_animation("motion", [0.0, 1.0, 2.0], [
        (0, "translation", "VEC3", [(-0.55, 0.5, -2.0), (0.55, 0.5, -2.0), (-0.55, 0.5, -2.0)]),
        (upper, "rotation", "VEC4", turned),
        (scene.document["scenes"][0]["nodes"][-1], "weights", "SCALAR", [(0.0,), (1.0,), (0.0,)]),
    ])
    scene.add_animation("still", [0.0, 2.0], [(0, "translation", "VEC3", [(-0.55, 0.5, -2.0)] * 2)])
    scene.add_camera(2 * math.atan(0.5), [0.0, 0.0, 0.0])
    scene.write(embed=True)


if __name__ == "__main__":
    SCENES.mkdir(exist_ok=True)
    cornell()
    mirror_ball()
    depth_chart()
    glass_block()
    motion()
