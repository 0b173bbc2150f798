// Triangles of the exact surfaces in a STEP file, by Open CASCADE. Called by step.rs; see there.

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <sstream>
#include <string>

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
#include <gp_Trsf.hxx>

// Calls `stage(user, name)` before each step of the work and `triangle(user, nine coordinates)` for every triangle, millimetres, counter-clockwise from outside. Returns the number
// of faces that could not be tessellated, or -1 with a message of at most `room` bytes.
extern "C" int gripfast_step(const char* data, size_t size, double share, double most, double angle, void* user,
                             void (*stage)(void*, const char*), void (*triangle)(void*, const double*), char* message,
                             size_t room) noexcept {
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
