//! OpenUSD as text: the part with one line for each grip, as NVIDIA's SimReady specification asks of
//! a graspable asset (capability "graspable vector": `BasisCurves` named `grasp_identifier_NN` that
//! run through the asset along the closing direction), and the pose beside it.

use std::io::Write;

use super::View;
use super::yaml::number;
use crate::part::Mesh;

/// How far a line reaches beyond the gripped faces \[m\]: it starts where the open jaw is.
const BEYOND: f64 = 5e-3;
/// Thickness of a drawn line \[m\].
const WIDTH: f64 = 1e-3;

pub(super) fn write(
    view: &View<'_>,
    writer: &mut impl Write,
    part: Option<&Mesh>,
) -> std::io::Result<()> {
    let grips = view.grips();
    writeln!(writer, "#usda 1.0\n(\n    defaultPrim = \"part\"\n    metersPerUnit = 1")?;
    let warnings = view.warnings().map(|text| format!("; warning: {text}"));
    let doc = view.tool_frame() + &warnings.collect::<String>();
    writeln!(writer, "    upAxis = \"Z\"\n    doc = {}\n)\n", string(&doc))?;
    writeln!(writer, "def Xform \"part\" (\n    kind = \"component\"\n)\n{{")?;
    text(writer, 1, "gripfast:part_file", &view.set.part.file)?;
    text(writer, 1, "gripfast:gripper", view.name())?;
    text(writer, 1, "gripfast:tool_frame", &view.tool_frame())?;
    if let Some(mesh) = part {
        write_mesh(writer, mesh)?;
    }
    let digits = grips.len().to_string().len().max(2);
    for (index, grip) in grips.iter().enumerate() {
        let frame = &grip.grip.part_from_grip;
        let reach = frame.rotation.z_axis * (grip.grip.width / 2.0 + BEYOND);
        let ends = [frame.origin - reach, frame.origin + reach].map(|end| vector(end.to_array()));
        writeln!(writer, "\n    def BasisCurves \"grasp_identifier_{:0digits$}\"", index + 1)?;
        writeln!(writer, "    {{\n        uniform token type = \"linear\"")?;
        writeln!(writer, "        int[] curveVertexCounts = [2]")?;
        writeln!(writer, "        point3f[] points = [{}, {}]", ends[0], ends[1])?;
        writeln!(
            writer,
            "        float[] widths = [{WIDTH}] (\n            interpolation = \"constant\"\n        )"
        )?;
        writeln!(writer, "        uniform token purpose = \"guide\"")?;
        // Matrices of USD act on rows: the transpose of ours.
        let rows = super::matrix(&view.pose(grip));
        let columns =
            [0, 1, 2, 3].map(|k: usize| vector([0, 1, 2, 3].map(|row: usize| rows[row][k])));
        writeln!(writer, "        custom matrix4d gripfast:tool = ( {} )", columns.join(", "))?;
        writeln!(writer, "        custom uint64 gripfast:id = {}", grip.grip.id)?;
        for (name, value) in [
            ("width", Some(grip.grip.width)),
            ("jaw_gap", Some(view.gap(grip))),
            ("opened_gap", Some(view.opened(grip))),
            ("mu_s", grip.worst.mu_s),
            ("safety", grip.safety),
            ("quality", Some(view.quality(grip))),
        ] {
            if let Some(value) = value.filter(|value| value.is_finite()) {
                writeln!(writer, "        custom double gripfast:{name} = {}", number(value))?;
            }
        }
        writeln!(writer, "    }}")?;
    }
    writeln!(writer, "}}")
}

fn write_mesh(writer: &mut impl Write, mesh: &Mesh) -> std::io::Result<()> {
    let (low, high) = mesh.bounding_box();
    writeln!(
        writer,
        "\n    def Mesh \"mesh\"\n    {{\n        uniform token subdivisionScheme = \"none\""
    )?;
    let extent = [low, high].map(|corner| vector(corner.to_array()));
    writeln!(writer, "        float3[] extent = [{}, {}]", extent[0], extent[1])?;
    let counts = vec!["3"; mesh.triangles.len()].join(", ");
    writeln!(writer, "        int[] faceVertexCounts = [{counts}]")?;
    let indices: Vec<String> = mesh.triangles.iter().flatten().map(u32::to_string).collect();
    writeln!(writer, "        int[] faceVertexIndices = [{}]", indices.join(", "))?;
    let points: Vec<String> = mesh.vertices.iter().map(|point| vector(point.to_array())).collect();
    writeln!(writer, "        point3f[] points = [{}]\n    }}", points.join(", "))
}

fn text(writer: &mut impl Write, depth: usize, name: &str, value: &str) -> std::io::Result<()> {
    writeln!(writer, "{}custom string {name} = {}", "    ".repeat(depth), string(value))
}

fn vector<const N: usize>(values: [f64; N]) -> String {
    format!("({})", values.map(number).join(", "))
}

/// A text in quotes, on one line.
fn string(text: &str) -> String {
    let shown = crate::text::shown(text);
    format!("\"{}\"", shown.replace('\\', "\\\\").replace('"', "\\\""))
}
