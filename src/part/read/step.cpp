// Triangles of the exact surfaces in a STEP file, by Open CASCADE. Called by step.rs; see there.

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <sstream>
#include <string>

#include <BRepAdaptor_Surface.hxx>
#include <BRepBndLib.hxx>
#include <BRepMesh_IncrementalMesh.hxx>
#include <BRep_Tool.hxx>
#include <Bnd_Box.hxx>
#include <Message.hxx>
#include <Message_Messenger.hxx>
#include <Poly_Triangulation.hxx>
#include <STEPControl_Reader.hxx>
#include <Standard_Failure.hxx>
#include <TopExp_Explorer.hxx>
#include <TopoDS.hxx>
#include <TopoDS_Face.hxx>
#include <gp_Ax1.hxx>
#include <gp_Circ.hxx>
#include <gp_Cone.hxx>
#include <gp_Cylinder.hxx>
#include <gp_Lin.hxx>
#include <gp_Pln.hxx>
#include <gp_Sphere.hxx>
#include <gp_Torus.hxx>
#include <gp_Trsf.hxx>
#include <gp_Vec.hxx>

// The surface of a face, as `Stated::from_kernel` in given.rs takes it: a kind; a point, a direction and two sizes.
enum Kind { OTHER, PLANE, CYLINDER, CONE, SPHERE, TORUS, REVOLUTION };
struct Stated {
    Kind kind = OTHER;
    gp_Pnt point = gp_Pnt();
    gp_Dir direction = gp_Dir(0.0, 0.0, 1.0);
    double first = 0.0, second = 0.0;
};

static Stated stated(Kind kind, const gp_Ax1& axis, double first = 0.0, double second = 0.0) {
    Stated found;
    found.kind = kind, found.point = axis.Location(), found.direction = axis.Direction();
    found.first = first, found.second = second;
    return found;
}

// Lengths in millimetres and sines of angles that are rounding.
constexpr double ROUNDING = 1e-9;

// A line or circle turned about an axis makes an elementary surface where it lies in one plane with the axis.
static Stated turned(const BRepAdaptor_Surface& surface) {
    const gp_Ax1 axis = surface.AxeOfRevolution();
    const gp_Vec along(axis.Direction());
    const Stated general = stated(REVOLUTION, axis);
    const auto profile = surface.BasisCurve();
    const bool is_line = profile->GetType() == GeomAbs_Line;
    if (!is_line && profile->GetType() != GeomAbs_Circle) return general;
    const gp_Pnt point = is_line ? profile->Line().Location() : profile->Circle().Location();
    const gp_Vec from(axis.Location(), point);
    const gp_Pnt foot = axis.Location().Translated(along * from.Dot(along));
    const gp_Vec out(foot, point);
    const double radius = out.Magnitude();
    const bool is_on_axis = radius < ROUNDING;
    const gp_Ax1 at_foot(foot, axis.Direction());
    if (!is_line) {
        const gp_Vec normal(profile->Circle().Axis().Direction());
        if (std::abs(normal.Dot(along)) > ROUNDING || std::abs(normal.Dot(out)) > ROUNDING) return general;
        const double tube = profile->Circle().Radius();
        return is_on_axis ? stated(SPHERE, at_foot, tube) : stated(TORUS, at_foot, radius, tube);
    }
    const gp_Vec line(profile->Line().Direction());
    if (std::abs(line.Dot(along.Crossed(out))) > ROUNDING) return general;
    const double rise = line.Dot(along);
    const gp_Vec across = line - along * rise;
    if (across.Magnitude() < ROUNDING) return is_on_axis ? Stated() : stated(CYLINDER, at_foot, radius);
    if (std::abs(rise) < ROUNDING) return stated(PLANE, at_foot);
    const double away = is_on_axis ? across.Magnitude() : across.Dot(out) / radius;
    return stated(CONE, at_foot, radius, std::atan(away / rise));
}

// A line or circle moved along a direction.
static Stated extruded(const BRepAdaptor_Surface& surface) {
    const gp_Vec along(surface.Direction());
    const auto profile = surface.BasisCurve();
    if (profile->GetType() == GeomAbs_Line) {
        const gp_Vec normal = along.Crossed(gp_Vec(profile->Line().Direction()));
        if (normal.Magnitude() < ROUNDING) return Stated();
        return stated(PLANE, gp_Ax1(profile->Line().Location(), gp_Dir(normal)));
    }
    if (profile->GetType() != GeomAbs_Circle) return Stated();
    const gp_Ax1 axis = profile->Circle().Axis();
    const bool is_straight = along.Crossed(gp_Vec(axis.Direction())).Magnitude() < ROUNDING;
    return is_straight ? stated(CYLINDER, axis, profile->Circle().Radius()) : Stated();
}

static Stated surface_of(const TopoDS_Face& face) {
    TopLoc_Location location;
    if (BRep_Tool::Surface(face, location).IsNull()) return Stated();
    const BRepAdaptor_Surface surface(face, Standard_False);
    switch (surface.GetType()) {
        case GeomAbs_Plane: return stated(PLANE, surface.Plane().Axis());
        case GeomAbs_Cylinder: return stated(CYLINDER, surface.Cylinder().Axis(), surface.Cylinder().Radius());
        case GeomAbs_Cone: return stated(CONE, surface.Cone().Axis(), surface.Cone().RefRadius(), surface.Cone().SemiAngle());
        case GeomAbs_Sphere: return stated(SPHERE, surface.Sphere().Position().Axis(), surface.Sphere().Radius());
        case GeomAbs_Torus: return stated(TORUS, surface.Torus().Axis(), surface.Torus().MajorRadius(), surface.Torus().MinorRadius());
        case GeomAbs_SurfaceOfRevolution: return turned(surface);
        case GeomAbs_SurfaceOfExtrusion: return extruded(surface);
        default: return Stated();
    }
}

// Calls `stage(user, name)` before each step of the work, `face(user, kind, eight numbers)` before the triangles of
// each face and `triangle(user, nine coordinates)` for every triangle, millimetres, counter-clockwise from outside.
// Returns the number of faces that could not be tessellated, or -1 with a message of at most `room` bytes.
extern "C" int gripfast_step(const char* data, size_t size, double share, double most, double angle, void* user,
                             void (*stage)(void*, const char*), void (*face_of)(void*, int, const double*),
                             void (*triangle)(void*, const double*), char* message, size_t room) noexcept {
    const auto fail = [&](const char* text) {
        std::snprintf(message, room, "%s", text);
        return -1;
    };
    try {
        Message::DefaultMessenger()->ChangePrinters().Clear();
        stage(user, "reading the text");
        std::istringstream stream(std::string(data, size));
        STEPControl_Reader reader;
        if (reader.ReadStream("part", stream) != IFSelect_RetDone) return fail("the STEP text cannot be read");
        stage(user, "making the shapes");
        reader.TransferRoots();
        const TopoDS_Shape shape = reader.OneShape();
        if (shape.IsNull()) return fail("holds no shape");
        Bnd_Box box;
        BRepBndLib::Add(shape, box);
        if (box.IsVoid()) return fail("holds no surface");
        stage(user, "tessellating");
        const double linear = std::min(most, share * std::sqrt(box.SquareExtent()));
        BRepMesh_IncrementalMesh mesher(shape, linear, Standard_False, angle, Standard_False);
        stage(user, "collecting the triangles");
        int left_out = 0;
        for (TopExp_Explorer faces(shape, TopAbs_FACE); faces.More(); faces.Next()) {
            const TopoDS_Face& face = TopoDS::Face(faces.Current());
            TopLoc_Location location;
            const Handle(Poly_Triangulation) mesh = BRep_Tool::Triangulation(face, location);
            if (mesh.IsNull()) {
                ++left_out;
                continue;
            }
            const gp_Trsf placed = location.Transformation();
            const Stated own = surface_of(face);
            const double eight[8] = {own.point.X(), own.point.Y(), own.point.Z(), own.direction.X(), own.direction.Y(),
                                     own.direction.Z(), own.first, own.second};
            face_of(user, own.kind, eight);
            for (int index = 1; index <= mesh->NbTriangles(); ++index) {
                int corner[3];
                mesh->Triangle(index).Get(corner[0], corner[1], corner[2]);
                if (face.Orientation() == TopAbs_REVERSED) std::swap(corner[1], corner[2]);
                double nine[9];
                for (int k = 0; k < 3; ++k) {
                    const gp_Pnt point = mesh->Node(corner[k]).Transformed(placed);
                    nine[3 * k] = point.X(), nine[3 * k + 1] = point.Y(), nine[3 * k + 2] = point.Z();
                }
                triangle(user, nine);
            }
        }
        return left_out;
    } catch (const Standard_Failure& failure) {
        return fail(failure.GetMessageString());
    } catch (const std::exception& failure) {
        return fail(failure.what());
    } catch (...) {
        return fail("the CAD kernel failed");
    }
}
