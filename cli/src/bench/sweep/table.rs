//! The sweep's tables as Markdown.

use std::fmt::Write as _;

use super::{Report, Row};

impl Report {
    pub(super) fn markdown(&self) -> String {
        let mut text = String::new();
        match &self.adapter {
            Some(adapter) => {
                let _ = writeln!(text, "Adapter: {adapter}; {} threads.", self.threads);
            }
            None => {
                let _ = writeln!(text, "No adapter; {} threads.", self.threads);
            }
        }
        if self.software_adapter {
            text += "**The adapter is software: its figures show that everything runs, and say \
nothing about speed.**\n";
        }
        text += "\nLoads a second (millions) and evaluations (load x twist) a second (millions); in \
brackets grips scored to the end a second.\n\n\
| twists | loads | contacts | one core | all cores | adapter | evaluations | over one core | \
over all cores | bounds, answers apart |\n|---|---|---|---|---|---|---|---|---|---|\n";
        let places = if self.adapter.is_some() { 3 } else { 2 };
        for cell in self.rows.chunks(places) {
            let rate = |row: Option<&Row>| {
                let Some(row) = row.filter(|row| row.runs > 0) else { return String::new() };
                let grips = row.scoring.as_ref().map_or_else(String::new, |scoring| {
                    format!(" ({:.0})", scoring.grips_per_second)
                });
                format!("{:.3}{grips}", row.loads_per_second * 1e-6)
            };
            let ratio = |ratio: Option<f64>| ratio.map_or_else(String::new, |x| format!("{x:.2}"));
            let Some(last) = cell.last() else { continue };
            let adapter = cell.get(2);
            let apart = adapter.and_then(|row| row.difference).map_or_else(
                || last.left_out.clone().unwrap_or_default(),
                |[bounds, answers]| format!("{bounds:.0e}, {answers:.0e}"),
            );
            let _ = writeln!(
                text,
                "| {} | {} | {} | {} | {} | {} | {} | {} | {} | {apart} |",
                last.twists,
                last.loads,
                last.contacts,
                rate(cell.first()),
                rate(cell.get(1)),
                rate(adapter),
                if last.runs > 0 {
                    format!("{:.1}", last.evaluations_per_second * 1e-6)
                } else {
                    String::new()
                },
                ratio(adapter.and_then(|row| row.over_one_core)),
                ratio(adapter.and_then(|row| row.over_all_cores)),
            );
        }
        if self.adapter.is_some() {
            self.step_table(&mut text);
        }
        if let Some(why) = &self.failure {
            let _ = writeln!(text, "\n**FAILED**: {why}");
        } else if !self.complete {
            text += "\nThe time was over before the last rows.\n";
        }
        text
    }

    fn step_table(&self, text: &mut String) {
        let clock = if self.timestamps {
            "Upload, basis, search, newton and readback by the device's timestamps"
        } else {
            "The adapter has no timestamps: its steps are in `wait`"
        };
        let _ = write!(
            text,
            "\nSteps of a batch on the adapter, nanoseconds a load. {clock}; make, send, wait, \
fetch and spread by the processor's clock; polish: exact answers, nanoseconds a load of the grips \
scored; hidden: share of the kernels' time there in \
which exact answers of the block before were computed. Arithmetic and memory: share of the adapter's limit while the kernels run{}.\n\n\
| twists | loads | contacts | loads a run | chunks | bytes a grip up | down | entries a grip | make | send | upload | basis | search | newton | \
readback | wait | fetch | spread | whole | polish | hidden | kernels of whole | arithmetic | memory |\n\
|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|\n",
            if self.limits.is_some() { "" } else { " (unknown for this one)" }
        );
        for row in &self.rows {
            let Some(steps) = &row.steps else { continue };
            let loads = (row.grips * row.loads) as f64;
            let each = |seconds: f64| format!("{:.1}", seconds / loads * 1e9);
            let maybe = |seconds: Option<f64>| seconds.map_or_else(String::new, each);
            let percent = |share: Option<f64>| {
                share.map_or_else(String::new, |share| format!("{:.1} %", share * 100.0))
            };
            let polish = row.scoring.as_ref().and_then(|scoring| {
                Some(scoring.polish? / (scoring.grips * row.loads) as f64 * loads)
            });
            let _ = writeln!(
                text,
                "| {} | {} | {} | {loads} | {} | {:.0} | {:.0} | {:.1} | {} | {} | {} | {} | {} | {} | \
{} | {} | {} | {} | {} | {} | {} | {} | {} | {} |",
                row.twists,
                row.loads,
                row.contacts,
                steps.chunks,
                steps.bytes_up,
                steps.bytes_down,
                steps.entries,
                each(steps.make),
                each(steps.send),
                maybe(steps.upload),
                maybe(steps.basis),
                maybe(steps.search),
                maybe(steps.newton),
                maybe(steps.readback),
                each(steps.wait),
                each(steps.fetch),
                each(steps.spread),
                each(steps.whole),
                maybe(polish),
                percent(row.scoring.as_ref().and_then(|scoring| scoring.hidden)),
                percent(row.share.as_ref().map(|share| share.kernels)),
                percent(row.share.as_ref().and_then(|share| share.arithmetic)),
                percent(row.share.as_ref().and_then(|share| share.memory)),
            );
        }
    }
}
