//! The gripper file of a hand, commented.

use std::fmt::Write;

use super::{Block, Hand, Imported};
use crate::error::Result;
use crate::gripper::import::model::Model;

/// Sizes that are alike \[m\].
const SAME: f64 = 1e-5;
/// Least size of a body \[m\].
const THIN: f64 = 0.1e-3;

/// Millimetres as the file has them.
fn mm(value: f64) -> String {
    format!("{}mm", crate::units::decimal(value * 1e3, 4))
}

fn quoted(text: &str) -> String {
    serde_json::Value::from(text).to_string()
}

pub(super) fn write(model: &Model, hand: &Hand, name: Option<&str>) -> Result<Imported> {
    let mut text = String::new();
    let mut notes = hand.notes.clone();
    let model_name = format!("robot model {}", model.file());
    let (first, last) = (hand.rows[0], hand.rows[hand.rows.len() - 1]);
    // A file's numbers have four digits: the table must cover the stroke as it is written.
    let stroke = [mm(first.gap.max(0.0)), mm(last.gap)];
    let known_force = hand.prismatic && hand.effort.is_finite() && hand.effort > 0.0;
    let force = if known_force { hand.effort } else { 100.0 };
    let _ = writeln!(
        text,
        "# Made by `gripfast gripper import` from {}.\n\
         # Check each [unverified] value, then have it drawn: `gripfast gripper check FILE`.\n\
         # Axes: x1 approach (palm towards fingertips), x3 closing, x2 across; origin midway between the pads, jaws closed.\n\n\
         name = {}\n\
         stroke = [\"{}\", \"{}\"]\n\
         force = [\"{}N\", \"{}N\"]           # of one jaw\n",
        model.file().replace('\n', " "),
        quoted(name.unwrap_or(model.robot_name())),
        stroke[0],
        stroke[1],
        force / 10.0,
        force
    );
    let sizes = hand.pads;
    let _ = writeln!(
        text,
        "[pad]\nrectangle = [\"{}\", \"{}\"]      # along x1, x2",
        mm(sizes[0].x),
        mm(sizes[0].y)
    );
    if (sizes[0] - sizes[1]).abs().max_element() > SAME {
        let _ = writeln!(
            text,
            "\n[pad.II]\nrectangle = [\"{}\", \"{}\"]",
            mm(sizes[1].x),
            mm(sizes[1].y)
        );
    }
    let turned: Vec<Block> = hand.fingers[1].iter().map(half_turn).collect();
    let like = |a: &Block, b: &Block| {
        (a.low - b.low).abs().max_element() < SAME && (a.high - b.high).abs().max_element() < SAME
    };
    let alike = hand.moves == [true; 2]
        && hand.fingers[0].len() == turned.len()
        && hand.fingers[0].iter().all(|one| turned.iter().any(|other| like(one, other)));
    let mut sources = Vec::new();
    for (jaw, list) in ["I", "II"].into_iter().zip(&hand.fingers).take(if alike { 1 } else { 2 }) {
        for block in list {
            let _ = writeln!(text, "\n[[finger]]\nname = {}", quoted(&block.name));
            if !alike {
                let _ = writeln!(text, "jaw = \"{jaw}\"");
            }
            text += &body(block);
            sources
                .push((format!("finger.{}", block.name), format!("{model_name}: {}", block.what)));
        }
    }
    for block in &hand.palm {
        let _ = writeln!(text, "\n[[palm]]\nname = {}", quoted(&block.name));
        text += &body(block);
        sources.push((format!("palm.{}", block.name), format!("{model_name}: {}", block.what)));
    }
    let unit = if hand.prismatic { "m" } else { "rad" };
    let _ = writeln!(
        text,
        "\n[motion]                            # distance of the pads, advance, joint '{}'",
        hand.drive
    );
    match hand.moves {
        [true, false] => text += "moves = \"I\"\n",
        [false, true] => text += "moves = \"II\"\n",
        _ => {}
    }
    text += "table = [\n";
    for (index, row) in hand.rows.iter().enumerate() {
        let gap = match index {
            0 => stroke[0].clone(),
            _ if index + 1 == hand.rows.len() => stroke[1].clone(),
            _ => mm(row.gap),
        };
        let _ =
            writeln!(text, "    [\"{gap}\", \"{}\", \"{:.6}{unit}\"],", mm(row.advance), row.joint);
    }
    text += "]\n";
    let (link, mount) = &hand.mount;
    let axis = |axis: glam::DVec3| {
        let tidy = axis.to_array().map(|value| format!("{:.6}", value + 0.0));
        format!("[{}]", tidy.join(", ").replace("-0.000000", "0.000000"))
    };
    let o = mount.origin;
    let _ = writeln!(
        text,
        "\n[flange]\norigin = [\"{}\", \"{}\", \"{}\"]\ny = {}\nz = {}",
        mm(o.x),
        mm(o.y),
        mm(o.z),
        axis(mount.rotation.y_axis),
        axis(mount.rotation.z_axis)
    );
    let motion = quoted(&format!("{model_name}: joints from '{}'", hand.drive));
    let stated = quoted(&format!("{model_name}: where the pads stand at the joint's limits"));
    let motion = format!("motion = {motion}\nstroke = {stated}\n");
    let [known, doubtful] = if hand.doubt { ["", motion.as_str()] } else { [motion.as_str(), ""] };
    let _ = write!(text, "\n[source]\n{known}\n[unverified]\n{doubtful}");
    let force_text = if known_force {
        format!("largest effort of joint '{}'; the least is a tenth of it", hand.drive)
    } else {
        "not in the model: enter the data sheet's, of one jaw".to_owned()
    };
    let _ = writeln!(text, "force = {}", quoted(&force_text));
    let pads = "box round what lies within 0.5 mm of the innermost point of the jaw";
    let _ = writeln!(text, "\"pad.size\" = {}", quoted(pads));
    let flange = format!("frame of link '{link}', taken for the mounting face");
    let _ = writeln!(text, "flange = {}", quoted(&flange));
    sources.dedup();
    sources.sort();
    sources.dedup_by(|a, b| a.0 == b.0);
    for (key, source) in &sources {
        let _ = writeln!(text, "{} = {}", quoted(key), quoted(source));
    }
    if !known_force {
        notes.push(
            "the gripping force is not in the model: enter the data sheet's, of one jaw".to_owned(),
        );
    }
    notes.push("the friction of the pads is not in the model: state pad.friction".to_owned());
    // What is written must be a gripper.
    crate::gripper::parse(&text, "the imported gripper")?;
    Ok(Imported { text, notes })
}

/// A block after half a turn about `x1`.
fn half_turn(block: &Block) -> Block {
    let turn = glam::DVec3::new(1.0, -1.0, -1.0);
    let (a, b) = (block.low * turn, block.high * turn);
    Block { low: a.min(b), high: a.max(b), ..block.clone() }
}

fn body(block: &Block) -> String {
    let size = (block.high - block.low).max(glam::DVec3::splat(THIN));
    let at = (block.low + block.high) / 2.0;
    let triple = |v: glam::DVec3| format!("[\"{}\", \"{}\", \"{}\"]", mm(v.x), mm(v.y), mm(v.z));
    format!("box = {}\nat = {}\n", triple(size), triple(at))
}
