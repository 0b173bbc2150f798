//! The text of one source of loads.

use std::path::PathBuf;

use super::{LoadSource, MAX_CASES};
use crate::error::{Error, Result};
use crate::units::{Quantity, direction};

/// Size of the ball's forces when none is stated \[N\].
const UNIT_FORCE: f64 = 1.0;
/// Size of the ball's moments when none is stated [N m].
const UNIT_MOMENT: f64 = 1.0;

const FORMS: &str = "use gravity, gravity:-z, gravity:N, gravity-cone:DIR:ANGLE, ball:N, ball:N:FORCE, ball:N+moments, ball:N:FORCE+moments:MOMENT, FILE.csv or FILE.json, joined by commas";

/// Parses one source.
pub(super) fn source(place: &str, text: &str) -> Result<LoadSource> {
    let (kind, rest) = text.split_once(':').map_or((text, None), |(kind, rest)| (kind, Some(rest)));
    match (kind, rest) {
        ("gravity", None) => Ok(LoadSource::GravityAxes),
        ("gravity", Some(rest)) => {
            if !rest.is_empty() && rest.bytes().all(|byte| byte.is_ascii_digit()) {
                return Ok(LoadSource::GravitySphere(count(place, text, rest)?));
            }
            Ok(LoadSource::Gravity(direction(place, rest)?))
        }
        ("gravity-cone", Some(rest)) => {
            let Some((axis, angle)) = rest.split_once(':') else {
                return Err(Error::input(
                    place,
                    format!("'{text}' has no angle"),
                    "write gravity-cone:DIR:ANGLE, e.g. gravity-cone:-z:20deg",
                ));
            };
            let half_angle = Quantity::Angle.parse(place, angle)?;
            // A little above pi, for `3.1416rad`.
            if !(0.0..=std::f64::consts::PI + 1e-4).contains(&half_angle) {
                return Err(Error::input(
                    place,
                    format!("'{text}': the cone's half angle is {angle}"),
                    "give 0deg to 180deg",
                ));
            }
            Ok(LoadSource::GravityCone { axis: direction(place, axis)?, half_angle })
        }
        ("ball", Some(rest)) => ball(place, text, rest),
        _ => {
            let path = PathBuf::from(text);
            match path
                .extension()
                .and_then(|suffix| suffix.to_str())
                .map(str::to_ascii_lowercase)
                .as_deref()
            {
                Some("csv" | "json") => Ok(LoadSource::File(path)),
                _ => Err(Error::input(place, format!("'{text}' is not a kind of load"), FORMS)),
            }
        }
    }
}

fn ball(place: &str, text: &str, rest: &str) -> Result<LoadSource> {
    let (forces, moments) = rest
        .split_once("+moments")
        .map_or((rest, None), |(forces, moments)| (forces, Some(moments)));
    let (number, force) =
        forces.split_once(':').map_or((forces, None), |(number, force)| (number, Some(force)));
    let directions = count(place, text, number)?;
    let force = force.map_or(Ok(UNIT_FORCE), |force| Quantity::Force.parse(place, force))?;
    let moment = match moments {
        None => None,
        Some("") => Some(UNIT_MOMENT),
        Some(moments) => match moments.strip_prefix(':') {
            Some(moment) => Some(Quantity::Moment.parse(place, moment)?),
            None => {
                return Err(Error::input(
                    place,
                    format!("'{text}': cannot read '{moments}' after +moments"),
                    FORMS,
                ));
            }
        },
    };
    if force <= 0.0 || moment.is_some_and(|moment| moment <= 0.0) {
        return Err(Error::input(
            place,
            format!("'{text}': the ball's forces and moments must be positive"),
            "give their size, e.g. ball:500:10N",
        ));
    }
    Ok(LoadSource::Ball { directions, force, moment })
}

fn count(place: &str, text: &str, number: &str) -> Result<usize> {
    match number.parse::<usize>() {
        Ok(count @ 1..=MAX_CASES) => Ok(count),
        _ => Err(Error::input(
            place,
            format!("'{text}': '{number}' is not a number of directions"),
            format!("give 1 to {MAX_CASES}, e.g. ball:500"),
        )),
    }
}
