//! Load cases: what pulls at the part while it is held, as wrenches in the part frame about the
//! centre of mass.
//!
//! A [`LoadSet`] is what the user asked for; [`LoadSet::cases`] turns it into [`LoadCase`]s through the part's mass properties, and
//! [`wrench_in_grip`] carries one into a grip frame. Wrenches act ON the body: gravity along `-z`
//! on 1 kg is the force `(0, 0, -9.80665)` N.

mod list;
mod source;
mod table;
mod trajectory;

use std::path::{Path, PathBuf};

use glam::{DMat3, DVec3};

use crate::error::{Error, ErrorKind, Result};
use crate::file;
use crate::geometry::sphere;
use crate::model::{Frame, LoadCase, Wrench};
use crate::part::MassProperties;
use crate::units::STANDARD_GRAVITY;

/// Largest number of load cases of one run; load indices are 32-bit and memory is finite.
pub const MAX_CASES: usize = 10_000_000;

/// Directions of acceleration that [`LoadSet::acceleration`] tries by default: the vertices of an
/// icosahedron divided three-fold. The worst direction lies within 14 degrees of one of them, so
/// the inertial force that counts is at least 97 % of the worst.
pub const ACCELERATION_DIRECTIONS: usize = 92;

/// Everything that shall be held, as asked for.
#[derive(Debug, Clone, PartialEq)]
pub struct LoadSet {
    /// The sources, in the order given; their cases follow each other in this order.
    pub sources: Vec<LoadSource>,
    /// Acceleration in any direction on top of every gravity case.
    pub acceleration: Option<Acceleration>,
    /// Part frame in the world, for wrenches given in world axes and as the first pose of a
    /// trajectory that states none.
    pub world_from_part: Frame,
    /// Gravity in the world during a trajectory [m/s^2].
    pub world_gravity: DVec3,
}

/// One source of load cases.
#[derive(Debug, Clone, PartialEq)]
pub enum LoadSource {
    /// The part's weight along each of the six part axes.
    GravityAxes,
    /// The part's weight in this direction (any length but zero), part frame.
    Gravity(DVec3),
    /// The part's weight in this many directions spread over the sphere.
    GravitySphere(usize),
    /// The part's weight in directions within `half_angle` \[rad\] of `axis`, part frame.
    GravityCone {
        /// Middle of the cone.
        axis: DVec3,
        /// Half its opening, 0 to pi \[rad\].
        half_angle: f64,
    },
    /// The paper's ball: forces normal to the facets of a sphere about the centre of mass, directed
    /// at it.
    Ball {
        /// Number of directions.
        directions: usize,
        /// Size of each force \[N\].
        force: f64,
        /// Size of the moments about the same directions, each a case of its own [N m].
        moment: Option<f64>,
    },
    /// An explicit list (CSV or JSON) or a trajectory (CSV), told apart by its columns.
    File(PathBuf),
}

/// An acceleration of the part's centre of mass of known size and unknown direction, without
/// rotation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Acceleration {
    /// Its size [m/s^2].
    pub magnitude: f64,
    /// Directions tried, spread over the sphere; the direction against gravity is always tried too.
    pub directions: usize,
}

impl Default for LoadSet {
    /// Gravity along the six part axes.
    fn default() -> Self {
        Self::new(vec![LoadSource::GravityAxes])
    }
}

impl LoadSet {
    /// A set of these sources without acceleration, world axes along the part's, gravity along
    /// world `-z`.
    pub fn new(sources: Vec<LoadSource>) -> Self {
        Self {
            sources,
            acceleration: None,
            world_from_part: Frame::IDENTITY,
            world_gravity: DVec3::new(0.0, 0.0, -STANDARD_GRAVITY),
        }
    }

    /// Parses sources joined by commas, each one of `gravity` (six axes),
    /// `gravity:DIR`, `gravity:N`, `gravity-cone:DIR:ANGLE`, `ball:N`, `ball:N:FORCE`,
    /// `ball:N+moments`, `ball:N:FORCE+moments:MOMENT` or a file ending in `.csv` or `.json`. `DIR`
    /// is `+x`, `-z`, ... or three numbers joined by slashes. `place` is the option for messages.
    ///
    /// # Errors
    /// When a source is none of these; the message lists them.
    pub fn parse(place: &str, text: &str) -> Result<Self> {
        Self::from_sources(place, text.split(','))
    }

    /// As [`LoadSet::parse`], from one text for each source.
    ///
    /// # Errors
    /// As [`LoadSet::parse`].
    pub fn from_sources<'a>(
        place: &str,
        sources: impl IntoIterator<Item = &'a str>,
    ) -> Result<Self> {
        let sources: Vec<_> = sources
            .into_iter()
            .map(|source| source::source(place, source.trim()))
            .collect::<Result<_>>()?;
        Ok(Self::new(sources))
    }

    /// The same set with an acceleration of `magnitude` [m/s^2] in [`ACCELERATION_DIRECTIONS`]
    /// directions on top of gravity.
    #[must_use]
    pub fn with_acceleration(mut self, magnitude: f64) -> Self {
        self.acceleration = Some(Acceleration { magnitude, directions: ACCELERATION_DIRECTIONS });
        self
    }

    /// The load cases of a part with these mass properties, sources in order. Files are read here.
    ///
    /// # Errors
    /// When a source needs a mass and the part has none that is positive and finite, a file cannot
    /// be read or is not what it should be (naming file and line), `acceleration` is set without a
    /// gravity source, or the cases are none or more than [`MAX_CASES`].
    pub fn cases(&self, mass: &MassProperties) -> Result<Vec<LoadCase>> {
        let mut cases = Vec::new();
        let mut accelerated = false;
        for source in &self.sources {
            let room = MAX_CASES - cases.len();
            match source {
                LoadSource::GravityAxes => {
                    accelerated = true;
                    self.gravity(&sphere::axes(), mass, room, &mut cases)?;
                }
                LoadSource::Gravity(direction) => {
                    accelerated = true;
                    self.gravity(&[unit(*direction)?], mass, room, &mut cases)?;
                }
                LoadSource::GravitySphere(count) => {
                    accelerated = true;
                    check_count("gravity", *count)?;
                    self.gravity(&sphere::directions(*count), mass, room, &mut cases)?;
                }
                LoadSource::GravityCone { axis, half_angle } => {
                    accelerated = true;
                    self.gravity(&sphere::cone(unit(*axis)?, *half_angle), mass, room, &mut cases)?;
                }
                LoadSource::Ball { directions, force, moment } => {
                    check_count("ball", *directions)?;
                    ball(*directions, *force, *moment, &mut cases);
                }
                LoadSource::File(path) => self.file(path, mass, &mut cases)?,
            }
            if cases.len() > MAX_CASES {
                return Err(too_many(cases.len()));
            }
        }
        if self.acceleration.is_some() && !accelerated {
            return Err(Error::input(
                "acceleration",
                "it acts on top of gravity, but no gravity load is requested",
                "add `gravity` to the loads, or state the wrenches in a file",
            )
            .with_options(&["accel", "loads"]));
        }
        if cases.is_empty() {
            return Err(Error::input(
                "loads",
                "no load case",
                "ask for at least one, e.g. `gravity`",
            )
            .with_options(&["loads"]));
        }
        Ok(cases)
    }

    /// The weight in each direction and, where asked for, with the inertial forces on top.
    fn gravity(
        &self,
        directions: &[DVec3],
        mass: &MassProperties,
        room: usize,
        cases: &mut Vec<LoadCase>,
    ) -> Result<()> {
        let mass = checked_mass(mass)?;
        let Some(acceleration) = self.acceleration else {
            cases.extend(directions.iter().map(|direction| {
                force_case(
                    format!("gravity {}", name(*direction)),
                    *direction * (mass * STANDARD_GRAVITY),
                )
            }));
            return Ok(());
        };
        check_count("acceleration", acceleration.directions)?;
        if !(acceleration.magnitude.is_finite() && acceleration.magnitude >= 0.0) {
            return Err(Error::input(
                "acceleration",
                format!("{} m/s2 is not one", acceleration.magnitude),
                "give a finite size, zero or more, e.g. 2g",
            )
            .with_options(&["accel"]));
        }
        let total = directions.len().saturating_mul(acceleration.directions + 1);
        if total > room {
            return Err(too_many(total));
        }
        let spread = sphere::directions(acceleration.directions);
        for direction in directions {
            let weight = *direction * (mass * STANDARD_GRAVITY);
            // Against gravity first: there the inertial force adds to the whole weight, which no
            // other direction does.
            for along in std::iter::once(-*direction).chain(spread.iter().copied()) {
                let name = format!("gravity {}, accelerated {}", name(*direction), name(along));
                cases.push(force_case(name, weight - along * (mass * acceleration.magnitude)));
            }
        }
        Ok(())
    }

    /// Reads a list or a trajectory, by suffix and header.
    fn file(&self, path: &Path, mass: &MassProperties, cases: &mut Vec<LoadCase>) -> Result<()> {
        let text = file::read_text(path)?;
        let place = path.display().to_string();
        let read = if path.extension().is_some_and(|suffix| suffix.eq_ignore_ascii_case("json")) {
            list::from_json(&place, &text, mass, &self.world_from_part)?
        } else {
            let table = table::Table::parse(&place, &text)?;
            if table.has("fx") || table.has("mx") {
                list::from_table(&table, mass, &self.world_from_part)?
            } else if table.has("t") {
                trajectory::from_table(&table, mass, &self.world_from_part, self.world_gravity)?
            } else {
                return Err(Error::input(
                    table.header_place(),
                    format!(
                        "the header '{}' is neither a list of wrenches nor a trajectory",
                        table.header()
                    ),
                    "a list has columns fx,fy,fz,mx,my,mz; a trajectory has t and one of ax,ay,az / vx,vy,vz / x,y,z / qx,qy,qz,qw / wx,wy,wz",
                ));
            }
        };
        cases.extend(read);
        Ok(())
    }
}

/// Carries a wrench in the part frame about the centre of mass into the grip frame about its
/// origin.
#[inline]
pub fn wrench_in_grip(wrench: &Wrench, centre_of_mass: DVec3, part_from_grip: &Frame) -> Wrench {
    let grip_from_part: DMat3 = part_from_grip.rotation.transpose();
    let arm = centre_of_mass - part_from_grip.origin;
    Wrench {
        force: grip_from_part * wrench.force,
        moment: grip_from_part * (wrench.moment + arm.cross(wrench.force)),
    }
}

/// The wrench of a body in motion: `m (g - a)` and `-(I alpha + omega x I omega)`, every vector in
/// the part frame.
///
/// `acceleration` is that of the centre of mass; the moment is about it. Newton's and Euler's
/// equations, as d'Alembert's forces.
pub fn inertial_wrench(
    mass: &MassProperties,
    gravity: DVec3,
    acceleration: DVec3,
    omega: DVec3,
    alpha: DVec3,
) -> Wrench {
    Wrench {
        force: mass.mass * (gravity - acceleration),
        moment: -(mass.inertia * alpha + omega.cross(mass.inertia * omega)),
    }
}

/// The paper's ball about the centre of mass.
fn ball(count: usize, force: f64, moment: Option<f64>, cases: &mut Vec<LoadCase>) {
    let directions = sphere::directions(count);
    // The outward normal of the facet is `direction`; the force is directed at the object.
    cases.extend(directions.iter().map(|direction| {
        force_case(format!("ball force {}", name(-*direction)), -*direction * force)
    }));
    if let Some(moment) = moment {
        cases.extend(directions.iter().map(|direction| LoadCase {
            name: format!("ball moment {}", name(-*direction)),
            wrench: Wrench { force: DVec3::ZERO, moment: -*direction * moment },
        }));
    }
}

fn force_case(name: String, force: DVec3) -> LoadCase {
    LoadCase { name, wrench: Wrench { force, moment: DVec3::ZERO } }
}

/// `+x`, `-z`, ... for an axis, else the three components.
fn name(direction: DVec3) -> String {
    for (axis, letter) in [(DVec3::X, 'x'), (DVec3::Y, 'y'), (DVec3::Z, 'z')] {
        if direction == axis {
            return format!("+{letter}");
        }
        if direction == -axis {
            return format!("-{letter}");
        }
    }
    // `+ 0.0` turns -0.000 into 0.000.
    let round = |value: f64| (value * 1e4).round() / 1e4 + 0.0;
    format!("({} {} {})", round(direction.x), round(direction.y), round(direction.z))
}

fn unit(direction: DVec3) -> Result<DVec3> {
    // Scaled by the largest component first: 1e-200 and 1e200 are directions too.
    let largest = direction.abs().max_element();
    if !(largest.is_finite() && largest > 0.0) {
        return Err(Error::input(
            "loads",
            format!("{direction} is not a direction"),
            "give three finite numbers, not all zero",
        )
        .with_options(&["loads"]));
    }
    Ok((direction / largest).normalize())
}

fn checked_mass(mass: &MassProperties) -> Result<f64> {
    if mass.mass.is_finite() && mass.mass > 0.0 {
        return Ok(mass.mass);
    }
    Err(Error::input(
        "loads",
        format!("the part's mass is {} kg, and gravity and inertia need one", mass.mass),
        "state a mass or a density",
    )
    .with_options(&["mass", "density"]))
}

fn check_count(place: &str, count: usize) -> Result<()> {
    if (1..=MAX_CASES).contains(&count) {
        Ok(())
    } else {
        Err(Error::input(place, format!("{count} directions"), format!("give 1 to {MAX_CASES}")))
    }
}

fn too_many(count: usize) -> Error {
    Error::new(
        ErrorKind::Limit,
        "loads",
        format!("{count} load cases"),
        format!("ask for at most {MAX_CASES}"),
    )
    .with_options(&["loads"])
}
