//! From a request to a plan that is ready to run.

use std::path::Path;

use rayon::{ThreadPool, ThreadPoolBuilder};

use super::{Plan, Settings, output};
use crate::backend::SeedSet;
use crate::error::{Error, ErrorKind, Result};
use crate::gripper::{self, Gripper};
use crate::load::LoadSet;
use crate::part::{MassProperties, Part, ReadOptions, is_plausible};
use crate::propose::ProposeOptions;
use crate::request::{Polish, Request};
use crate::results::LoadCase;
use crate::units::Unit;

/// Density at which a part is taken where no load depends on its mass [kg/m^3].
const ANY_DENSITY: f64 = 1000.0;

/// A plan in the making; see [`Plan::builder`].
///
/// ```
/// use gripfast::part::{Part, ReadOptions};
/// use gripfast::plan::Plan;
/// use gripfast::request::Request;
/// use gripfast::units::Density;
///
/// let part = Part::read("data/parts/hex_nut.stl".as_ref(), &ReadOptions::default())?;
/// let mut request = Request::new("", "generic");
/// request.density = Some(Density(7850.0));
/// let plan = Plan::builder(request).part(part).build()?;
/// assert_eq!(plan.loads().len(), 6); // gravity along the six axes
/// # Ok::<(), gripfast::error::Error>(())
/// ```
#[derive(Debug)]
pub struct PlanBuilder {
    request: Request,
    part: Option<Part>,
    gripper: Option<Gripper>,
    loads: Option<Vec<LoadCase>>,
    command: Vec<String>,
    first_only: bool,
}

impl PlanBuilder {
    pub(super) fn new(request: Request) -> Self {
        Self {
            request,
            part: None,
            gripper: None,
            loads: None,
            command: Vec::new(),
            first_only: false,
        }
    }

    /// This part, instead of the file that the request names.
    #[must_use]
    pub fn part(mut self, part: Part) -> Self {
        self.part = Some(part);
        self
    }

    /// This gripper, instead of the one that the request names.
    #[must_use]
    pub fn gripper(mut self, gripper: Gripper) -> Self {
        self.gripper = Some(gripper);
        self
    }

    /// These loads, instead of those that the request describes: wrenches on the part in its frame,
    /// about its centre of mass.
    #[must_use]
    pub fn loads(mut self, loads: Vec<LoadCase>) -> Self {
        self.loads = Some(loads);
        self
    }

    /// Only [`super::Outcome::shown`] and the counts will be looked at: unless the request says
    /// otherwise, grips that cannot be among those shown are left unsolved and counted.
    #[must_use]
    pub fn first_only(mut self) -> Self {
        self.first_only = true;
        self
    }

    /// The command line that led here, for the provenance of the result.
    #[must_use]
    pub fn command(mut self, command: Vec<String>) -> Self {
        self.command = command;
        self
    }

    /// Reads what is not in memory, and checks that everything fits together.
    ///
    /// # Errors
    /// As [`Plan::new`].
    pub fn build(self) -> Result<Plan> {
        let Self { mut request, part, gripper, loads, command, first_only } = self;
        request.check()?;
        let asked_polish = request.scoring.polish;
        let shown_only = first_only && !request.writes();
        if asked_polish == Polish::Auto {
            let first = first_only && request.wants_first_only();
            request.scoring.polish = if first { Polish::Top } else { Polish::Worst };
        }
        let gripper = gripper.map_or_else(|| gripper::find(&request.gripper), Ok)?;
        let settings = Settings::new(&request, &gripper)?;
        let sources = if loads.is_none() { Some(load_set(&request)?) } else { None };
        let seeds = SeedSet::with_at_least(request.scoring.seeds)?;
        let format = request.output.output.as_deref().map(output::format).transpose()?;
        if let Some(page) = &request.output.report {
            output::folder(page, format!("page {}", page.display()), "report")?;
        }
        let threads = threads(request.scoring.threads)?;
        let mut part = match part {
            Some(part) => part,
            None => read_part(&request, &threads)?,
        };
        if let Some(com) = &request.com {
            part.set_centre_of_mass(com.0);
        }
        let mass = mass(&request, &part, loads.is_some())?;
        let loads = match (loads, sources) {
            (Some(loads), _) => checked(loads)?,
            (None, Some(sources)) => sources.cases(&mass)?,
            (None, None) => Vec::new(),
        };
        let mut warnings = part.health.warnings.clone();
        warnings.extend(doubts(&request, &part, &mass));
        warnings.extend(settings.limits.doubt(&loads, &gripper));
        if !part.health.watertight {
            warnings.push(
                "the surface is not watertight: volume, centre of mass and inertia are estimates \
                 (see `gripfast part`)"
                    .to_owned(),
            );
        }
        if request.scoring.threads.is_some_and(|number| number > threads.current_num_threads()) {
            warnings.push(format!(
                "{} threads are more than this machine can use: {} run",
                request.scoring.threads.unwrap_or_default(),
                threads.current_num_threads()
            ));
        }
        let mut propose = ProposeOptions::read(&request.candidates)
            .map_err(|error| error.with_options(&["scene"]))?;
        propose.force = Some(settings.force);
        let symmetry = part.symmetry();
        Ok(Plan {
            request,
            asked_polish,
            part,
            gripper,
            mass,
            symmetry,
            loads,
            propose,
            settings,
            seeds,
            format,
            command,
            warnings,
            shown_only,
            threads,
        })
    }
}

/// The most threads that a run takes: more gain nothing and cost memory.
#[must_use]
pub fn most_threads() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from).max(16) * 4
}

/// Threads of the plan's own.
fn threads(number: Option<usize>) -> Result<ThreadPool> {
    let number = number.map(|number| number.min(most_threads()));
    let named = ThreadPoolBuilder::new().thread_name(|index| format!("gripfast {index}"));
    named.num_threads(number.unwrap_or(0)).build().map_err(|error| {
        Error::new(
            ErrorKind::Limit,
            "threads",
            format!("cannot be started: {error}"),
            "ask for fewer",
        )
        .with_options(&["threads"])
    })
}

fn read_part(request: &Request, threads: &ThreadPool) -> Result<Part> {
    if request.part.as_os_str().is_empty() {
        return Err(Error::input("part", "none is named", "give a part file"));
    }
    threads.install(|| Part::read(Path::new(&request.part), &ReadOptions::from(request)))
}

fn load_set(request: &Request) -> Result<LoadSet> {
    let sources = request.loads.iter().map(String::as_str);
    let loads =
        LoadSet::from_sources("loads", sources).map_err(|error| error.with_options(&["loads"]))?;
    Ok(match request.accel {
        Some(accel) => loads.with_acceleration(accel.0),
        None => loads,
    })
}

/// Loads of the caller's own.
fn checked(loads: Vec<LoadCase>) -> Result<Vec<LoadCase>> {
    let finite = |load: &&LoadCase| load.wrench.force.is_finite() && load.wrench.moment.is_finite();
    if let Some(load) = loads.iter().find(|load| !finite(load)) {
        return Err(Error::input(
            "loads",
            format!("'{}' is not finite", load.name),
            "give finite forces and moments",
        ));
    }
    if loads.is_empty() {
        return Err(Error::input("loads", "no load case", "give at least one"));
    }
    Ok(loads)
}

/// Densities beyond which a mass or a unit is hardly right [kg/m^3]: osmium has 22,600, the lightest
/// foams some 10.
const DENSITIES: [f64; 2] = [10.0, 23_000.0];

/// Densities of what parts are mostly made of, and the middle of these [kg/m^3].
const USUAL: [f64; 3] = [500.0, 2700.0, 20_000.0];

/// Sizes between which a part is usual for a gripper \[m\].
const USUAL_SIZES: [f64; 2] = [2e-3, 0.5];

/// The unit in which the file's numbers make a part of a usual density and size, and that density
/// [kg/m^3]; `density`: that in the unit in which they were read.
fn likely_unit(density: f64, part: &Part) -> Option<(Unit, f64)> {
    let off = |density: f64| (density / USUAL[1]).ln().abs();
    let (low, high) = part.mesh.bounding_box();
    let size = (high - low).max_element();
    Unit::ALL
        .into_iter()
        .map(|unit| (unit, unit.metres() / part.unit_m))
        .filter(|&(_, times)| {
            times != 1.0 && (USUAL_SIZES[0]..=USUAL_SIZES[1]).contains(&(size * times))
        })
        .map(|(unit, times)| (unit, density / times.powi(3)))
        .filter(|&(_, density)| (USUAL[0]..=USUAL[2]).contains(&density))
        .min_by(|a, b| off(a.1).total_cmp(&off(b.1)))
}

/// What is doubtful about mass and centre of mass.
fn doubts(request: &Request, part: &Part, mass: &MassProperties) -> Vec<String> {
    let mut doubts = Vec::new();
    let density = mass.mass / mass.volume;
    let stated = request.mass.is_some() || request.density.is_some();
    let (low, high) = part.mesh.bounding_box();
    // A part of an implausible size has got its hint, and two that differ help nobody.
    let hint = request.mass.filter(|_| is_plausible(high - low));
    let unit = hint.and_then(|_| likely_unit(density, part));
    let remedy = unit.map_or(String::new(), |(unit, density)| {
        format!("; the unit {unit} would give {:.1} g/cm3", density / 1e3)
    });
    if stated && density > DENSITIES[1] {
        doubts.push(format!(
            "the part would be {:.*} g/cm3 dense, more than any metal: check its mass and the unit \
             of its file{remedy}",
            usize::from(density < 1e6),
            density / 1e3
        ));
    } else if stated && density < DENSITIES[0] {
        doubts.push(format!(
            "the part would be {density:.3} kg/m3 dense, less than any foam: check its mass and the \
             unit of its file{remedy}"
        ));
    }
    let centre = mass.centre_of_mass;
    if request.com.is_some() && (centre.cmplt(low) | centre.cmpgt(high)).any() {
        doubts.push(format!(
            "the centre of mass ({:.2}, {:.2}, {:.2}) mm lies outside of the part's bounding box",
            centre.x * 1e3,
            centre.y * 1e3,
            centre.z * 1e3
        ));
    }
    doubts
}

/// Mass properties at the mass or density asked for, with the inertia asked for.
fn mass(request: &Request, part: &Part, own_loads: bool) -> Result<MassProperties> {
    let mut mass = solid_mass(request, part, own_loads)?;
    if let Some(inertia) = &request.inertia {
        mass.inertia = inertia.matrix();
    }
    Ok(mass)
}

/// Those of the solid.
fn solid_mass(request: &Request, part: &Part, own_loads: bool) -> Result<MassProperties> {
    let ball = |source: &String| source.trim().starts_with("ball");
    match (request.mass, request.density) {
        (Some(mass), _) => {
            if mass.0.is_nan() || mass.0 <= 0.0 {
                return Err(Error::input(
                    "mass",
                    format!("is {} kg", mass.0),
                    "give a mass above zero",
                )
                .with_options(&["mass"]));
            }
            let unit = part.mass_properties(1.0);
            if unit.volume.is_nan() || unit.volume <= 0.0 {
                return Err(Error::new(
                    ErrorKind::Geometry,
                    part.file.display().to_string(),
                    "the surface encloses no volume",
                    "repair the mesh: without a volume there is no centre of mass",
                ));
            }
            Ok(part.mass_properties(mass.0 / unit.volume))
        }
        (None, Some(density)) => Ok(part.mass_properties(density.0)),
        (None, None) if own_loads || request.loads.iter().all(ball) => {
            Ok(part.mass_properties(ANY_DENSITY))
        }
        (None, None) => Err(Error::input(
            "mass",
            "the part's mass is not known",
            "give its mass, e.g. 350g, or its density: 2700kg/m3 (aluminium), 7850kg/m3 (steel), \
             1200kg/m3 (plastic)",
        )
        .with_options(&["mass", "density"])),
    }
}
