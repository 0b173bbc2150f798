//! Options that are one of a few words.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};

/// An enum whose variants are words in files and flags.
macro_rules! words {
    ($(
        $(#[$meta:meta])*
        $name:ident, $what:literal { $($(#[$about:meta])* $variant:ident = $word:literal),+ $(,)? }
    )+) => {$(
        $(#[$meta])*
        #[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
        pub enum $name {
            $($(#[$about])* #[serde(rename = $word)] $variant),+
        }

        impl $name {
            /// The words, in the order of the variants.
            pub const WORDS: &'static [&'static str] = &[$($word),+];

            /// The word in files and flags.
            pub fn word(self) -> &'static str {
                match self {
                    $(Self::$variant => $word),+
                }
            }
        }

        impl fmt::Display for $name {
            fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
                formatter.pad(self.word())
            }
        }

        impl FromStr for $name {
            type Err = Error;

            fn from_str(text: &str) -> Result<Self> {
                match text {
                    $($word => Ok(Self::$variant),)+
                    _ => Err(Error::input(
                        $what,
                        format!("'{text}' is not one of its words"),
                        format!("use one of: {}", Self::WORDS.join(", ")),
                    )
                    .with_options(&[$what])),
                }
            }
        }
    )+};
}

words! {
    /// From where the pads push at the faces.
    Side, "grips" {
        /// The jaws close on the part.
        #[default]
        Outside = "outside",
        /// The jaws open against the faces of a slot or bore.
        Inside = "inside",
        /// Either.
        Both = "both",
    }

    /// Which backend searches slip twists.
    Choice, "backend" {
        /// A GPU where there is one, else the processor. A GPU lost on the way is replaced by the
        /// processor.
        #[default]
        Auto = "auto",
        /// The processor.
        Cpu = "cpu",
        /// A GPU; an error where there is none, or when it is lost.
        Gpu = "gpu",
    }

    /// What to do with a grip whose pads separate under the load.
    Separation, "separation" {
        /// Find the contact that remains and solve with it (paper 3.6).
        #[default]
        Solve = "solve",
        /// Refuse it with [`crate::model::Status::Separating`] (the paper's rule, 5.3).
        Discard = "discard",
    }

    /// Which loads are solved exactly.
    Polish, "polish" {
        /// Those that can be a grip's worst one.
        #[default]
        Worst = "worst",
        /// The same, and only for grips that can be among the best ones kept.
        Top = "top",
        /// All of them.
        All = "all",
        /// As `top` where nobody looks at more than the first grips, else as `worst`.
        Auto = "auto",
    }

    /// Which minimiser refines a solution.
    Refiner, "refiner" {
        /// Damped Newton with the analytic Hessian or Jacobian.
        #[default]
        Newton = "newton",
        /// Shanno's conjugate-direction method (the paper's reference 17), in variables scaled by
        /// the Hessian or Jacobian at the start.
        Shanno = "shanno",
    }
}
