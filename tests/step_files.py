"""STEP files (ISO 10303-21, AP214) for tests: bodies of revolution around z, written entity by entity."""

import math

UNITS = {
    "mm": "( LENGTH_UNIT() NAMED_UNIT(*) SI_UNIT(.MILLI.,.METRE.) )",
    "m": "( LENGTH_UNIT() NAMED_UNIT(*) SI_UNIT($,.METRE.) )",
}
HEAD = """\
ISO-10303-21;
HEADER;
FILE_DESCRIPTION((''),'2;1');
FILE_NAME('part','2026-01-01T00:00:00',(''),(''),'','','');
FILE_SCHEMA(('AUTOMOTIVE_DESIGN { 1 0 10303 214 1 1 1 1 }'));
ENDSEC;
DATA;
"""


class Step:
    """The entities of a file."""

    def __init__(self):
        self.rows = []

    def write(self, text):
        self.rows.append(f"#{len(self.rows) + 1}={text};")
        return f"#{len(self.rows)}"

    def add(self, kind, *values):
        """An entity without a name, of that kind."""
        return self.write(f"{kind}('',{','.join(map(str, values))})")

    def many(self, values):
        return f"({','.join(values)})"

    def point(self, *xyz):
        return self.add("CARTESIAN_POINT", self.many(f"{x:.12E}" for x in xyz))

    def direction(self, *xyz):
        return self.add("DIRECTION", self.many(f"{x:.1f}" for x in xyz))

    def place(self, height, up=1.0):
        """A frame at a height, whose z points up or down."""
        return self.add(
            "AXIS2_PLACEMENT_3D", self.point(0, 0, height), self.direction(0, 0, up), self.direction(1, 0, 0)
        )

    def ring(self, radius, height):
        """A circle around z: its vertex and its edge."""
        vertex = self.add("VERTEX_POINT", self.point(radius, 0, height))
        circle = self.add("CIRCLE", self.place(height), f"{radius:.12E}")
        return vertex, self.add("EDGE_CURVE", vertex, vertex, circle, ".T.")

    def loop(self, *edges):
        """A loop of edges, each with its sense."""
        return self.add(
            "EDGE_LOOP",
            self.many([self.add("ORIENTED_EDGE", "*", "*", edge, ".T." if ahead else ".F.") for edge, ahead in edges]),
        )

    def disc(self, outer, height, up, inner=None):
        """A plane face, a disc or a ring, that looks up or down."""
        bounds = [self.add("FACE_OUTER_BOUND", self.loop((outer, up)), ".T.")]
        if inner is not None:
            bounds.append(self.add("FACE_BOUND", self.loop((inner, not up)), ".T."))
        plane = self.add("PLANE", self.place(height, 1.0 if up else -1.0))
        return self.add("ADVANCED_FACE", self.many(bounds), plane, ".T.")

    def wall(self, radius, low, bottom, top, outwards):
        """A cylinder from ring to ring that looks outwards or inwards."""
        along = self.add("VECTOR", self.direction(0, 0, 1), "1.0")
        line = self.add("LINE", self.point(radius, 0, low), along)
        seam = self.add("EDGE_CURVE", bottom[0], top[0], line, ".T.")
        loop = self.loop((bottom[1], True), (seam, True), (top[1], False), (seam, False))
        surface = self.add("CYLINDRICAL_SURFACE", self.place(0.0), f"{radius:.12E}")
        sense = ".T." if outwards else ".F."
        return self.add("ADVANCED_FACE", self.many([self.add("FACE_OUTER_BOUND", loop, sense)]), surface, sense)

    def text(self, faces, unit):
        """The file of a closed shell."""
        body = self.add("MANIFOLD_SOLID_BREP", self.add("CLOSED_SHELL", self.many(faces)))
        length = self.write(UNITS[unit])
        angle = self.write("( NAMED_UNIT(*) PLANE_ANGLE_UNIT() SI_UNIT($,.RADIAN.) )")
        solid = self.write("( NAMED_UNIT(*) SI_UNIT($,.STERADIAN.) SOLID_ANGLE_UNIT() )")
        exact = self.write(f"UNCERTAINTY_MEASURE_WITH_UNIT(LENGTH_MEASURE(1.E-07),{length},'','')")
        context = self.write(
            f"( GEOMETRIC_REPRESENTATION_CONTEXT(3) GLOBAL_UNCERTAINTY_ASSIGNED_CONTEXT(({exact})) "
            f"GLOBAL_UNIT_ASSIGNED_CONTEXT(({length},{angle},{solid})) REPRESENTATION_CONTEXT('','') )"
        )
        shape = self.add("ADVANCED_BREP_SHAPE_REPRESENTATION", self.many([self.place(0.0), body]), context)
        use = self.write("APPLICATION_CONTEXT('automotive design')")
        product = self.write(f"PRODUCT('part','part','',({self.add('PRODUCT_CONTEXT', use, chr(39) * 2)}))")
        version = self.add("PRODUCT_DEFINITION_FORMATION", "''", product)
        view = self.add("PRODUCT_DEFINITION_CONTEXT", use, "'design'")
        drawn = self.add("PRODUCT_DEFINITION_SHAPE", "''", self.add("PRODUCT_DEFINITION", "''", version, view))
        self.write(f"SHAPE_DEFINITION_REPRESENTATION({drawn},{shape})")
        return HEAD + "\n".join(self.rows) + "\nENDSEC;\nEND-ISO-10303-21;\n"


def pin(radius, low, high, unit="mm"):
    """A round pin."""
    file = Step()
    bottom, top = file.ring(radius, low), file.ring(radius, high)
    faces = [file.disc(bottom[1], low, False), file.disc(top[1], high, True)]
    return file.text([*faces, file.wall(radius, low, bottom, top, True)], unit)


def bush(outer, inner, depth, bottom, unit="mm"):
    """A round block with a blind hole from its top, z = 0."""
    file = Step()
    foot, rim = file.ring(outer, -depth - bottom), file.ring(outer, 0.0)
    floor, mouth = file.ring(inner, -depth), file.ring(inner, 0.0)
    faces = [file.disc(foot[1], -depth - bottom, False), file.disc(rim[1], 0.0, True, mouth[1])]
    faces += [file.disc(floor[1], -depth, True), file.wall(outer, -depth - bottom, foot, rim, True)]
    return file.text([*faces, file.wall(inner, -depth, floor, mouth, False)], unit)


def volume(radius, length):
    return math.pi * radius**2 * length
