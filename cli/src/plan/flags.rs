//! Flags of `plan` to values, each with its own refusal.

use std::path::Path;

use gripfast::error::{Error, Result};
use gripfast::export::{self, Format};
use gripfast::gripper::Gripper;
use gripfast::part::{MassProperties, Part};
use gripfast::plan::noise::Noise;
use gripfast::request::EarlierWeights;
use gripfast::units::Quantity;

use super::Args;

pub(super) fn finite(flag: &str, value: f64) -> Result<f64> {
    if value.is_finite() {
        Ok(value)
    } else {
        Err(Error::input(flag, format!("is {value}"), "give a finite number"))
    }
}

pub(super) fn not_negative(flag: &str, value: f64) -> Result<f64> {
    if value.is_finite() && value >= 0.0 {
        Ok(value)
    } else {
        Err(Error::input(flag, format!("is {value}"), "give a number, zero or more"))
    }
}

pub(super) fn check_force(force: f64, gripper: &Gripper) -> Result<()> {
    let [least, most] = gripper.force;
    if force <= 0.0 {
        return Err(Error::input("--force", format!("is {force} N"), "give a force above zero"));
    }
    if force < least * (1.0 - 1e-9) || force > most * (1.0 + 1e-9) {
        return Err(Error::input(
            "--force",
            format!("{force} N is outside what {} can do", gripper.name),
            format!("give {least} N to {most} N"),
        ));
    }
    Ok(())
}

/// Mass properties at the mass or density asked for.
pub(super) fn mass(args: &Args, part: &Part) -> Result<MassProperties> {
    match (&args.mass, &args.density) {
        (Some(text), _) => {
            let mass = Quantity::Mass.parse("--mass", text)?;
            let unit = part.mass_properties(1.0);
            if mass <= 0.0 {
                return Err(Error::input(
                    "--mass",
                    format!("is {mass} kg"),
                    "give a mass above zero",
                ));
            }
            if unit.volume.is_nan() || unit.volume <= 0.0 {
                return Err(Error::input(
                    part.file.display().to_string(),
                    "the surface encloses no volume",
                    "repair the mesh: without a volume there is no centre of mass",
                ));
            }
            Ok(part.mass_properties(mass / unit.volume))
        }
        (None, Some(text)) => Ok(part.mass_properties(Quantity::Density.parse("--density", text)?)),
        (None, None) if args.loads.split(',').all(|source| source.trim().starts_with("ball")) => {
            Ok(part.mass_properties(1000.0))
        }
        (None, None) => Err(Error::input(
            "--mass",
            "the part's mass is not known",
            "give --mass 350g, or --density 2700kg/m3 (aluminium), 7850kg/m3 (steel), 1200kg/m3 (plastic)",
        )),
    }
}

/// Most displaced poses per grip.
const MOST_SAMPLES: u32 = 1_000_000;

/// `--pose-noise LENGTH,ANGLE` and `--noise-samples N`.
pub(super) fn noise(args: &Args) -> Result<Option<Noise>> {
    let flag = "--pose-noise";
    let Some(text) = &args.pose_noise else { return Ok(None) };
    let Some((shift, turn)) = text.split_once(',') else {
        return Err(Error::input(
            flag,
            format!("'{text}' is not a length and an angle"),
            "give both, e.g. 1mm,2deg",
        ));
    };
    let noise = Noise {
        shift: Quantity::Length.parse(flag, shift)?,
        turn: Quantity::Angle.parse(flag, turn)?,
        samples: args.noise_samples,
    };
    if noise.shift < 0.0 || noise.turn < 0.0 {
        return Err(Error::input(
            flag,
            format!("'{text}' is negative"),
            "give how far the pose may be off either way, zero or more",
        ));
    }
    if !(1..=MOST_SAMPLES).contains(&noise.samples) {
        return Err(Error::input(
            "--noise-samples",
            format!("is {}", noise.samples),
            format!("give 1 to {MOST_SAMPLES}"),
        ));
    }
    Ok(Some(noise))
}

/// The weights of `--compare=K1,K2,K3,EPSILON`; an empty text stands for the usual ones.
pub(super) fn earlier_weights(text: &str) -> Result<EarlierWeights> {
    let flag = "--compare";
    if text.is_empty() {
        return Ok(EarlierWeights::default());
    }
    let parts: Vec<&str> = text.split(',').map(str::trim).collect();
    let [k1, k2, k3, epsilon] = parts[..] else {
        return Err(Error::input(
            flag,
            format!("'{text}' is not four values"),
            "give K1,K2,K3,EPSILON, e.g. 1,1,1,1mm, or nothing",
        ));
    };
    let weight = |text: &str| match text.parse() {
        Ok(value) => not_negative(flag, value),
        Err(_) => Err(Error::input(
            flag,
            format!("'{text}' is not a number"),
            "give K1,K2,K3,EPSILON, e.g. 1,1,1,1mm",
        )),
    };
    let epsilon = Quantity::Length.parse(flag, epsilon)?;
    if epsilon <= 0.0 {
        return Err(Error::input(
            flag,
            format!("EPSILON is {epsilon} m"),
            "give a length above zero: a grip at the centre of mass is divided by it",
        ));
    }
    Ok(EarlierWeights { k1: weight(k1)?, k2: weight(k2)?, k3: weight(k3)?, epsilon })
}

/// The format of `-o FILE` by its ending, refused now rather than after the search.
pub(super) fn output_format(path: &Path) -> Result<Format> {
    if path.as_os_str() == "-" {
        return Err(Error::input(
            "-o -",
            "the table goes to standard output",
            "use --json for the result there, without -o",
        ));
    }
    if let Some(folder) =
        path.parent().filter(|folder| !folder.as_os_str().is_empty() && !folder.is_dir())
    {
        return Err(Error::input(
            format!("-o {}", path.display()),
            format!("the folder '{}' is not there", folder.display()),
            "make it first",
        ));
    }
    if path.extension().is_none() {
        return Ok(Format::Json);
    }
    let format = Format::from_path(path).map_err(|_| {
        let endings: Vec<&str> = Format::ALL.iter().flat_map(|known| known.2).copied().collect();
        Error::input(
            format!("-o {}", path.display()),
            "the file's ending names no format",
            format!("use one of {}", endings.join(", ")),
        )
    })?;
    export::check(format)?;
    Ok(format)
}

/// `--checkpoint TIME`.
pub(super) fn interval(text: &str) -> Result<std::time::Duration> {
    let seconds = Quantity::Time.parse("--checkpoint", text)?;
    std::time::Duration::try_from_secs_f64(seconds).map_err(|_| {
        Error::input(
            "--checkpoint",
            format!("'{text}' is no time to wait"),
            "give zero (after every chunk) or more, e.g. 30s",
        )
    })
}
