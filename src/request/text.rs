//! Options of several values that are one text in files and flags, and read back bit for bit.

use std::fmt;
use std::str::FromStr;

use glam::{DMat3, DVec3};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::error::{Error, Result};
use crate::units::{Angle, Inertia, Length, direction, direction_text};

/// Directions within an angle of an axis; `-z:45deg` as a text.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cone {
    /// Axis in the part frame; any length.
    pub axis: DVec3,
    /// Half the opening angle \[rad\].
    pub half_angle: f64,
}

/// The half-space `normal . x >= offset` of the part frame; `+z:0mm` as a text.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ground {
    /// Points up; any length.
    pub normal: DVec3,
    /// Height of the ground along the unit normal \[m\].
    pub offset: f64,
}

/// A box along the axes of the part frame; `0mm,0mm,0mm:10mm,20mm,5mm` as a text.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Region {
    /// Smallest coordinates \[m\].
    pub low: DVec3,
    /// Largest coordinates \[m\].
    pub high: DVec3,
}

/// A place in the part frame \[m\]; `10mm,0mm,5mm` as a text.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Position(pub DVec3);

/// A matrix of inertia by its elements xx, yy, zz, xy, yz, zx [kg m^2];
/// `67kgmm2,107kgmm2,91kgmm2,0kgmm2,0kgmm2,30kgmm2` as a text.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct InertiaMatrix(pub [f64; 6]);

impl InertiaMatrix {
    /// The symmetric matrix.
    pub fn matrix(&self) -> DMat3 {
        let [xx, yy, zz, xy, yz, zx] = self.0;
        DMat3::from_cols_array(&[xx, xy, zx, xy, yy, yz, zx, yz, zz])
    }

    /// Refuses a matrix that no body has: the second moments of its mass, half the trace less the
    /// matrix, must not be negative in any direction.
    pub(super) fn check(&self) -> Result<()> {
        let [xx, yy, zz, xy, yz, zx] = self.0;
        let half = (xx + yy + zz) / 2.0;
        let [a, b, c] = [half - xx, half - yy, half - zz];
        let slack = -1e-9 * half.abs();
        let minors = [a * b - xy * xy, b * c - yz * yz, a * c - zx * zx];
        let moments = DMat3::from_diagonal(DVec3::splat(half)) - self.matrix();
        let body = half > 0.0
            && [a, b, c].iter().all(|moment| *moment >= slack)
            && minors.iter().all(|minor| *minor >= slack * half)
            && moments.determinant() >= slack * half * half;
        if body && half.is_finite() {
            return Ok(());
        }
        Err(Error::input(
            "inertia",
            format!("'{self}' is that of no body"),
            "give xx,yy,zz,xy,yz,zx about the centre of mass: no principal moment may exceed the \
             sum of the others, and the last three are elements of the matrix, products of inertia \
             with a minus",
        )
        .with_options(&["inertia"]))
    }
}

/// How far a pose may be off; `1mm,2deg` as a text.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PoseError {
    /// Along each of the pad plane's axes, either way.
    pub shift: Length,
    /// About the closing axis, either way.
    pub turn: Angle,
}

/// Weights of the earlier evaluation function
/// `(k1 Delta_d + k2 tau_s/(mu_s N))/(D + epsilon) + k3 alpha`; `1,1,1,1mm` as a text, and an empty
/// text for the default.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EarlierWeights {
    /// Of the resistance to twisting out, `Delta_d`.
    pub k1: f64,
    /// Of the resistance to slip, `tau_s/(mu_s N)`.
    pub k2: f64,
    /// Of the tolerance to misalignment while closing, `alpha` [m per radian makes the sum a pure
    /// number].
    pub k3: f64,
    /// Keeps the function finite at the centre of mass \[m\].
    pub epsilon: f64,
}

impl Default for EarlierWeights {
    /// One each, and 1 mm: the paper states none.
    fn default() -> Self {
        Self { k1: 1.0, k2: 1.0, k3: 1.0, epsilon: 1e-3 }
    }
}

/// The two sides of the colon.
fn sides<'a>(what: &str, text: &'a str, shape: &str) -> Result<(&'a str, &'a str)> {
    text.split_once(':').ok_or_else(|| {
        Error::input(what, format!("'{text}' has no colon"), format!("give {shape}"))
    })
}

impl FromStr for Cone {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let (axis, angle) = sides("approach", text, "DIR:ANGLE, e.g. -z:45deg")?;
        Ok(Self { axis: direction("approach", axis)?, half_angle: angle.parse::<Angle>()?.0 })
    }
}

impl fmt::Display for Cone {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{}:{}", direction_text(self.axis), Angle(self.half_angle))
    }
}

impl FromStr for Ground {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let (normal, height) = sides("ground", text, "DIR:HEIGHT, e.g. +z:0mm")?;
        Ok(Self { normal: direction("ground", normal)?, offset: height.parse::<Length>()?.0 })
    }
}

impl fmt::Display for Ground {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{}:{}", direction_text(self.normal), Length(self.offset))
    }
}

/// Values of one kind, joined by commas.
fn values<const N: usize, T: FromStr<Err = Error>>(
    option: &'static str,
    text: &str,
    form: &str,
) -> Result<[T; N]> {
    let values: Vec<T> = text.split(',').map(str::parse).collect::<Result<_>>()?;
    values.try_into().map_err(|_| {
        Error::input(option, format!("'{text}' is not {N} values"), format!("give {form}"))
            .with_options(&[option])
    })
}

impl FromStr for Position {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let values: [Length; 3] = values("com", text, "X,Y,Z with units, e.g. 10mm,0mm,5mm")?;
        Ok(Self(DVec3::from_array(values.map(|length| length.0))))
    }
}

impl fmt::Display for Position {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(&self.0.to_array().map(|value| Length(value).to_string()).join(","))
    }
}

impl FromStr for InertiaMatrix {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let form =
            "xx,yy,zz,xy,yz,zx with units, e.g. 67kgmm2,107kgmm2,91kgmm2,0kgmm2,0kgmm2,30kgmm2";
        Ok(Self(values::<6, Inertia>("inertia", text, form)?.map(|inertia| inertia.0)))
    }
}

impl fmt::Display for InertiaMatrix {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(&self.0.map(|value| Inertia(value).to_string()).join(","))
    }
}

impl FromStr for Region {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let (low, high) = sides("box", text, "LOW:HIGH, e.g. 0mm,0mm,0mm:10mm,20mm,5mm")?;
        let corner = |text: &str| -> Result<DVec3> {
            let values: Vec<f64> = text
                .split(',')
                .map(|value| value.parse::<Length>().map(|length| length.0))
                .collect::<Result<_>>()?;
            let values: [f64; 3] = values.try_into().map_err(|_| {
                Error::input(
                    "box",
                    format!("'{text}' is not three lengths"),
                    "give x,y,z with units",
                )
            })?;
            Ok(DVec3::from_array(values))
        };
        Ok(Self { low: corner(low)?, high: corner(high)? })
    }
}

impl fmt::Display for Region {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let corner =
            |corner: DVec3| corner.to_array().map(|value| Length(value).to_string()).join(",");
        write!(formatter, "{}:{}", corner(self.low), corner(self.high))
    }
}

impl FromStr for PoseError {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let Some((shift, turn)) = text.split_once(',') else {
            return Err(Error::input(
                "pose noise",
                format!("'{text}' is not a length and an angle"),
                "give both, e.g. 1mm,2deg",
            ));
        };
        Ok(Self { shift: shift.parse()?, turn: turn.parse()? })
    }
}

impl fmt::Display for PoseError {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{},{}", self.shift, self.turn)
    }
}

impl FromStr for EarlierWeights {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        if text.is_empty() {
            return Ok(Self::default());
        }
        let wrong = |problem: String| {
            Error::input("compare", problem, "give K1,K2,K3,EPSILON, e.g. 1,1,1,1mm, or nothing")
        };
        let parts: Vec<&str> = text.split(',').map(str::trim).collect();
        let [k1, k2, k3, epsilon] = parts[..] else {
            return Err(wrong(format!("'{text}' is not four values")));
        };
        let weight =
            |text: &str| text.parse().map_err(|_| wrong(format!("'{text}' is not a number")));
        Ok(Self {
            k1: weight(k1)?,
            k2: weight(k2)?,
            k3: weight(k3)?,
            epsilon: epsilon.parse::<Length>()?.0,
        })
    }
}

impl fmt::Display for EarlierWeights {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{},{},{},{}", self.k1, self.k2, self.k3, Length(self.epsilon))
    }
}

/// Serde through the text.
macro_rules! as_text {
    ($($name:ident),+) => {$(
        impl Serialize for $name {
            fn serialize<S: Serializer>(
                &self,
                serializer: S,
            ) -> std::result::Result<S::Ok, S::Error> {
                serializer.collect_str(self)
            }
        }

        impl<'de> Deserialize<'de> for $name {
            fn deserialize<D: Deserializer<'de>>(
                deserializer: D,
            ) -> std::result::Result<Self, D::Error> {
                let text = String::deserialize(deserializer)?;
                text.parse().map_err(|error: Error| {
                    serde::de::Error::custom(error.to_string().replace("\n  remedy: ", "; "))
                })
            }
        }
    )+};
}

as_text!(Cone, Ground, InertiaMatrix, Position, Region, PoseError, EarlierWeights);
