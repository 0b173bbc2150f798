//! Flags that choose among the grips of a result file.

use clap::Args as ClapArgs;
use gripfast::rank::Filter;
use gripfast::request::Cone;

/// Which grips are taken along.
#[derive(Debug, ClapArgs)]
#[command(next_help_heading = "Choice of grips")]
pub(crate) struct ChoiceArgs {
    /// Only these grips, by their ids, e.g. 3,17.
    #[arg(long, value_delimiter = ',', value_name = "IDS", value_parser = crate::plan::id)]
    ids: Option<Vec<u64>>,
    /// Only grips both of whose faces are among these, e.g. 2,3.
    #[arg(long, value_delimiter = ',', value_name = "FACES")]
    faces: Option<Vec<u32>>,
    /// Only approaches within a cone, e.g. -z:45deg or 0/0/-1:45deg (part frame).
    #[arg(long, value_name = "DIR:ANGLE", allow_hyphen_values = true)]
    approach: Option<Cone>,
    /// Only grips in which at least this share of the pad touches on both faces.
    #[arg(long, value_name = "SHARE", value_parser = crate::plan::share)]
    min_pad_share: Option<f64>,
    /// Only grips that hold with the pads' friction and the safety asked for.
    #[arg(long)]
    holding: bool,
    /// Only the best of the grips that a turn about the axis of a round part maps to each other.
    #[arg(long)]
    one_turn: bool,
    /// Grips that differ in place, face pair and approach, instead of the first ones; needs --top.
    #[arg(long, requires = "top")]
    diverse: bool,
    /// Only the first N of those that are left.
    #[arg(long, value_name = "N")]
    pub(crate) top: Option<usize>,
}

impl ChoiceArgs {
    /// The same for the library.
    pub(crate) fn filter(&self) -> Filter {
        let mut filter = Filter::default();
        filter.ids.clone_from(&self.ids);
        filter.faces.clone_from(&self.faces);
        filter.approach = self.approach;
        filter.min_pad_share = self.min_pad_share;
        (filter.holding, filter.one_turn) = (self.holding, self.one_turn);
        (filter.diverse, filter.top) = (self.diverse, self.top);
        filter
    }
}
