//! `[motion]` of a gripper file: which jaws move, and how their pads go along the approach.

use serde::Deserialize;

use super::Reader;
use crate::error::Result;
use crate::gripper::{Moving, Travel, TravelRow};
use crate::units::Quantity;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Motion {
    #[serde(default)]
    moves: Moving,
    arc: Option<Arc>,
    /// Distance of the pads, advance, and, where known, the joint's value.
    table: Option<Vec<Vec<String>>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Arc {
    crank: String,
    angle: String,
    joint: Option<[String; 2]>,
}

impl Reader<'_> {
    pub(super) fn motion(&self, motion: &Motion, stroke: [f64; 2]) -> Result<(Moving, Travel)> {
        let field = "motion";
        let remedy = "give arc = { crank = \"57mm\", angle = \"-5deg\" } (length, and angle from the approach axis with touching pads, outwards positive) or table = [[\"0mm\", \"0mm\"], ...] (distance of the pads, advance, and the joint if known), or moves = \"I\" where one jaw is fixed";
        let travel = match (&motion.arc, &motion.table) {
            (Some(arc), None) => self.arc(arc, motion.moves != Moving::Both, stroke)?,
            (None, Some(table)) => self.table(table, stroke, remedy)?,
            (None, None) if motion.moves != Moving::Both => Travel::Parallel,
            _ => return Err(self.bad(field, "needs exactly one of arc and table", remedy)),
        };
        Ok((motion.moves, travel))
    }

    fn arc(&self, arc: &Arc, alone: bool, stroke: [f64; 2]) -> Result<Travel> {
        let crank = self.positive("motion.arc.crank", Quantity::Length, &arc.crank)?;
        let angle = self.value("motion.arc.angle", Quantity::Angle, &arc.angle)?;
        let way = if alone { stroke[1] } else { stroke[1] / 2.0 };
        if !(angle.abs() < std::f64::consts::FRAC_PI_2 && angle.sin() + way / crank < 1.0) {
            let problem = format!(
                "a crank of {} from {} does not carry the pads as far apart as the stroke",
                arc.crank, arc.angle
            );
            return Err(self.bad("motion.arc", problem, "give a longer crank"));
        }
        let joint = match &arc.joint {
            None => None,
            Some([closed, opened]) => {
                let value = |text| self.value("motion.arc.joint", Quantity::Angle, text);
                Some([value(closed)?, value(opened)?])
            }
        };
        Ok(Travel::Arc { crank, angle, joint, alone })
    }

    fn table(&self, table: &[Vec<String>], stroke: [f64; 2], remedy: &str) -> Result<Travel> {
        let rows = table.iter().map(|row| self.row(row)).collect::<Result<Vec<TravelRow>>>()?;
        let rising = rows.windows(2).all(|pair| pair[0].width < pair[1].width);
        let alike = rows.iter().all(|row| row.joint.is_some() == rows[0].joint.is_some());
        let covers = match rows.as_slice() {
            [first, .., last] => first.width <= stroke[0] && last.width >= stroke[1],
            _ => false,
        };
        if !(rising && alike && covers) {
            return Err(self.bad(
                "motion.table",
                "does not cover the stroke with rising distances and equal rows",
                remedy,
            ));
        }
        Ok(Travel::Table { rows })
    }

    fn row(&self, row: &[String]) -> Result<TravelRow> {
        let field = "motion.table";
        let joint = |text: &String| {
            self.value(field, Quantity::Angle, text)
                .or_else(|_| self.value(field, Quantity::Length, text))
        };
        match row {
            [width, advance, rest @ ..] if rest.len() <= 1 => Ok(TravelRow {
                width: self.value(field, Quantity::Length, width)?,
                advance: self.value(field, Quantity::Length, advance)?,
                joint: rest.first().map(joint).transpose()?,
            }),
            _ => Err(self.bad(
                field,
                format!("has a row of {} values", row.len()),
                "give distance, advance and, if known, the joint",
            )),
        }
    }
}
