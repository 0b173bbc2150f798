//! `gripfast part`: what a part file holds, before any gripper is chosen.

use std::io::Write;
use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::Context;
use clap::Args as ClapArgs;
use comfy_table::{CellAlignment, Table, presets};
use glam::DVec3;
use gripfast::part::{
    CurvedFace, FacePair, FaceSource, Part, PlanarFace, ReadOptions, Residual, Shape, Symmetry,
    Unit, UnitSource, drawing,
};
use gripfast::units::{Length, Quantity};
use serde_json::json;

use crate::{flags, terminal};

/// Reads a part, checks its mesh, and lists its planar and curved faces and the pairs of planar
/// ones that can be gripped.
#[derive(Debug, ClapArgs)]
#[command(
    after_help = "EXAMPLES:\n  gripfast part bracket.stl\n  gripfast part bracket.stl --unit in --density 2.7g/cm3\n  gripfast part bracket.3mf --mass 350g --json\n  gripfast part bracket.stl --plot faces.svg\n\n\
Reads STL, OBJ, PLY, OFF, 3MF and glTF/GLB, each also as .gz; STEP where built with the feature `step`."
)]
pub(crate) struct Args {
    /// Part file.
    part: PathBuf,
    /// Unit of the file's numbers: mm, cm, m, um, in or ft. Default: the file's own (3MF, glTF),
    /// else mm.
    #[arg(long)]
    unit: Option<Unit>,
    /// Density, for the mass and the inertia.
    #[arg(long, value_name = "DENSITY", conflicts_with = "mass")]
    density: Option<String>,
    /// Mass, for the density and the inertia.
    #[arg(long, value_name = "MASS")]
    mass: Option<String>,
    /// Smallest and largest width of the pairs listed.
    #[arg(long, num_args = 2, value_names = ["MIN", "MAX"])]
    stroke: Option<Vec<String>>,
    /// Lists all faces and pairs, not only the largest.
    #[arg(long)]
    faces: bool,
    /// Also pairs that jaws opening into a slot can grip.
    #[arg(long)]
    internal: bool,
    /// Most memory that reading may take, e.g. 2GB. Default: half of the machine's.
    #[arg(long, value_name = "SIZE")]
    max_memory: Option<String>,
    /// Every facet is meant as a plane: none is taken for a curved face.
    #[arg(long)]
    faceted: bool,
    /// For noisy and scanned parts: fits planes and round faces to corners within this distance, some
    /// three times the noise, e.g. 0.2mm.
    #[arg(long, value_name = "LENGTH")]
    fit: Option<Length>,
    /// Drawing (SVG): three views with the faces numbered.
    #[arg(long, alias = "svg", value_name = "FILE.svg")]
    plot: Option<PathBuf>,
    /// One JSON object in SI units on standard output.
    #[arg(long)]
    json: bool,
}

/// Rows of a table without `--faces`.
const ROWS: usize = 10;

pub(crate) fn run(args: Args) -> anyhow::Result<ExitCode> {
    let density = args
        .density
        .as_deref()
        .map(|text| Quantity::Density.parse("--density", text))
        .transpose()?;
    let mass = args.mass.as_deref().map(|text| Quantity::Mass.parse("--mass", text)).transpose()?;
    for (flag, value) in [("--density", density), ("--mass", mass)] {
        anyhow::ensure!(value.is_none_or(|value| value > 0.0), "{flag}: must be positive");
    }
    let stroke = match args.stroke.as_deref() {
        Some([min, max]) => {
            [Quantity::Length.parse("--stroke", min)?, Quantity::Length.parse("--stroke", max)?]
        }
        _ => [0.0, f64::INFINITY],
    };
    let max_memory = args.max_memory.as_deref().map(flags::memory).transpose()?;
    let options = ReadOptions::default()
        .with_unit(args.unit)
        .with_max_memory(max_memory)
        .with_faceted(args.faceted)
        .with_fit(args.fit.map(|fit| fit.0));
    let part = Part::read(&args.part, &options)?;
    let volume = part.mass_properties(1.0).volume;
    let density = match mass {
        Some(mass) if volume > 0.0 => Some(mass / volume),
        Some(_) => {
            anyhow::bail!("{}: encloses no volume, so a mass gives no density", args.part.display())
        }
        None => density,
    };
    let mut pairs = part.pairs(stroke[0], stroke[1]);
    if args.internal {
        pairs.extend(part.internal_pairs(stroke[0], stroke[1]));
    }
    if let Some(path) = &args.plot {
        gripfast::file::write(path, |writer| writer.write_all(drawing::svg(&part).as_bytes()))?;
        terminal::say(&format!("wrote {}", path.display()));
    }
    if args.json {
        let mut out = std::io::stdout().lock();
        serde_json::to_writer_pretty(&mut out, &to_json(&part, &pairs, density))
            .context("writing JSON")?;
        writeln!(out)?;
    } else {
        let rows = if args.faces { usize::MAX } else { ROWS };
        write!(terminal::output(), "{}", to_text(&part, &pairs, density, rows))?;
    }
    // Round faces are gripped without a pair of planes.
    let nothing = pairs.is_empty() && part.curved.is_empty();
    Ok(if nothing { ExitCode::from(1) } else { ExitCode::SUCCESS })
}

fn to_text(part: &Part, pairs: &[FacePair], density: Option<f64>, rows: usize) -> String {
    let (low, high) = part.mesh.bounding_box();
    let size = (high - low) * 1e3;
    let unit = Unit::of_metres(part.unit_m).map_or(String::new(), |unit| unit.to_string());
    let unit = match part.unit_source {
        UnitSource::Assumed => format!("the file states no unit: {unit} assumed"),
        UnitSource::Given => format!("read in {unit}, as asked"),
        _ => format!("unit of the file: {unit}"),
    };
    let mut text = format!("{}\n", part.file.display());
    let mut line = |name: &str, value: String| text += &format!("  {name:<15} {value}\n");
    line("size", format!("{:.3} x {:.3} x {:.3} mm ({unit})", size.x, size.y, size.z));
    line(
        "triangles",
        format!("{}, {} vertices", part.mesh.triangles.len(), part.mesh.vertices.len()),
    );
    for (index, finding) in part.health.lines().into_iter().enumerate() {
        line(if index == 0 { "surface" } else { "" }, flags::warning(&finding));
    }
    let mass = part.mass_properties(density.unwrap_or(1.0));
    line("volume", format!("{:.3} cm3", mass.volume * 1e6));
    line("centre of mass", format!("{} mm", triple(mass.centre_of_mass * 1e3, 3)));
    if let Some(density) = density {
        line("mass", format!("{:.4} kg at {:.1} kg/m3", mass.mass, density));
        let inertia = mass.inertia * 1e6;
        let (xx, yy, zz) = (inertia.x_axis.x, inertia.y_axis.y, inertia.z_axis.z);
        line(
            "inertia",
            format!(
                "xx, yy, zz: {} kg mm2 about the centre of mass",
                triple(DVec3::new(xx, yy, zz), 4)
            ),
        );
        let (xy, yz, zx) = (inertia.x_axis.y, inertia.y_axis.z, inertia.z_axis.x);
        line(
            "",
            format!(
                "xy, yz, zx: {} kg mm2 (elements of the matrix)",
                triple(DVec3::new(xy, yz, zx), 4)
            ),
        );
    }
    let sources = part.faces.iter().map(|face| face.source);
    text += &format!("\n{} planar faces{}\n", part.faces.len(), of_file(sources));
    text += &face_table(&part.faces, rows);
    if !part.curved.is_empty() {
        let sources = part.curved.iter().map(|face| face.source);
        text += &format!("\n{} curved faces{}\n", part.curved.len(), of_file(sources));
        text += &curved_table(&part.curved, rows);
        if part.curved.iter().take(rows).any(CurvedFace::is_doubtful) {
            text += "faceted or round?: so few facets may be meant as planes; --faceted takes all for such\n";
        }
    }
    if let Some(about) = part.symmetry().as_ref().and_then(about) {
        text += &format!("\nround about {about}: a turn about it maps grips to grips\n");
    }
    text += &format!("\n{} antiparallel pairs\n", pairs.len());
    text += &pair_table(pairs, rows);
    text
}

/// How many faces the file states; nothing where it states none.
fn of_file(sources: impl ExactSizeIterator<Item = FaceSource> + Clone) -> String {
    let all = sources.len();
    match sources.filter(|source| *source == FaceSource::File).count() {
        0 => String::new(),
        count if count == all => ", as the file states them".to_string(),
        count => format!(", {count} as the file states them, the others found in the mesh"),
    }
}

fn table(header: &[&str]) -> Table {
    let mut table = Table::new();
    table.load_style(presets::NOTHING).set_header(header);
    for column in table.column_iter_mut() {
        column.set_cell_alignment(CellAlignment::Right);
    }
    table
}

fn finish(table: &Table, total: usize, rows: usize) -> String {
    let more = total.saturating_sub(rows);
    let rest = if more > 0 {
        format!("  ... and {more} smaller ones (--faces lists all)\n")
    } else {
        String::new()
    };
    if total == 0 { String::new() } else { format!("{}\n{rest}", table.trim_fmt()) }
}

/// A fixed number of decimals, never `-0.00`.
fn fixed(value: f64, decimals: usize) -> String {
    let text = format!("{value:.decimals$}");
    if text.starts_with('-') && !text.contains(|digit: char| ('1'..='9').contains(&digit)) {
        text[1..].to_string()
    } else {
        text
    }
}

/// Three numbers with a fixed number of decimals.
fn triple(value: DVec3, decimals: usize) -> String {
    format!(
        "{} {} {}",
        fixed(value.x, decimals),
        fixed(value.y, decimals),
        fixed(value.z, decimals)
    )
}

/// What a part is round about, in words.
pub(crate) fn about(symmetry: &Symmetry) -> Option<String> {
    match symmetry {
        Symmetry::Axis { axis } => {
            let [direction, origin] = [triple(axis.direction, 4), triple(axis.origin * 1e3, 2)];
            Some(format!("the axis {direction} through {origin} mm"))
        }
        Symmetry::Point { centre } => Some(format!("{} mm", triple(*centre * 1e3, 2))),
        _ => None,
    }
}

fn face_table(faces: &[PlanarFace], rows: usize) -> String {
    let mut table = table(&["face", "area mm2", "normal", "offset mm", "holes", "centre mm", ""]);
    let is_mixed = is_mixed(faces.iter().map(|face| face.source));
    for face in faces.iter().take(rows) {
        table.add_row([
            face.id.to_string(),
            format!("{:.2}", face.area * 1e6),
            triple(face.normal, 4),
            fixed(face.offset * 1e3, 3),
            face.polygons.iter().map(|polygon| polygon.holes.len()).sum::<usize>().to_string(),
            triple(face.centroid * 1e3, 2),
            note(face.source, face.fit, face.reachable, false, is_mixed),
        ]);
    }
    finish(&table, faces.len(), rows)
}

fn curved_table(faces: &[CurvedFace], rows: usize) -> String {
    let header =
        ["face", "kind", "", "area mm2", "size mm", "axis", "through mm", "off um", "facets", ""];
    let mut table = table(&header);
    let is_mixed = is_mixed(faces.iter().map(|face| face.source));
    for face in faces.iter().take(rows) {
        let direction = face.shape.axis().map_or(String::new(), |axis| triple(axis.direction, 4));
        let through = match face.shape {
            Shape::Sphere { centre, .. } => centre,
            Shape::Cone { apex, .. } => apex,
            shape => shape.axis().map_or(face.centroid, |axis| axis.origin),
        };
        table.add_row([
            face.id.to_string(),
            face.shape.name().to_string(),
            if face.outside { "outside" } else { "inside" }.to_string(),
            format!("{:.2}", face.area * 1e6),
            size(&face.shape),
            direction,
            triple(through * 1e3, 2),
            match face.shape {
                Shape::Freeform => String::new(),
                _ => format!("{:.2}", face.residual * 1e6),
            },
            face.facets.map_or(String::new(), |facets| format!("{facets:.0}")),
            note(face.source, face.fit, face.reachable, face.is_doubtful(), is_mixed),
        ]);
    }
    finish(&table, faces.len(), rows)
}

/// Radius and extent of a curved face, in words.
fn size(shape: &Shape) -> String {
    let long = |along: [f64; 2]| format!("{:.2} long", (along[1] - along[0]) * 1e3);
    match *shape {
        Shape::Cylinder { radius, along, turn, .. } => {
            let arc = if turn < std::f64::consts::TAU {
                format!(", {:.0} deg", turn.to_degrees())
            } else {
                String::new()
            };
            format!("R {:.3}, {}{arc}", radius * 1e3, long(along))
        }
        Shape::Cone { half_angle, along, .. } => {
            let [small, large] = along.map(|place| place * half_angle.tan() * 1e3);
            format!("R {small:.3} to {large:.3}, {:.2} deg", half_angle.to_degrees())
        }
        Shape::Sphere { radius, .. } => format!("R {:.3}", radius * 1e3),
        Shape::Torus { major, minor, .. } => {
            format!("R {:.3}, tube {:.3}", major * 1e3, minor * 1e3)
        }
        Shape::Revolution { along, .. } => long(along),
        _ => String::new(),
    }
}

/// Whether the file states some of the faces, but not all.
fn is_mixed(mut sources: impl Iterator<Item = FaceSource>) -> bool {
    let first = sources.next();
    sources.any(|source| Some(source) != first)
}

fn note(
    source: FaceSource,
    fit: Option<Residual>,
    reachable: bool,
    doubtful: bool,
    mixed: bool,
) -> String {
    let mut notes = Vec::new();
    let residual = fit.map(|Residual { rms, greatest }| {
        format!("fitted: rms {:.1} um, at most {:.1}", rms * 1e6, greatest * 1e6)
    });
    notes.extend(residual.as_deref());
    if mixed && source == FaceSource::Mesh {
        notes.push("from the mesh");
    }
    if doubtful {
        notes.push("faceted or round?");
    }
    if !reachable {
        notes.push("inside");
    }
    notes.join(", ")
}

fn pair_table(pairs: &[FacePair], rows: usize) -> String {
    let mut table = table(&["faces", "width mm", "overlap mm2", "kind"]);
    for pair in pairs.iter().take(rows) {
        table.add_row([
            format!("{} | {}", pair.face_i, pair.face_ii),
            format!("{:.3}", pair.width * 1e3),
            format!("{:.2}", pair.overlap_area * 1e6),
            format!("{:?}", pair.kind).to_lowercase(),
        ]);
    }
    finish(&table, pairs.len(), rows)
}

fn to_json(part: &Part, pairs: &[FacePair], density: Option<f64>) -> serde_json::Value {
    let (low, high) = part.mesh.bounding_box();
    let mass = part.mass_properties(density.unwrap_or(1.0));
    let faces: Vec<_> = part
        .faces
        .iter()
        .map(|face| {
            json!({
                "id": face.id, "area": face.area, "normal": face.normal, "offset": face.offset, "centroid": face.centroid,
                "part_from_face": face.part_from_face, "polygons": face.polygons, "shell": face.shell, "reachable": face.reachable, "source": face.source, "fit": face.fit,
            })
        })
        .collect();
    let curved: Vec<_> = part
        .curved
        .iter()
        .map(|face| {
            json!({
                "id": face.id, "shape": face.shape, "outside": face.outside, "residual": face.residual,
                "facets": face.facets, "doubtful": face.is_doubtful(), "area": face.area,
                "centroid": face.centroid, "shell": face.shell, "reachable": face.reachable, "source": face.source, "fit": face.fit,
            })
        })
        .collect();
    let pairs: Vec<_> = pairs
        .iter()
        .map(|pair| json!({ "faces": [pair.face_i, pair.face_ii], "width": pair.width, "overlap_area": pair.overlap_area, "kind": pair.kind }))
        .collect();
    json!({
        "file": part.file, "name": part.name, "unit_m": part.unit_m, "unit_source": part.unit_source, "triangles": part.mesh.triangles.len(), "vertices": part.mesh.vertices.len(),
        "bbox_min": low, "bbox_max": high, "health": part.health, "volume": mass.volume, "centre_of_mass": mass.centre_of_mass,
        "density": density, "mass": density.map(|_| mass.mass), "inertia": density.map(|_| mass.inertia), "faces": faces, "curved": curved, "symmetry": part.symmetry(), "pairs": pairs,
    })
}
